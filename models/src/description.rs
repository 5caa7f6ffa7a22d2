//! Network descriptions: a TOML file, checked into an acyclic graph of layers with shapes.
//!
//! Enters: text. Leaves: a [`Description`], or every inconsistency of the file with its line. Invariant: a description
//! makes a network of any weights that have its tensors. After the check, only the weights can be wrong.
//!
//! This example has every table and key of a network over events:
//!
//! ```toml
//! [network]
//! name = "small"               # for reports
//! span_us = 150000             # length of the window in microseconds; default: 150000
//! capacity = 32768             # most events of the window; default: 32768
//! normalisation = "fixed"      # default; or "per-graph", as the published checkpoint was trained: batch only
//! place = ["1/32", "1/32"]     # optional: two more inputs, the place of an event in a cell of this size, from -1 to 1
//!
//! [graph]
//! kind = "knn"                 # with k; or "radius", with r (in shares of sensor and span) and max
//! k = 16
//! candidates = "all"           # or "past", with lifetime = "window" or "frozen"
//! scale = 0.5                  # of the edge attributes; not with "per-graph"
//!
//! [[layer]]
//! name = "conv1"
//! kind = "spline"
//! from = "events"              # default: the layer before; for the first layer the events
//! channels = 8                 # of each row that the layer writes
//! kernel = 2                   # along x, y and t; or [x, y] without time, or [x, y, t]
//! skip = "events"              # optional: a layer that is added, on the same level and with as many channels
//! root = false                 # default; true: a weight for the row itself
//! bias = false                 # default
//! norm = true                  # default: batch norm
//! elu = true                   # default: ELU after the convolution
//! weights = "blocks.0"         # prefix of the names of its tensors; default: its name
//!
//! [[layer]]
//! name = "conv2"
//! kind = "block"               # any block: [`conv`](convolution) chooses, `kind = "spline"` is short for conv = "spline"
//! conv = "pointnet"            # no keys of its own: maximum over the in-edges and the row itself, ReLU
//! channels = 16
//! skip = "conv1"               # these three as above
//! norm = true
//! weights = "blocks.1"
//!
//! [[layer]]
//! name = "pool1"
//! kind = "pool"
//! cell = ["16/346", "12/260"]  # size of a cell along x and y, as fractions of the sensor
//! time = "1/3"                 # size along t, as a fraction of the span; default: one cell for all times
//! position = "mean"            # default: a cell lies at the mean of its members; or "centre"
//! scale = 0.4                  # of the edge attributes on the level that starts here
//!
//! [[layer]]
//! name = "grid"
//! kind = "readout"
//! grid = [4, 4]                # columns, rows
//! aggregation = "max"          # default; or "sum", over events only: a sum counts, a maximum does not
//! by_time = false              # default; true: a grid for each cell in time of the poolings, the newest first
//!
//! [[layer]]
//! name = "fc"
//! kind = "dense"
//! outputs = 2
//! bias = true                  # default
//! activation = "identity"      # default; or "relu", "elu"
//!
//! [output]
//! names = ["roll", "pitch"]    # of the predicted values, in order
//! unit = "rad"                 # of all predicted values; or a list with that of each, such as ["mm", "deg"]
//! ```
//!
//! A network that predicts classes has `classes` in place of `names` and `unit`. Its values are logits, and a softmax turns
//! them into probabilities. (`names` with `unit = "logit"` mean the same.)
//!
//! ```toml
//! [output]
//! classes = ["left", "right", "none"]
//! ```
//!
//! Tables `[[head]]` can take the place of dense layers. They describe a frame network that reads the readout as an image with
//! the columns and rows of the grid. Channel `age C + c` of this image is channel c of the grid that is `age` cells in time
//! old. Kinds and keys are those of [the layers of frame networks](frames), without the layers that remember frames
//! (`conv_lstm`, `lstm`, `delay`).
//!
//! ```toml
//! [[head]]
//! name = "image1"
//! kind = "conv"
//! from = "grid"                # default: the layer before; for the first layer the readout
//! channels = 32
//! kernel = 3
//! bias = false
//! norm = "norm1"
//! activation = "relu"
//! weights = "conv1"
//!
//! [[head]]
//! name = "flat"
//! kind = "flatten"
//!
//! [[head]]
//! name = "out"                 # the last layer predicts; [output] has a name for each value that it writes
//! kind = "dense"
//! outputs = 2
//! ```
//!
//! The tables `[[layer]]` may stand in any order. A layer is evaluated after the layers that it reads, and otherwise in the
//! order of the file. The tables `[[head]]` must stand in the order of evaluation.

mod any;
mod build;
pub mod convolution;
mod document;
mod file;
pub mod frames;
mod layer;
mod preparation;
mod problem;
mod shapes;
mod table;
mod tensors;
mod wiring;

use meissner_engine::{Fraction, GraphRule, Normalisation};
use serde::Serialize;

pub use any::AnyDescription;
pub use convolution::ConvolutionKind;
pub use layer::{Cell, Cost, FieldStart, FieldStep, Layer, LayerKind, Per, ReceptiveField};
pub use preparation::Agreement;
pub use problem::{DescriptionError, Problem, ProblemKind};

pub(crate) use tensors::{Needed, Role};

use document::{EVENT_NETWORK, FRAME_NETWORK, INPUT};
use frames::FrameLayer;
use table::Table;

/// A checked network description.
///
/// ```
/// use meissner_models::Description;
///
/// let description = Description::shipped("tactigraph-past").expect("a shipped network");
/// assert_eq!((description.span_us(), &description.outputs().1[0][..]), (150_000, "rad"));
///
/// let error = Description::parse("[network]\nname = \"mine\"\nspan = 5\n").unwrap_err();
/// let lines: Vec<usize> = error.problems().iter().map(|problem| problem.line).collect();
/// assert!(lines.contains(&3), "{error}"); // every inconsistency with its line: `span` is not a key
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Description {
    name: String,
    span_us: i64,
    capacity: usize,
    #[serde(serialize_with = "layer::serialize_normalisation")]
    normalisation: Normalisation,
    #[serde(serialize_with = "layer::serialize_place", skip_serializing_if = "Option::is_none")]
    place: Option<[Fraction; 2]>,
    #[serde(skip)]
    graph: GraphRule,
    #[serde(skip)]
    scale: f32,
    layers: Vec<Layer>,
    head: Vec<FrameLayer>,
    outputs: Vec<String>,
    units: Vec<String>,
}

impl Description {
    /// Checks the file whose table is `root`.
    fn check(mut root: Table<'_, '_>) -> Option<Self> {
        if let Some(line) = root.line_of(INPUT) {
            root.report(line, ProblemKind::Family { expected: EVENT_NETWORK, found: FRAME_NETWORK });
            return None;
        }
        let file = file::read(&mut root);
        let problems = root.finish();
        if file.layers.is_empty() && !problems.0.is_empty() {
            return None;
        }
        let wiring = wiring::wire(&file, problems);
        let layers = shapes::check(&file, &wiring, problems);
        let head = shapes::check_head(&file, &layers, problems);
        let of_layers = layers.iter().map(|layer| (&*layer.name, layer.line, layer.tensors()));
        let of_head = head.iter().map(|layer| (&*layer.name, layer.line, layer.tensors()));
        tensors::report_shared(of_layers.chain(of_head), problems);
        Some(Self { layers, head, outputs: file.outputs?.value, ..file.network })
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Length of the window in microseconds.
    pub fn span_us(&self) -> i64 {
        self.span_us
    }

    /// Most events that the window holds.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// The reference of edge attributes and grids.
    pub fn normalisation(&self) -> Normalisation {
        self.normalisation
    }

    /// Size of the cells in which the place of an event is an input.
    pub fn place(&self) -> Option<[Fraction; 2]> {
        self.place
    }

    /// Channels of the input: the polarity of an event, and its place along x and y where [`Self::place`] has cells.
    pub fn inputs(&self) -> usize {
        if self.place.is_some() { 3 } else { 1 }
    }

    /// Rule of the event graph.
    pub fn graph(&self) -> GraphRule {
        self.graph
    }

    /// Scale of the event level's edge attributes; 1 and unused where they are normalised per graph.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Names of the predicted values, and the unit of each.
    pub fn outputs(&self) -> (&[String], &[String]) {
        (&self.outputs, &self.units)
    }

    /// The layers, each after those it reads, without those of a head.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The layers that read the readout as an image, each after those it reads; none where there are dense layers.
    pub fn head(&self) -> &[FrameLayer] {
        &self.head
    }

    /// Number of levels: the event level and one per pooling.
    pub fn levels(&self) -> usize {
        1 + self.layers.iter().filter(|l| matches!(l.kind, LayerKind::Pool { .. })).count()
    }

    /// Trained parameters: weights, biases, and batch norm's two, without its running statistics.
    pub fn parameters(&self) -> usize {
        let layers = self.layers.iter().map(|layer| layer.parameters);
        layers.chain(self.head.iter().map(|layer| layer.parameters)).sum()
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        let layers = self.layers.iter().flat_map(Layer::tensors);
        layers.chain(self.head.iter().flat_map(FrameLayer::tensors)).collect()
    }
}
