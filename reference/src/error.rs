//! What the reference has no form of.

use meissner_engine::EngineError;
use thiserror::Error;

/// A network cannot be evaluated here.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// Scales and grid origin are recomputed from each graph.
    #[error("network {0:?}: expected fixed scales, found ones that are normalised over each graph")]
    PerGraph(String),
    /// A head's parameters are not those of the network, or are missing.
    #[error("network {network:?}: parameters of a head: expected {expected}, found {found}")]
    Head {
        /// Name of the network.
        network: String,
        /// Whether it has a head.
        expected: &'static str,
        /// Whether parameters came.
        found: &'static str,
    },
    /// A frame network's parts do not fit together.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
