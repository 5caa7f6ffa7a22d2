//! What can go wrong between a description, a weights file and a network.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use crate::DescriptionError;
use crate::weights::FormatError;

/// A description or weights could not be read, or do not fit together.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file is larger than any weights are.
    #[error("{}: expected at most {limit} bytes, found {found}", path.display())]
    Large {
        /// The file.
        path: PathBuf,
        /// Largest size.
        limit: u64,
        /// Its size.
        found: u64,
    },
    /// A description is inconsistent.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// Bytes are not a weights file that is understood.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Weights lack tensors of a network, or hold others in their place.
    #[error("weights do not fit network {network:?}: {problems}")]
    Weights {
        /// Name of the network.
        network: String,
        /// Every tensor that does not fit.
        problems: TensorProblems,
    },
    /// Weights hold all tensors of a network more than once.
    #[error(
        "weights fit network {network:?} under more than one prefix: expected one, found {}",
        prefixes.join(", ")
    )]
    Ambiguous {
        /// Name of the network.
        network: String,
        /// The prefixes.
        prefixes: Vec<String>,
    },
    /// Weights were trained on graphs or frames that were made in another way than the description says.
    #[error(
        "weights do not fit network {network:?}: expected metadata \"preparation\" {expected}, as its description says, \
         found {found}{}",
        published.map_or_else(String::new, |name| format!(
            ": these are the weights of the published GraphRes checkpoint, which network {name:?} computes, from scratch only"
        ))
    )]
    Preparation {
        /// Name of the network.
        network: String,
        /// The description's preparation.
        expected: String,
        /// That of the weights.
        found: String,
        /// The shipped network that computes what they were trained as, where they are those of the published checkpoint.
        published: Option<&'static str>,
    },
    /// Metadata of weights holds something other than its key is for.
    #[error("weights: expected metadata {key:?} with {expected}, found {found:?}")]
    Metadata {
        /// The key.
        key: &'static str,
        /// What it should hold.
        expected: &'static str,
        /// What it holds.
        found: String,
    },
    /// The engine refused the network.
    #[error(transparent)]
    Engine(#[from] meissner_engine::EngineError),
}

/// The tensors that do not fit, in the order of their use.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorProblems(pub Vec<TensorProblem>);

impl fmt::Display for TensorProblems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.0.iter().enumerate() {
            write!(f, "{}{problem}", if i > 0 { "\n" } else { "" })?;
        }
        Ok(())
    }
}

/// A tensor that does not fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("tensor {tensor:?}: {kind}")]
pub struct TensorProblem {
    /// Its name.
    pub tensor: String,
    /// What does not fit.
    pub kind: TensorProblemKind,
}

/// Why a tensor does not fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TensorProblemKind {
    /// It is not there.
    #[error("expected shape {expected:?}, found no such tensor")]
    Missing {
        /// The shape it should have.
        expected: Vec<usize>,
    },
    /// It has another shape.
    #[error("expected shape {expected:?}, found {found:?}")]
    Shape {
        /// The shape it should have.
        expected: Vec<usize>,
        /// The shape it has.
        found: Vec<usize>,
    },
    /// Its values are not floating-point numbers.
    #[error("expected floating-point values, found {found}")]
    Dtype {
        /// What they are.
        found: String,
    },
    /// A value is NaN or infinite (as f32).
    #[error("expected finite values, found {value} at index {index}")]
    NotFinite {
        /// Where, counted flat.
        index: usize,
        /// The value.
        value: f32,
    },
    /// A running variance is negative.
    #[error("expected variances of at least 0, found {value} at index {index}")]
    Variance {
        /// Where.
        index: usize,
        /// The value.
        value: f32,
    },
    /// Batch norm folded into a product and a sum leaves f32's range.
    #[error("expected a {what} within f32's range once folded, found {value} for channel {index}")]
    Folded {
        /// "scale" or "shift".
        what: &'static str,
        /// Which channel.
        index: usize,
        /// The folded value.
        value: f64,
    },
}
