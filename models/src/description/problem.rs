//! The inconsistencies of a description file, each with its line.

use std::fmt;

use thiserror::Error;

/// One inconsistency of a description file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// The layer it concerns, if any.
    pub layer: Option<String>,
    /// The inconsistency.
    pub kind: ProblemKind,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: ", self.line)?;
        if let Some(layer) = &self.layer {
            write!(f, "layer {layer:?}: ")?;
        }
        self.kind.fmt(f)
    }
}

/// Kinds of inconsistencies. `expected` and `found` describe values; `key` has or should have the
/// value; `first`, `line` and `head` are lines.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the page of the enum and the messages explain the fields")]
#[non_exhaustive]
pub enum ProblemKind {
    /// The text is not TOML.
    #[error("not TOML: {0}")]
    Syntax(String),
    /// An unknown key.
    #[error("unknown key {key:?}: expected one of {expected}")]
    UnknownKey { key: String, expected: String },
    /// A required key is missing.
    #[error("missing key {key:?}: expected {expected}")]
    MissingKey { key: &'static str, expected: String },
    /// A key that is valid only with other values.
    #[error("{key}: expected only with {with}")]
    Inapplicable { key: &'static str, with: &'static str },
    /// A value of another type or out of range, or a reference to a layer that cannot be read here.
    #[error("{key}: expected {expected}, found {found}")]
    Value { key: &'static str, expected: String, found: String },
    /// Two layers of one name.
    #[error("name: expected another name than that of the layer on line {first}")]
    DuplicateName { first: usize },
    /// A reference to a layer that the file does not have.
    #[error("{key}: expected {input:?} or the name of a layer {place}, found {found:?}")]
    UnknownReference { key: &'static str, input: String, place: &'static str, found: String },
    /// A reference to a layer further down, in a file with layers in the order of evaluation.
    #[error("{key}: expected a layer above this one, found {found:?} on line {line}")]
    ForwardReference { key: &'static str, found: String, line: usize },
    /// A reference to a layer with another number of channels or another size.
    #[error("{key} {reference:?}: expected {expected}, found {found}")]
    Size { key: &'static str, reference: String, expected: String, found: String },
    /// A layer whose output would have no pixels, or more values than allowed.
    #[error("expected {expected}, found {found}")]
    Extent { expected: String, found: String },
    /// A description of the other kind of network.
    #[error("expected {expected}, found {found}")]
    Family { expected: &'static str, found: &'static str },
    /// Layers that read each other in a cycle.
    #[error("expected an acyclic graph, found the cycle {0}")]
    Cycle(String),
    /// A layer on which the prediction does not depend.
    #[error("expected every layer to reach the prediction, found none that reads this one on the way to it")]
    Unused,
    /// A dense layer in a file that has a head.
    #[error("expected no dense layer beside the [[head]] that starts on line {head}, found one")]
    BesideHead { head: usize },
    /// A missing kind of layer that every network needs.
    #[error("expected {expected} layer, found none")]
    MissingLayer { expected: &'static str },
    /// A second readout.
    #[error("expected one readout, found another on line {first}")]
    SecondReadout { first: usize },
    /// More than one dense layer that no other layer reads.
    #[error(
        "expected one dense layer that no other reads (the prediction), found this one and that of line {first}"
    )]
    SecondPrediction { first: usize },
    /// The prediction has another number of values than `[output]` has names.
    #[error("names: expected {expected} (outputs of layer {layer:?}), found {found}")]
    OutputNames { layer: String, expected: usize, found: usize },
    /// Two layers that would read one tensor.
    #[error("weights: expected tensors of its own, found {tensor:?} also read by layer {other:?}")]
    SharedTensor { tensor: String, other: String },
}

impl ProblemKind {
    /// The value `found` of `key` is not as expected.
    pub(super) fn value(key: &'static str, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Value { key, expected: expected.into(), found: found.into() }
    }
}

/// Number of preceding inconsistencies with which one is compared.
const FAULTS: usize = 32;
/// Maximum number of inconsistencies of a message.
const TOLD: usize = 50;

/// All inconsistencies of a description file, by line. The message contains the first 50.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescriptionError {
    problems: Vec<Problem>,
}

impl DescriptionError {
    /// Sorts `problems` by line; there must be at least one.
    pub(super) fn new(mut problems: Vec<Problem>) -> Self {
        debug_assert!(!problems.is_empty(), "an error needs a problem");
        problems.sort_by_key(|p| p.line);
        // A file that is not text can repeat one fault at every byte.
        let mut told: Vec<Problem> = Vec::new();
        let mut first_of_line = 0;
        for problem in problems {
            if told.last().is_some_and(|last| last.line != problem.line) {
                first_of_line = told.len();
            }
            let near = told.len().saturating_sub(FAULTS).max(first_of_line);
            if !told[near..].contains(&problem) {
                told.push(problem);
            }
        }
        Self { problems: told }
    }

    /// The inconsistencies by line, without repetitions in a line.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }
}

impl fmt::Display for DescriptionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().take(TOLD).enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            problem.fmt(f)?;
        }
        match self.problems.len().saturating_sub(TOLD) {
            0 => Ok(()),
            more => write!(f, "\nand {more} problems more"),
        }
    }
}

impl std::error::Error for DescriptionError {}

/// Collects problems while reading continues.
#[derive(Debug, Default)]
pub(super) struct Problems(pub(super) Vec<Problem>);

impl Problems {
    pub(super) fn add(&mut self, line: usize, layer: Option<&str>, kind: ProblemKind) {
        self.0.push(Problem { line, layer: layer.map(str::to_owned), kind });
    }
}
