//! A checked layer: its computation, shapes, tensors, cost and receptive field.

use std::fmt;

use meissner_engine::{Aggregation, Fraction, Normalisation, Position};
use meissner_kernels::Activation;
use serde::{Serialize, Serializer};

use super::convolution::ConvolutionKind;
use super::tensors::{Listing, Needed};

/// A layer of a checked description.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Layer {
    /// Name, unique in the description.
    pub name: String,
    /// Line of the file, counted from 1.
    pub line: usize,
    /// Its computation.
    #[serde(flatten)]
    pub kind: LayerKind,
    /// Its input: the name of a layer or "events".
    pub from: String,
    /// Level whose rows it writes, 0 for the events; `None` for the readout and the dense layers.
    pub level: Option<usize>,
    /// Number of values that it reads: channels of a row; for a dense layer all values of the layer
    /// before it.
    pub inputs: usize,
    /// Number of values that it writes: channels of a row; for a readout cells times channels.
    pub outputs: usize,
    /// Number of trained parameters: weights, biases, the two of batch norm, without the running
    /// statistics.
    pub parameters: usize,
    /// Cost of a row or of a prediction.
    pub cost: Cost,
    /// The rows that a row depends on.
    pub field: ReceptiveField,
    /// Prefix of its tensors' names.
    #[serde(skip)]
    pub(crate) weights: String,
    /// Feature of its level (for a pooling: of the level below) that it reads.
    #[serde(skip)]
    pub(crate) reads: usize,
    /// Feature of its level that it adds.
    #[serde(skip)]
    pub(crate) adds: Option<usize>,
}

const DENSE: &str = "dense layer: (output, input); of a readout the inputs are cell after cell, row by row, each with its \
                     channels";

/// The computation of a layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum LayerKind {
    /// Maximum over the cells of a grid; starts a level.
    Pool {
        /// The cells.
        #[serde(flatten)]
        cell: Cell,
        /// Position of a cell.
        #[serde(serialize_with = "serialize_position")]
        position: Position,
        /// Scale of the edge attributes of the level that starts here.
        scale: f32,
    },
    /// Maximum or sum over a grid of the image, cell after cell.
    Readout {
        /// Cells along x.
        columns: usize,
        /// Cells along y.
        rows: usize,
        /// Rule that combines the rows of a cell into one.
        #[serde(serialize_with = "serialize_aggregation")]
        aggregation: Aggregation,
        /// Number of grids: 1, or one for each cell in time that a window can fill.
        times: usize,
    },
    /// Dense layer.
    Dense {
        /// Whether there is a bias.
        bias: bool,
        /// Activation after the sum.
        #[serde(serialize_with = "serialize_activation")]
        activation: Activation,
    },
    /// Graph convolution with its activation, batch norm and skip addition. Serialised data have
    /// its convolution as the kind.
    #[serde(untagged)]
    Block {
        /// The convolution.
        #[serde(flatten)]
        conv: ConvolutionKind,
        /// Layer (or "events") that is added to the result.
        skip: Option<String>,
        /// Whether there is batch norm.
        norm: bool,
    },
}

impl LayerKind {
    /// Its word in a file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Block { conv, .. } => conv.word(),
            Self::Pool { .. } => "pool",
            Self::Readout { .. } => "readout",
            Self::Dense { .. } => "dense",
        }
    }
}

impl fmt::Display for LayerKind {
    /// Its word with its options, in short.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        match self {
            Self::Block { conv, norm, .. } => f.write_str(&conv.options(*norm)),
            Self::Pool { cell, .. } => write!(f, " {cell}"),
            Self::Readout { columns, rows, times, aggregation } => {
                if *aggregation == Aggregation::Sum {
                    f.write_str(" sum")?;
                }
                write!(f, " {columns}x{rows}")?;
                if *times == 1 { Ok(()) } else { write!(f, "x{times}") }
            }
            Self::Dense { activation, .. } => write!(f, " {}", activation_word(*activation)),
        }
    }
}

/// Size of a pooling's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Cell {
    /// Along x and y, as fractions of the sensor.
    #[serde(serialize_with = "fractions")]
    pub cell: [Fraction; 2],
    /// Along t, as a fraction of the span; `None` pools over all times.
    #[serde(serialize_with = "fraction")]
    pub time: Option<Fraction>,
}

impl Cell {
    /// Number of cells that touch a cell: the in-edges that a cost assumes.
    pub fn grid_neighbours(&self) -> usize {
        if self.time.is_some() { 26 } else { 8 }
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {}", self.cell[0], self.cell[1])?;
        self.time.map_or(Ok(()), |time| write!(f, " x {time}"))
    }
}

/// Multiply-adds of one evaluation of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// Number of multiply-adds; 0 for a pooling and the readout, which only compare.
    pub multiply_adds: usize,
    /// Counted in-edges: at the event level the maximum of the graph; at a pooled level the
    /// touching cells (8, or 26 with cells in time). This is an assumption: edges may reach
    /// further.
    pub in_edges: Option<usize>,
    /// The unit of the cost.
    pub per: CostUnit,
}

/// The unit of a [`Cost`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CostUnit {
    /// A row: an event, or a cell.
    Row,
    /// A prediction.
    Prediction,
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.multiply_adds)?;
        match (self.per, self.in_edges) {
            (CostUnit::Row, Some(edges)) => write!(f, " at {edges} in-edges"),
            (CostUnit::Row, None) => Ok(()),
            (CostUnit::Prediction, _) => write!(f, " a prediction"),
        }
    }
}

/// The rows whose inputs can reach a row, level by level from its own level down to the events.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReceptiveField {
    /// From the row's own level down to the event level.
    pub steps: Vec<FieldStep>,
    /// Start of the rows of the first step.
    pub from: FieldStart,
}

/// Start of a receptive field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldStart {
    /// One row.
    Row,
    /// All rows in a cell of the readout's grid, a share of 1 / columns by 1 / rows of the image.
    ReadoutCell {
        /// Cells along x.
        columns: usize,
        /// Cells along y.
        rows: usize,
    },
    /// All rows of the window.
    Window,
}

/// Part of a receptive field on one level.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FieldStep {
    /// Maximum number of steps along in-edges to its rows.
    pub hops: usize,
    /// The cells of these rows, each of which reads all its members; `None` at the event level.
    #[serde(flatten)]
    pub cell: Option<Cell>,
}

impl fmt::Display for ReceptiveField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.from {
            FieldStart::Row => {}
            FieldStart::ReadoutCell { columns, rows } => write!(f, "1/{columns} x 1/{rows} of the image, ")?,
            FieldStart::Window => return write!(f, "the window"),
        }
        for (i, step) in self.steps.iter().enumerate() {
            let rows = step.cell.map_or_else(|| "event".to_owned(), |cell| format!("{cell} cell"));
            f.write_str(if i > 0 { ", " } else { "" })?;
            match step.hops {
                0 if self.from == FieldStart::Row && i == 0 => write!(f, "one {rows}")?,
                0 => write!(f, "its {rows}s")?,
                1 => write!(f, "1 hop of {rows}s")?,
                hops => write!(f, "{hops} hops of {rows}s")?,
            }
        }
        Ok(())
    }
}

impl Layer {
    pub(crate) fn tensor(&self, part: &str) -> String {
        format!("{}.{part}", self.weights)
    }

    /// The convolution of a block; `None` for another layer.
    pub fn convolution(&self) -> Option<&ConvolutionKind> {
        if let LayerKind::Block { conv, .. } = &self.kind { Some(conv) } else { None }
    }

    /// The tensors it needs, in the order of their use.
    pub(crate) fn tensors(&self) -> Vec<Needed> {
        let (c, o) = (self.inputs, self.outputs);
        let mut tensors = Listing::new(&self.weights);
        match self.kind {
            LayerKind::Block { ref conv, norm, .. } => {
                let variance = conv.list(&mut tensors, c, o);
                if norm {
                    tensors.norm(&self.tensor("norm"), o, variance);
                }
            }
            LayerKind::Dense { bias, .. } => {
                tensors.weight("weight", &[o, c], c, DENSE);
                if bias {
                    tensors.shift("bias", &[o], "bias: (output)");
                }
            }
            LayerKind::Pool { .. } | LayerKind::Readout { .. } => {}
        }
        tensors.needed()
    }
}

fn fractions<S: Serializer>(cell: &[Fraction; 2], s: S) -> Result<S::Ok, S::Error> {
    s.collect_seq(cell.iter().map(Fraction::to_string))
}

#[expect(clippy::ref_option, reason = "serde calls it with a reference to the field")]
fn fraction<S: Serializer>(time: &Option<Fraction>, s: S) -> Result<S::Ok, S::Error> {
    time.map(|t| t.to_string()).serialize(s)
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference to the field")]
fn serialize_aggregation<S: Serializer>(aggregation: &Aggregation, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(match aggregation {
        Aggregation::Max => "max",
        Aggregation::Sum => "sum",
    })
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference to the field")]
fn serialize_position<S: Serializer>(position: &Position, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(match position {
        Position::Mean => "mean",
        Position::Centre => "centre",
    })
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference to the field")]
pub(super) fn serialize_normalisation<S: Serializer>(
    normalisation: &Normalisation,
    s: S,
) -> Result<S::Ok, S::Error> {
    s.serialize_str(normalisation_word(*normalisation))
}

#[expect(clippy::ref_option, reason = "serde calls it with a reference to the field")]
pub(super) fn serialize_place<S: Serializer>(place: &Option<[Fraction; 2]>, s: S) -> Result<S::Ok, S::Error> {
    place.map(|cell| cell.map(|size| size.to_string())).serialize(s)
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference to the field")]
pub(super) fn serialize_activation<S: Serializer>(activation: &Activation, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(activation_word(*activation))
}

pub(super) fn normalisation_word(normalisation: Normalisation) -> &'static str {
    match normalisation {
        Normalisation::Fixed => "fixed",
        Normalisation::PerGraph => "per-graph",
    }
}

pub(crate) const fn activation_word(activation: Activation) -> &'static str {
    match activation {
        Activation::Identity => "identity",
        Activation::Relu => "relu",
        Activation::Elu => "elu",
        Activation::Tanh => "tanh",
        Activation::Sigmoid => "sigmoid",
    }
}

pub(super) fn activations<const N: usize>(kinds: [Activation; N]) -> [(&'static str, Activation); N] {
    kinds.map(|kind| (activation_word(kind), kind))
}
