//! Errors of the reference.

use meissner_engine::EngineError;
use thiserror::Error;

/// A network cannot be evaluated here.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// Scales and grid origin are recomputed from each graph.
    #[error("network {0:?}: expected fixed scales, found ones that are normalised over each graph")]
    PerGraph(String),
    /// The head's parameters are missing, or do not belong to the network.
    #[error("network {network:?}: parameters of a head: expected {expected}, found {found}")]
    Head {
        /// Name of the network.
        network: String,
        /// Whether it has a head.
        expected: &'static str,
        /// Whether parameters were given.
        found: &'static str,
    },
    /// A frame network's parts do not fit together.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
