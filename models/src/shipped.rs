//! The descriptions and weights that come with the crate, by name.

use std::collections::BTreeMap;

use crate::{Description, Weights, draw};

/// A description with the weights that it runs with.
struct Shipped {
    name: &'static str,
    description: &'static str,
    weights: &'static [u8],
}

const SHIPPED: &[Shipped] = &[
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

const NAMES: &[&str] =
    &["graphres", "graphres-published", "tactigraph", "tactigraph-frozen", "tactigraph-past"];

/// Weights files that are drawn, with their seeds.
pub const DRAWN: &[(&str, u64)] = &[("graphres", 1), ("tactigraph", 2), ("tactigraph-past", 3)];

fn find(name: &str) -> Option<&'static Shipped> {
    SHIPPED.iter().find(|shipped| shipped.name == name)
}

impl Description {
    /// The description of a network that comes with the crate.
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

impl Weights {
    /// Weights of a network that comes with the crate. "graphres-published" has those of "graphres",
    /// "tactigraph-frozen" those of "tactigraph".
    ///
    /// # Panics
    /// Never: the tests read every one.
    pub fn shipped(name: &str) -> Option<Self> {
        find(name).map(|shipped| Self::from_bytes(shipped.weights).expect("shipped weights are readable"))
    }
}

/// The bytes of a drawn weights file, with a remark that says so; `None` for a name that is not in [`DRAWN`].
pub fn drawn_file(name: &str) -> Option<Vec<u8>> {
    let &(name, seed) = DRAWN.iter().find(|(drawn, _)| *drawn == name)?;
    let description = find(name).and_then(|shipped| Description::parse(shipped.description).ok())?;
    let remarks = [
        ("about", format!("drawn, untrained, seed {seed}")),
        ("network", name.to_owned()),
        ("generator", "meissner_models::draw".to_owned()),
    ];
    let metadata: BTreeMap<String, String> = remarks.map(|(key, value)| (key.to_owned(), value)).into();
    Some(draw(&description, seed).to_safetensors(&metadata))
}

#[cfg(test)]
mod tests {
    use super::{NAMES, SHIPPED};

    #[test]
    fn the_names_are_those_of_what_is_shipped() {
        assert!(SHIPPED.iter().map(|shipped| shipped.name).eq(NAMES.iter().copied()));
    }
}
