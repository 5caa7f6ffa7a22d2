//! The errors of descriptions, weights files and networks, and reading of files up to a bound.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::{fmt, iter};

use thiserror::Error;

use crate::DescriptionError;
use crate::weights::FormatError;

/// A description or weights could not be read, or do not fit together.
#[derive(Debug, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum ModelError {
    /// A file could not be read.
    #[error("cannot read {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    /// A file is too large.
    #[error("{}: expected at most {limit} bytes, found {found}", path.display())]
    Large { path: PathBuf, limit: u64, found: u64 },
    /// A description is inconsistent.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// Bytes are not a weights file that can be read.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Weights lack tensors of a network, or have different tensors instead.
    #[error("weights do not fit network {network:?}: {}", lines(problems))]
    Weights { network: String, problems: Vec<TensorProblem> },
    /// The build left out the weights of a network that comes with the crate.
    #[error(
        "weights of network {network:?}: expected in the library, found left out of this build: the feature {network:?} \
         of meissner-models has them"
    )]
    LeftOut { network: &'static str },
    /// Weights hold all tensors of a network more than once.
    #[error(
        "weights fit network {network:?} under more than one prefix: expected one, found {}",
        prefixes.join(", ")
    )]
    Ambiguous { network: String, prefixes: Vec<String> },
    /// Two tensors of weights could be the same tensor of a network.
    #[error(
        "weights for network {network:?}: tensor {tensor:?}: expected one in the file, found {}",
        found.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
    )]
    Doubled { network: String, tensor: String, found: Vec<String> },
    /// A map of names cannot be read, or does not fit the weights or the network.
    #[error("map of names, {place}: expected {expected}, found {found}")]
    Map {
        /// The line, with its file.
        place: String,
        expected: String,
        found: String,
    },
    /// Weights were trained on graphs or frames of another preparation than the description's.
    #[error(
        "weights do not fit network {network:?}: expected metadata \"preparation\" {expected}, as its description says, \
         found {found}{}",
        published.map_or_else(String::new, |name| format!(
            ": these are the weights of the published GraphRes checkpoint, which network {name:?} computes, from scratch only"
        ))
    )]
    Preparation {
        network: String,
        expected: String,
        found: String,
        /// The shipped network that fits them, for the weights of the published checkpoint.
        published: Option<&'static str>,
    },
    /// Metadata of weights has an invalid value.
    #[error("weights: expected metadata {key:?} with {expected}, found {found:?}")]
    Metadata { key: &'static str, expected: &'static str, found: String },
    /// The engine refused the network.
    #[error(transparent)]
    Engine(#[from] meissner_engine::EngineError),
}

/// Number of missing tensors that a message names.
const MAX_MISSING: usize = 8;

/// The problems, one per line; the first few missing tensors, and the number of further ones.
fn lines(problems: &[TensorProblem]) -> String {
    let mut missing = 0;
    let shown = problems.iter().filter(|problem| {
        missing += usize::from(problem.is_missing());
        !problem.is_missing() || missing <= MAX_MISSING
    });
    let mut lines: Vec<String> = shown.map(ToString::to_string).collect();
    if missing > MAX_MISSING {
        lines.push(format!("and {} tensors more that are missing", missing - MAX_MISSING));
    }
    lines.join("\n")
}

/// Longest line of a message, in bytes.
const LINE_BYTES: usize = 1000;
/// Maximum number of lines of a message.
const LINES: usize = 100;

/// The message `text`, shortened if very long: each line's beginning and end, and the first 100
/// lines. Names can have any length.
///
/// ```
/// use meissner_models::in_part;
///
/// assert_eq!(in_part("network a: found no such file"), "network a: found no such file");
/// let name = "a".repeat(1 << 20);
/// let long = in_part(&format!("network {name}: found no such file")).into_owned();
/// assert!(long.len() < 1100);
/// assert!(long.starts_with("network aaa") && long.ends_with("aaa: found no such file"));
/// ```
pub fn in_part(text: &str) -> Cow<'_, str> {
    if text.len() <= LINE_BYTES {
        return text.into();
    }
    let mut lines: Vec<Cow<'_, str>> = text.lines().take(LINES).map(line_in_part).collect();
    match text.lines().count() - lines.len() {
        0 => {}
        more => lines.push(format!("and {more} lines more").into()),
    }
    lines.join("\n").into()
}

fn line_in_part(line: &str) -> Cow<'_, str> {
    if line.len() <= LINE_BYTES {
        return line.into();
    }
    let (head, tail) =
        (line.floor_char_boundary(LINE_BYTES / 2), line.ceil_char_boundary(line.len() - LINE_BYTES / 2));
    format!("{} .. {} bytes .. {}", &line[..head], tail - head, &line[tail..]).into()
}

/// A tensor that does not fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "tensor {tensor:?}{}: {kind}",
    in_file.as_ref().map_or_else(String::new, |name| format!(" (in the file {name:?})"))
)]
pub struct TensorProblem {
    /// Its name in the network.
    pub tensor: String,
    /// Its name in the file, if it is different.
    pub in_file: Option<String>,
    /// The part that does not fit.
    pub kind: TensorProblemKind,
}

impl TensorProblem {
    /// Whether the weights have no such tensor.
    pub fn is_missing(&self) -> bool {
        matches!(self.kind, TensorProblemKind::Missing { .. })
    }
}

/// Tensors of a file that no layer reads and that resemble a missing one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lookalikes {
    /// Names of the first few.
    pub names: Vec<String>,
    /// Their number.
    pub count: usize,
}

impl Lookalikes {
    /// Maximum number of kept names.
    const MAX: usize = 4;

    pub(crate) fn of<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let mut all = Self::default();
        for name in names {
            if all.count < Self::MAX {
                all.names.push(name.to_owned());
            }
            all.count += 1;
        }
        all
    }
}

impl fmt::Display for Lookalikes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, separator) in self.names.iter().zip(iter::once("").chain(iter::repeat(", "))) {
            write!(f, "{separator}{name:?}")?;
        }
        match self.count - self.names.len() {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

/// The candidates for a missing tensor, at the end of the message.
fn could_be(same: &Lookalikes, transposed: &Lookalikes) -> String {
    let named = [("of this shape", same), ("of this shape transposed", transposed)];
    let named = named.into_iter().filter(|(_, lookalikes)| lookalikes.count > 0);
    let named: Vec<String> =
        named.map(|(which, lookalikes)| format!("; left over {which}: {lookalikes}")).collect();
    named.concat()
}

/// The reason why a tensor does not fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum TensorProblemKind {
    /// It is missing.
    #[error("expected shape {expected:?}, found no such tensor{}", could_be(same, transposed))]
    Missing {
        expected: Vec<usize>,
        /// Tensors of its shape that no layer reads.
        same: Lookalikes,
        /// Tensors of the same sizes in another order.
        transposed: Lookalikes,
    },
    /// It has another shape.
    #[error("expected shape {expected:?}, found {found:?}")]
    Shape { expected: Vec<usize>, found: Vec<usize> },
    /// Its values are not floating-point numbers.
    #[error("expected floating-point values, found {found}")]
    Dtype { found: String },
    /// A value is NaN or infinite (as f32).
    #[error("expected finite values, found {value} at index {index}")]
    NotFinite {
        /// Its index in row-major order.
        index: usize,
        value: f32,
    },
    /// A running variance is negative.
    #[error("expected variances of at least 0, found {value} at index {index}")]
    Variance { index: usize, value: f32 },
    /// Batch norm, folded into a product and a sum, is out of f32's range.
    #[error("expected a {what} within f32's range once folded, found {value} for channel {index}")]
    Folded {
        /// "scale" or "shift".
        what: &'static str,
        index: usize,
        value: f64,
    },
}

/// The bytes of the file at `path`. Reads at most one byte beyond `limit`, also from a device or
/// pipe.
pub(crate) fn read(path: &Path, limit: u64) -> Result<Vec<u8>, ModelError> {
    let unreadable = |source| ModelError::Read { path: path.to_owned(), source };
    let large = |found| ModelError::Large { path: path.to_owned(), limit, found };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    if length > limit {
        return Err(large(length));
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit { Err(large(limit + 1)) } else { Ok(bytes) }
}
