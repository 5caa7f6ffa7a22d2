//! Small descriptions for tests: the part that a test checks, and defaults. The file uses no crate,
//! so that tests of every crate can include it.

use std::fmt::Write;

/// A description of a network in TOML. Keys are lines of their table, or separated by "; ".
#[derive(Clone, Debug)]
pub(crate) struct NetworkText {
    network: String,
    /// `[graph]` or `[input]`.
    source: String,
    layers: String,
}

fn table(name: &str, keys: &str) -> String {
    format!("[{name}]\n{}\n", keys.replace("; ", "\n"))
}

impl NetworkText {
    /// A network over events, with in-edges from the two nearest of all.
    pub(crate) fn over_events(name: &str) -> Self {
        Self::new(name, String::new()).graph("kind = \"knn\"; k = 2; candidates = \"all\"; scale = 0.5")
    }

    /// A network over frames, which the keys of `[input]` describe.
    pub(crate) fn over_frames(name: &str, input: &str) -> Self {
        Self::new(name, table("input", input))
    }

    fn new(name: &str, source: String) -> Self {
        Self { network: format!("name = \"{name}\""), source, layers: String::new() }
    }

    /// The same with further keys of `[network]`.
    #[must_use]
    pub(crate) fn network(mut self, keys: &str) -> Self {
        write!(self.network, "; {keys}").expect("a string");
        self
    }

    /// The same with these keys of `[graph]` instead.
    #[must_use]
    pub(crate) fn graph(mut self, keys: &str) -> Self {
        self.source = table("graph", keys);
        self
    }

    /// The same with a further layer.
    #[must_use]
    pub(crate) fn layer(mut self, name: &str, kind: &str, keys: &str) -> Self {
        self.layers += &table("[layer]", &format!("name = \"{name}\"; kind = \"{kind}\"; {keys}"));
        self
    }

    /// A network with a readout `grid` and a dense layer `fc` that predicts these names.
    pub(crate) fn readout(self, keys: &str, names: &[&str], unit: &str) -> String {
        self.layer("grid", "readout", keys).dense(names, unit)
    }

    /// A network that ends with a dense layer `fc` that predicts these names.
    pub(crate) fn dense(self, names: &[&str], unit: &str) -> String {
        self.layer("fc", "dense", &format!("outputs = {}", names.len())).predicting(names, unit)
    }

    /// The text of a network whose last layer predicts values of these names.
    pub(crate) fn predicting(self, names: &[&str], unit: &str) -> String {
        let output = table("output", &format!("names = {names:?}; unit = \"{unit}\""));
        [table("network", &self.network), self.source, self.layers, output].join("\n")
    }
}
