//! Networks over events by name, as a session switches between them.

use std::sync::Arc;

use meissner_engine::{Network, Normalisation};
use meissner_models::{Description, Weights};

use crate::error::ViewError;

/// A network, and what its outputs are.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The network.
    pub network: Arc<Network>,
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// The unit of each output.
    pub units: Vec<String>,
    /// Whether the outputs are logits of classes.
    pub classes: bool,
}

impl Chosen {
    /// `network` with the outputs of its `description`.
    pub fn new(network: impl Into<Arc<Network>>, description: &Description) -> Self {
        let (outputs, units) = description.outputs();
        Self {
            network: network.into(),
            outputs: outputs.to_vec(),
            units: units.to_vec(),
            classes: description.classes().is_some(),
        }
    }
}

/// The networks that a page may choose.
pub trait Networks {
    /// Their names.
    fn names(&self) -> Vec<String>;

    /// The network of this name.
    ///
    /// # Errors
    /// There is none, or its weights do not fit.
    fn load(&self, name: &str) -> Result<Chosen, ViewError>;
}

/// The networks over events that come with the program and can run incrementally.
#[derive(Clone, Copy, Debug)]
pub struct Shipped;

impl Networks for Shipped {
    fn names(&self) -> Vec<String> {
        let runs = |name: &&&str| {
            let known = Description::shipped(name).filter(|_| Weights::left_out(name).is_none());
            known.is_some_and(|of| of.normalisation() == Normalisation::Fixed)
        };
        Description::shipped_names().iter().filter(runs).map(|&name| name.to_owned()).collect()
    }

    fn load(&self, name: &str) -> Result<Chosen, ViewError> {
        let unknown = || ViewError::Network { name: name.to_owned(), known: self.names().join(", ") };
        let description = Description::shipped(name).ok_or_else(unknown)?;
        let weights = Weights::shipped(name).ok_or_else(unknown)?;
        let network = description.network(&weights);
        let network = network.map_err(|source| ViewError::Weights { name: name.to_owned(), source })?;
        Ok(Chosen::new(network, &description))
    }
}

/// The shipped networks, and one of a caller's own, which may have the name of a shipped one.
#[derive(Clone, Debug)]
pub struct Own {
    /// Its name.
    pub name: String,
    /// The network.
    pub chosen: Chosen,
}

impl Networks for Own {
    fn names(&self) -> Vec<String> {
        let mut names = Shipped.names();
        if !names.contains(&self.name) {
            names.insert(0, self.name.clone());
        }
        names
    }

    fn load(&self, name: &str) -> Result<Chosen, ViewError> {
        if name == self.name { Ok(self.chosen.clone()) } else { Shipped.load(name) }
    }
}
