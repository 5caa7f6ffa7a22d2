//! Network descriptions: a TOML file, checked into an acyclic graph of layers with shapes.
//!
//! Enters: text. Leaves: a [`Description`], or every inconsistency with its line. Invariant: a
//! description makes a network of any weights that have its tensors.
//!
//! `docs/network-files.md` has every table and key; `models/tests/network_files.rs` compares it.

mod any;
mod build;
pub mod convolution;
mod document;
mod file;
pub mod frames;
mod layer;
mod preparation;
mod problem;
mod references;
mod shapes;
mod table;
mod tensors;
mod wiring;

use meissner_engine::{Fraction, GraphRule, Normalisation};
use serde::Serialize;

pub use any::AnyDescription;
pub use convolution::ConvolutionKind;
pub use layer::{Cell, Cost, CostUnit, FieldStart, FieldStep, Layer, LayerKind, ReceptiveField};
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
/// assert!(lines.contains(&3), "{error}"); // `span` is not a key
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

    /// Input channels: an event's polarity, and its place along x and y with [`Self::place`].
    pub fn inputs(&self) -> usize {
        if self.place.is_some() { 3 } else { 1 }
    }

    /// Rule of the event graph.
    pub fn graph(&self) -> GraphRule {
        self.graph
    }

    /// Scale of the event level's edge attributes; 1, unused, if normalised per graph.
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

    /// The layers that read the readout as an image, in order; none with dense layers.
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
