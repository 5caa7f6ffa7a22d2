//! The descriptions and weights that come with the crate, by name.

use std::collections::BTreeMap;

use crate::weights::card::DRAWN_BY;
use crate::{AnyDescription, Card, Description, FrameDescription, Weights, draw};

/// A description with the weights that it runs with.
struct Shipped {
    name: &'static str,
    description: &'static str,
    weights: &'static [u8],
}

const SHIPPED: &[Shipped] = &[
    Shipped {
        name: "digits-all",
        description: include_str!("../networks/digits-all.toml"),
        weights: include_bytes!("../weights/digits/digits-all.0.safetensors"),
    },
    Shipped {
        name: "digits-frozen",
        description: include_str!("../networks/digits-frozen.toml"),
        weights: include_bytes!("../weights/digits/digits-past.0.safetensors"),
    },
    Shipped {
        name: "digits-past",
        description: include_str!("../networks/digits-past.toml"),
        weights: include_bytes!("../weights/digits/digits-past.0.safetensors"),
    },
    Shipped {
        name: "graphres",
        description: include_str!("../networks/graphres.toml"),
        weights: include_bytes!("../weights/graphres.safetensors"),
    },
    Shipped {
        name: "graphres-published",
        description: include_str!("../networks/graphres-published.toml"),
        weights: include_bytes!("../weights/graphres.safetensors"),
    },
    Shipped {
        name: "tactigraph",
        description: include_str!("../networks/tactigraph.toml"),
        weights: include_bytes!("../weights/tactigraph.safetensors"),
    },
    Shipped {
        name: "tactigraph-frozen",
        description: include_str!("../networks/tactigraph-frozen.toml"),
        weights: include_bytes!("../weights/tactigraph.safetensors"),
    },
    Shipped {
        name: "tactigraph-past",
        description: include_str!("../networks/tactigraph-past.toml"),
        weights: include_bytes!("../weights/tactigraph-past.safetensors"),
    },
];

const NAMES: &[&str] = &[
    "digits-all",
    "digits-frozen",
    "digits-past",
    "graphres",
    "graphres-published",
    "tactigraph",
    "tactigraph-frozen",
    "tactigraph-past",
];

/// A frame network with the weights that it runs with.
struct ShippedFrames {
    name: &'static str,
    description: &'static str,
    weights: FrameWeights,
}

/// Where the weights of a frame network come from.
enum FrameWeights {
    /// Drawn from this seed when they are asked for: as files they would be many times the size of everything else.
    Drawn(u64),
    /// The bytes of a file that `train/` wrote.
    Trained(&'static [u8]),
}

/// A frame network whose description is in `networks/` and whose weights are drawn from a seed.
macro_rules! drawn {
    ($name:literal, $seed:literal) => {
        ShippedFrames {
            name: $name,
            description: include_str!(concat!("../networks/", $name, ".toml")),
            weights: FrameWeights::Drawn($seed),
        }
    };
}

/// One with the first of its trained weights, those of seed 0.
macro_rules! trained {
    ($folder:literal, $name:literal) => {
        ShippedFrames {
            name: $name,
            description: include_str!(concat!("../networks/", $name, ".toml")),
            weights: FrameWeights::Trained(include_bytes!(concat!(
                "../weights/",
                $folder,
                "/",
                $name,
                ".0.safetensors"
            ))),
        }
    };
}

const FRAMES: &[ShippedFrames] = &[
    drawn!("canf", 11),
    drawn!("canf-plain", 12),
    drawn!("event-frame-cnn", 13),
    drawn!("force-cnnlstm", 14),
    drawn!("force-convlstm", 15),
    drawn!("force-lstm", 16),
    drawn!("force-tdnn", 17),
    trained!("slip", "slip-best"),
    trained!("slip", "slip-lstm"),
    trained!("slip", "slip-regularised"),
    trained!("slip", "slip-tuned"),
];

const FRAME_NAMES: &[&str] = &[
    "canf",
    "canf-plain",
    "event-frame-cnn",
    "force-cnnlstm",
    "force-convlstm",
    "force-lstm",
    "force-tdnn",
    "slip-best",
    "slip-lstm",
    "slip-regularised",
    "slip-tuned",
];

/// Weights files that are drawn, with their seeds.
pub const DRAWN: &[(&str, u64)] = &[("graphres", 1), ("tactigraph", 2), ("tactigraph-past", 3)];

fn find(name: &str) -> Option<&'static Shipped> {
    SHIPPED.iter().find(|shipped| shipped.name == name)
}

fn find_frames(name: &str) -> Option<&'static ShippedFrames> {
    FRAMES.iter().find(|shipped| shipped.name == name)
}

impl Description {
    /// The description of a network over events that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        find(name)
            .map(|shipped| Self::parse(shipped.description).expect("shipped descriptions are consistent"))
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        NAMES
    }
}

impl FrameDescription {
    /// The description of a frame network that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        find_frames(name)
            .map(|shipped| Self::parse(shipped.description).expect("shipped descriptions are consistent"))
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        FRAME_NAMES
    }
}

impl AnyDescription {
    /// The description of a network of either kind that comes with the crate.
    pub fn shipped(name: &str) -> Option<Self> {
        let frames = || FrameDescription::shipped(name).map(Self::Frames);
        Description::shipped(name).map(Self::Events).or_else(frames)
    }

    /// Names that [`Self::shipped`] knows: networks over events, then frame networks.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().chain(FRAME_NAMES).copied()
    }
}

impl Weights {
    /// Weights of a network that comes with the crate. "graphres-published" has those of "graphres",
    /// "tactigraph-frozen" those of "tactigraph", "digits-frozen" those of "digits-past". Those of frame networks that nothing trained are drawn on the
    /// spot, the same bits everywhere.
    ///
    /// # Panics
    /// Never: the tests read every one.
    pub fn shipped(name: &str) -> Option<Self> {
        let Some(frames) = find_frames(name) else {
            return find(name).map(|shipped| read(shipped.weights));
        };
        match frames.weights {
            FrameWeights::Trained(bytes) => Some(read(bytes)),
            FrameWeights::Drawn(seed) => {
                let description = FrameDescription::shipped(name)?;
                Some(draw(&description, seed).with_metadata(remarks(name, seed)))
            }
        }
    }
}

impl Card {
    /// That of the weights of a network that comes with the crate, without drawing any.
    ///
    /// # Panics
    /// Never: the tests read every one.
    pub fn shipped(name: &str) -> Option<Self> {
        let weights = match find_frames(name).map(|frames| &frames.weights) {
            Some(&FrameWeights::Drawn(seed)) => Weights::new([]).with_metadata(remarks(name, seed)),
            _ => Weights::shipped(name)?,
        };
        Some(weights.card().expect("shipped weights have a card"))
    }
}

fn read(bytes: &[u8]) -> Weights {
    Weights::from_bytes(bytes).expect("shipped weights are readable")
}

/// What drawn weights say about themselves.
fn remarks(name: &str, seed: u64) -> BTreeMap<String, String> {
    let remarks = [
        ("about", format!("drawn, untrained, seed {seed}")),
        ("network", name.to_owned()),
        ("generator", DRAWN_BY.to_owned()),
    ];
    remarks.map(|(key, value)| (key.to_owned(), value)).into()
}

/// The bytes of a safetensors file with weights that are [drawn](draw()) from `seed`, whose metadata says that nothing trained
/// them; equal descriptions and seeds give equal bytes.
pub fn drawn_file(description: &impl crate::Drawable, seed: u64) -> Vec<u8> {
    draw(description, seed).to_safetensors(&remarks(description.network_name(), seed))
}

#[cfg(test)]
mod tests {
    use super::{FRAME_NAMES, FRAMES, NAMES, SHIPPED};

    #[test]
    fn the_names_are_those_of_what_is_shipped() {
        assert!(SHIPPED.iter().map(|shipped| shipped.name).eq(NAMES.iter().copied()));
        assert!(FRAMES.iter().map(|shipped| shipped.name).eq(FRAME_NAMES.iter().copied()));
    }
}
