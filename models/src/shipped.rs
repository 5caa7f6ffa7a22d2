//! The descriptions and weights that come with the crate, by name.

use std::collections::BTreeMap;

use crate::description::frames::FrameDescription;
use crate::description::{AnyDescription, Description, DescriptionError};
use crate::draw::{Drawable, draw};
use crate::weights::Weights;
use crate::weights::card::{Card, DRAWN_BY};

/// The network that runs if none is named: small enough for a laptop, with the shape of the published one.
pub const DEFAULT_NETWORK: &str = "tactigraph-past";

/// A description with the weights that it runs with.
struct Shipped {
    name: &'static str,
    description: &'static str,
    weights: ShippedWeights,
}

/// Origin of shipped weights.
#[derive(Clone, Copy)]
enum ShippedWeights {
    /// Drawn from this seed on request. As files they would be many times larger than the rest of the crate.
    Drawn(u64),
    /// The bytes of a file.
    File(&'static [u8]),
}

/// A network by its name, with the file of its weights or the seed that they are drawn from.
macro_rules! shipped {
    ($name:literal, seed = $seed:literal) => {
        shipped!($name, ShippedWeights::Drawn($seed))
    };
    ($name:literal, file = $file:literal) => {
        shipped!($name, ShippedWeights::File(include_bytes!(concat!("../weights/", $file, ".safetensors"))))
    };
    ($name:literal, $weights:expr) => {
        Shipped {
            name: $name,
            description: include_str!(concat!("../networks/", $name, ".toml")),
            weights: $weights,
        }
    };
}

/// Networks over events.
static EVENTS: [Shipped; 14] = [
    shipped!("digits-all", file = "digits/digits-all.0"),
    shipped!("digits-frozen", file = "digits/digits-past.0"),
    shipped!("digits-past", file = "digits/digits-past.0"),
    shipped!("force-graph", file = "force/force-graph.0"),
    shipped!("graphres", file = "angle/graphres.0"),
    shipped!("graphres-published", file = "angle/graphres-published.0"),
    shipped!("tactigraph", file = "angle/tactigraph.0"),
    shipped!("tactigraph-frozen", file = "angle/tactigraph-frozen.0"),
    shipped!("tactigraph-past", file = "angle/tactigraph-past.0"),
    shipped!("tactip", file = "angle/tactip.0"),
    shipped!("tactip-past", file = "angle/tactip-past.0"),
    shipped!("tactip-shear", file = "angle/tactip-shear.0"),
    shipped!("touch-containers", file = "touch/touch-containers.0"),
    shipped!("touch-objects", file = "touch/touch-objects.0"),
];

/// Frame networks. Of several trainings, the weights are those of seed 0.
static FRAMES: [Shipped; 12] = [
    shipped!("canf", seed = 11),
    shipped!("canf-plain", seed = 12),
    shipped!("event-frame-cnn", file = "angle/event-frame-cnn.0"),
    shipped!("force-cnnlstm", file = "force/force-cnnlstm.0"),
    shipped!("force-convlstm", file = "force/force-convlstm.0"),
    shipped!("force-lstm", file = "force/force-lstm.0"),
    shipped!("force-tdnn", file = "force/force-tdnn.0"),
    shipped!("slip-best", file = "slip/slip-best.0"),
    shipped!("slip-lstm", file = "slip/slip-lstm.0"),
    shipped!("slip-regularised", file = "slip/slip-regularised.0"),
    shipped!("slip-tuned", file = "slip/slip-tuned.0"),
    shipped!("tactip-frames", file = "angle/tactip-frames.0"),
];

static EVENT_NAMES: [&str; EVENTS.len()] = names(&EVENTS);
static FRAME_NAMES: [&str; FRAMES.len()] = names(&FRAMES);

const fn names<const N: usize>(shipped: &[Shipped; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut i = 0;
    while i < N {
        names[i] = shipped[i].name;
        i += 1;
    }
    names
}

/// The description of `name` in `list`, as `parse` reads it.
fn description<T>(
    list: &[Shipped],
    name: &str,
    parse: impl Fn(&str) -> Result<T, DescriptionError>,
) -> Option<T> {
    let shipped = list.iter().find(|shipped| shipped.name == name)?;
    Some(parse(shipped.description).expect("shipped descriptions are consistent"))
}

impl Description {
    /// The description of a network over events that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        description(&EVENTS, name, Self::parse)
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        &EVENT_NAMES
    }
}

impl FrameDescription {
    /// The description of a frame network that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        description(&FRAMES, name, Self::parse)
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        &FRAME_NAMES
    }
}

impl AnyDescription {
    /// The description of a network of either kind that comes with the crate.
    pub fn shipped(name: &str) -> Option<Self> {
        let frames = || FrameDescription::shipped(name).map(Self::Frames);
        Description::shipped(name).map(Self::Events).or_else(frames)
    }

    /// The text of the description file of a network that comes with the crate.
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        Shipped::find(name).map(|shipped| shipped.description)
    }

    /// Names that [`Self::shipped`] knows: networks over events, then frame networks.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        EVENT_NAMES.iter().chain(&FRAME_NAMES).copied()
    }
}

impl Shipped {
    fn find(name: &str) -> Option<&'static Self> {
        EVENTS.iter().chain(&FRAMES).find(|shipped| shipped.name == name)
    }
}

impl Weights {
    /// Weights of a network that comes with the crate. "digits-frozen" has those of "digits-past". Weights of frame networks
    /// that are not trained are drawn on the spot, with the same bits everywhere.
    ///
    /// # Panics
    /// Never: the tests read every file.
    pub fn shipped(name: &str) -> Option<Self> {
        match Shipped::find(name)?.weights {
            ShippedWeights::File(bytes) => {
                Some(Self::from_bytes(bytes).expect("shipped weights are readable"))
            }
            ShippedWeights::Drawn(seed) => {
                let description = AnyDescription::shipped(name)?;
                Some(draw(&description, seed).with_metadata(metadata(name, seed)))
            }
        }
    }
}

impl Card {
    /// The card of the weights of a network that comes with the crate. No weights are drawn.
    ///
    /// # Panics
    /// Never: the tests read every card.
    pub fn shipped(name: &str) -> Option<Self> {
        let weights = match Shipped::find(name)?.weights {
            ShippedWeights::Drawn(seed) => Weights::new([]).with_metadata(metadata(name, seed)),
            ShippedWeights::File(_) => Weights::shipped(name)?,
        };
        Some(weights.card().expect("shipped weights have a card"))
    }
}

/// The metadata of drawn weights.
fn metadata(name: &str, seed: u64) -> BTreeMap<String, String> {
    let entries = [
        ("about", format!("drawn, untrained, seed {seed}")),
        ("network", name.to_owned()),
        ("generator", DRAWN_BY.to_owned()),
    ];
    entries.map(|(key, value)| (key.to_owned(), value)).into()
}

/// The bytes of a safetensors file with weights that are [drawn](draw()) from `seed` and a card that says so. Equal
/// descriptions and seeds give equal bytes.
pub fn drawn_file(description: &impl Drawable, seed: u64) -> Vec<u8> {
    draw(description, seed).to_safetensors(&metadata(description.network_name(), seed))
}

#[cfg(test)]
mod tests {
    use crate::{AnyDescription, Card, Weights};

    #[test]
    fn every_name_has_a_description_of_this_name_weights_and_a_card() {
        for name in AnyDescription::shipped_names() {
            assert_eq!(AnyDescription::shipped(name).expect("a description").name(), name);
            assert_eq!(Weights::shipped(name).expect("weights").card().ok(), Card::shipped(name));
        }
    }
}
