//! Networks over events by name, as a session switches between them.

use std::sync::Arc;

use meissner_engine::{Network, Normalisation};
use meissner_models::{Description, Weights};

use crate::error::ViewError;

/// A network, by default one over events, and the meaning of its outputs.
#[derive(Debug)]
pub struct Chosen<N = Network> {
    /// The network.
    pub network: Arc<N>,
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// The unit of each output.
    pub units: Vec<String>,
    /// Whether the outputs are logits of classes.
    pub classes: bool,
}

impl<N> Clone for Chosen<N> {
    fn clone(&self) -> Self {
        let Self { network, outputs, units, classes } = self;
        Self {
            network: Arc::clone(network),
            outputs: outputs.clone(),
            units: units.clone(),
            classes: *classes,
        }
    }
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
pub trait Networks<N = Network> {
    /// Their names.
    fn names(&self) -> Vec<String>;

    /// The network of this name.
    ///
    /// # Errors
    /// There is no such network, or its weights do not fit.
    fn load(&self, name: &str) -> Result<Chosen<N>, ViewError>;
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

/// Other networks, and one of the caller, which may have the same name as one of them.
#[derive(Debug)]
pub struct Own<N = Network, O = Shipped> {
    /// Its name.
    pub name: String,
    /// The network.
    pub chosen: Chosen<N>,
    /// The others.
    pub others: O,
}

impl<N, O: Networks<N>> Networks<N> for Own<N, O> {
    fn names(&self) -> Vec<String> {
        let mut names = self.others.names();
        if !names.contains(&self.name) {
            names.insert(0, self.name.clone());
        }
        names
    }

    fn load(&self, name: &str) -> Result<Chosen<N>, ViewError> {
        if name == self.name { Ok(self.chosen.clone()) } else { self.others.load(name) }
    }
}
