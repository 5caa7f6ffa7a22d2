//! What can be inconsistent in a description file, each with the line it stands on.

use std::fmt;

use thiserror::Error;

/// One inconsistency of a description file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// The layer it concerns, if any.
    pub layer: Option<String>,
    /// What is inconsistent.
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

/// What is inconsistent.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ProblemKind {
    /// The text is not TOML.
    #[error("not TOML: {0}")]
    Syntax(String),
    /// A key that nothing reads.
    #[error("unknown key {key:?}: expected one of {expected}")]
    UnknownKey {
        /// The key.
        key: String,
        /// The keys of this table.
        expected: String,
    },
    /// A key without which the table says too little.
    #[error("missing key {key:?}: expected {expected}")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// What it should hold.
        expected: String,
    },
    /// A key that only has a meaning beside other values.
    #[error("{key}: expected only with {with}")]
    Inapplicable {
        /// The key.
        key: &'static str,
        /// What it needs.
        with: &'static str,
    },
    /// A value of another type or out of range.
    #[error("{key}: expected {expected}, found {found}")]
    Value {
        /// The key.
        key: &'static str,
        /// What it should hold.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// Two layers of one name.
    #[error("name: expected another name than that of the layer on line {first}")]
    DuplicateName {
        /// Line of the first layer of this name.
        first: usize,
    },
    /// A reference to a layer that the file does not have.
    #[error("{key}: expected {input:?} or the name of a layer {place}, found {found:?}")]
    UnknownReference {
        /// The key that refers.
        key: &'static str,
        /// Name of the network's input; of a head's, the readout's name.
        input: String,
        /// Which layers can be referred to.
        place: &'static str,
        /// The name it refers to.
        found: String,
    },
    /// A reference to a layer that stands further down, in a file whose layers stand in the order of evaluation.
    #[error("{key}: expected a layer above this one, found {found:?} on line {line}")]
    ForwardReference {
        /// The key that refers.
        key: &'static str,
        /// The name it refers to.
        found: String,
        /// Line of that layer.
        line: usize,
    },
    /// A reference to a layer of a kind that cannot be read here.
    #[error("{key}: expected {expected}, found {found}")]
    ReferenceKind {
        /// The key that refers.
        key: &'static str,
        /// Kinds that can be read here.
        expected: &'static str,
        /// What is referred to.
        found: String,
    },
    /// A skip that comes from another level.
    #[error("skip: expected a layer over {expected}, found {reference:?} over {found}")]
    Level {
        /// The layer referred to.
        reference: String,
        /// The layer's own level.
        expected: String,
        /// Level of the layer referred to.
        found: String,
    },
    /// A skip with another number of channels.
    #[error("skip {reference:?}: expected {expected} channels, found {found}")]
    Channels {
        /// The layer referred to.
        reference: String,
        /// Channels of the layer.
        expected: usize,
        /// Channels of the layer referred to.
        found: usize,
    },
    /// Images that are joined and have other sizes.
    #[error("with {reference:?}: expected an image of {expected} pixels, found one of {found}")]
    Size {
        /// The layer referred to.
        reference: String,
        /// Rows x columns of the layer's first input.
        expected: String,
        /// Rows x columns of the layer referred to.
        found: String,
    },
    /// A layer whose output would have no pixels, or more values than networks are for.
    #[error("expected {expected}, found {found}")]
    Extent {
        /// What the output should be.
        expected: String,
        /// What it would be.
        found: String,
    },
    /// A description of the other kind of network.
    #[error("expected {expected}, found {found}")]
    Family {
        /// The kind that was asked for.
        expected: &'static str,
        /// The kind that the file describes.
        found: &'static str,
    },
    /// Layers that read each other in a circle.
    #[error("expected an acyclic graph, found the cycle {0}")]
    Cycle(String),
    /// A layer that the prediction does not depend on.
    #[error("expected every layer to reach the prediction, found none that reads this one on the way to it")]
    Unused,
    /// A dense layer in a file that has a head.
    #[error("expected no dense layer beside the [[head]] that starts on line {head}, found one")]
    BesideHead {
        /// Line of the head's first layer.
        head: usize,
    },
    /// A kind of layer that every network needs.
    #[error("expected {expected} layer, found none")]
    MissingLayer {
        /// Which kind.
        expected: &'static str,
    },
    /// A second layer of a kind that there is one of.
    #[error("expected one readout, found another on line {first}")]
    SecondReadout {
        /// Line of the first.
        first: usize,
    },
    /// More than one dense layer that no other reads.
    #[error(
        "expected one dense layer that no other reads (the prediction), found this one and that of line {first}"
    )]
    SecondPrediction {
        /// Line of the first.
        first: usize,
    },
    /// The prediction has another number of values than `[output]` has names.
    #[error("names: expected {expected} (outputs of layer {layer:?}), found {found}")]
    OutputNames {
        /// Layer that predicts.
        layer: String,
        /// Its outputs.
        expected: usize,
        /// Names given.
        found: usize,
    },
    /// Two layers that would read one tensor.
    #[error("weights: expected tensors of its own, found {tensor:?} also read by layer {other:?}")]
    SharedTensor {
        /// The tensor's name.
        tensor: String,
        /// The layer that reads it too.
        other: String,
    },
}

/// Everything that is inconsistent in a description file, by line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescriptionError {
    problems: Vec<Problem>,
}

impl DescriptionError {
    /// Sorts `problems` by line; there must be one.
    pub(super) fn new(mut problems: Vec<Problem>) -> Self {
        debug_assert!(!problems.is_empty(), "an error needs a problem");
        problems.sort_by_key(|p| p.line);
        Self { problems }
    }

    /// What is inconsistent, by line.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }
}

impl fmt::Display for DescriptionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            problem.fmt(f)?;
        }
        Ok(())
    }
}

impl std::error::Error for DescriptionError {}

/// Collects problems while reading goes on.
#[derive(Debug, Default)]
pub(super) struct Problems(pub(super) Vec<Problem>);

impl Problems {
    pub(super) fn add(&mut self, line: usize, layer: Option<&str>, kind: ProblemKind) {
        self.0.push(Problem { line, layer: layer.map(str::to_owned), kind });
    }
}
