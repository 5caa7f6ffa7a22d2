//! Network descriptions: a TOML file, checked into an acyclic graph of layers with shapes.
//!
//! Input: text. Output: a [`Description`], or every inconsistency with its line. Invariant: a
//! description makes a network from any weights that have its tensors.
//!
//! `docs/network-files.md` lists every table and key; `models/tests/network_files.rs` compares it
//! with the parser.

mod any;
pub mod convolution;
mod document;
mod file;
pub(crate) mod filters;
pub mod frames;
mod layer;
pub(crate) mod preparation;
mod problem;
mod references;
mod refit;
mod resized;
mod shapes;
mod table;
pub(crate) mod tensors;
mod wiring;

use std::sync::Arc;

use meissner_engine::filters::FilterRule;
use meissner_engine::frames::{Convolution, FrameLayer as Part, FrameNetwork, FrameNetworkParts};
use meissner_engine::{
    Block, DenseLayer, EngineError, Fraction, GraphRule, Level, Network, NetworkParts, Normalisation,
    Pooling, Readout,
};
use meissner_kernels::{Dense, KernelError};
use serde::Serialize;

use crate::error::ModelError;
use crate::weights::Weights;

pub use any::AnyDescription;
pub use convolution::ConvolutionKind;
pub use layer::{Cell, Cost, CostUnit, FieldStart, FieldStep, Layer, LayerKind, ReceptiveField};
pub use preparation::Agreement;
pub use problem::{DescriptionError, Problem, ProblemKind};
pub use refit::{KeptHead, Outputs, Refit, Refitted};
pub use resized::Sizes;
pub(crate) use tensors::{Needed, Role};

use document::{EVENT_NETWORK, FRAME_NETWORK, INPUT};
use frames::FrameLayer;
use table::Table;
use tensors::Tensors;

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
    #[serde(serialize_with = "filters::serialize", skip_serializing_if = "Vec::is_empty")]
    filters: Vec<FilterRule>,
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

    /// Maximum number of events that the window holds.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// The reference of edge attributes and grids.
    pub fn normalisation(&self) -> Normalisation {
        self.normalisation
    }

    /// Size of the cells, if the place of an event in its cell is an input.
    pub fn place(&self) -> Option<[Fraction; 2]> {
        self.place
    }

    /// Input channels: an event's polarity, and its place along x and y with [`Self::place`].
    pub fn inputs(&self) -> usize {
        if self.place.is_some() { 3 } else { 1 }
    }

    /// The filters before the network, in the order in which events pass them.
    pub fn filters(&self) -> &[FilterRule] {
        &self.filters
    }

    /// Rule of the event graph.
    pub fn graph(&self) -> GraphRule {
        self.graph
    }

    /// Scale of the event level's edge attributes; 1 and unused if normalised per graph.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Names of the predicted values, and the unit of each.
    pub fn outputs(&self) -> (&[String], &[String]) {
        (&self.outputs, &self.units)
    }

    /// The layers, each after the layers that it reads, without those of a head.
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

    /// Number of trained parameters: weights, biases, and the two of batch norm, without its
    /// running statistics.
    pub fn parameters(&self) -> usize {
        let layers = self.layers.iter().map(|layer| layer.parameters);
        layers.chain(self.head.iter().map(|layer| layer.parameters)).sum()
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        let layers = self.layers.iter().flat_map(Layer::tensors);
        layers.chain(self.head.iter().flat_map(FrameLayer::tensors)).collect()
    }
}

impl Description {
    /// The network with `weights`. Their names may differ according to the habits of `PyTorch`,
    /// which `docs/weights-from-pytorch.md` lists.
    ///
    /// # Errors
    /// [`ModelError::Weights`] with every tensor that is missing, of another shape or type, or not
    /// computable; [`ModelError::Ambiguous`] and [`ModelError::Doubled`] for names that fit more
    /// than one way; [`ModelError::Map`] for names of a map that the network does not read;
    /// [`ModelError::Preparation`] for weights trained on other graphs ([`Self::preparation`]);
    /// [`ModelError::Engine`] only if the engine's bounds are narrower than the description's.
    pub fn network(&self, weights: &Weights) -> Result<Network, ModelError> {
        self.check_preparation(weights)?;
        self.network_ignoring_preparation(weights)
    }

    /// As [`Self::network`], even if the weights were trained on other graphs: predictions then
    /// differ from those of the training.
    ///
    /// # Errors
    /// As [`Self::network`], without [`ModelError::Preparation`].
    pub fn network_ignoring_preparation(&self, weights: &Weights) -> Result<Network, ModelError> {
        let mut tensors = Tensors::new(&self.name, &self.needed(), weights)?;
        let parts = self.parts(&mut tensors)?;
        let network = Network::new(tensors.finish(parts)?)?.with_filters(&*self.filters)?;
        Ok(network.with_training_windows(weights.training_windows()?))
    }

    /// `None` if a tensor does not fit.
    fn parts(&self, tensors: &mut Tensors<'_>) -> Result<Option<NetworkParts>, ModelError> {
        let mut levels = vec![Level { scale: self.scale, blocks: Vec::new() }];
        let mut poolings = Vec::new();
        let mut readout = None;
        let mut segments = None;
        let mut dense = Vec::new();
        let mut whole = true;
        for layer in &self.layers {
            match &layer.kind {
                LayerKind::Block { .. } => match block(layer, tensors)? {
                    Some(block) => levels[layer.level.unwrap_or(0)].blocks.push(block),
                    None => whole = false,
                },
                LayerKind::Pool { cell, position, scale } => {
                    let (name, from, position) = (layer.name.clone(), layer.reads, *position);
                    poolings.push(Pooling { name, from, cell: cell.cell, time: cell.time, position });
                    levels.push(Level { scale: *scale, blocks: Vec::new() });
                }
                &LayerKind::Readout { columns, rows, aggregation, times } => {
                    let (from, by_time) = (layer.reads, times > 1);
                    readout = Some(Readout { from, columns, rows, aggregation, by_time });
                    segments = Some(layer.inputs);
                }
                LayerKind::Dense { .. } => {
                    // The readout's cells are padded to whole lanes each; a dense layer's values
                    // are one segment.
                    let segment = segments.take().unwrap_or(layer.inputs);
                    match dense_layer(layer, segment, tensors)? {
                        Some(built) => dense.push(built),
                        None => whole = false,
                    }
                }
            }
        }
        let head = frames::parts(&self.head, tensors);
        let (Some(readout), Some(head)) = (readout.filter(|_| whole), head) else { return Ok(None) };
        let events = levels.remove(0);
        Ok(Some(NetworkParts {
            name: self.name.clone(),
            span_us: self.span_us,
            capacity: self.capacity,
            graph: self.graph,
            normalisation: self.normalisation,
            place: self.place,
            events,
            pooled: poolings.into_iter().zip(levels).collect(),
            readout,
            dense,
            head: self.head_of(head)?,
        }))
    }

    /// The head that consists of `layers`, if there is one.
    fn head_of(&self, layers: Vec<Part>) -> Result<Option<Arc<FrameNetwork>>, ModelError> {
        // The first layer of a head always reads the image.
        let Some(first) = self.head.first() else { return Ok(None) };
        let parts = FrameNetworkParts { name: self.name.clone(), input: first.input, layers, training: None };
        // An event changes one cell of the image.
        Ok(Some(Arc::new(FrameNetwork::new(parts, Convolution::Kn2row)?)))
    }
}

fn refused(layer: &Layer, source: KernelError) -> ModelError {
    EngineError::Layer { layer: layer.name.clone(), source }.into()
}

fn block(layer: &Layer, tensors: &mut Tensors<'_>) -> Result<Option<Block>, ModelError> {
    let LayerKind::Block { conv, norm, .. } = &layer.kind else { return Ok(None) };
    let Some(mut values) = tensors.all(&layer.tensors()) else { return Ok(None) };
    let folded = norm.then(|| tensors.norm(&layer.tensor("norm"), layer.outputs).map(|norm| norm.rounded()));
    if let Some(None) = folded {
        return Ok(None);
    }
    let conv = conv
        .build((layer.inputs, layer.outputs), &mut values, folded.flatten())
        .map_err(|source| refused(layer, source))?;
    Ok(Some(Block { name: layer.name.clone(), input: layer.reads, skip: layer.adds, conv }))
}

fn dense_layer(
    layer: &Layer,
    segment: usize,
    tensors: &mut Tensors<'_>,
) -> Result<Option<DenseLayer>, ModelError> {
    let LayerKind::Dense { bias, activation } = layer.kind else { return Ok(None) };
    let Some(mut values) = tensors.all(&layer.tensors()) else { return Ok(None) };
    let (weight, bias) = (values.take(), bias.then(|| values.take()));
    let dense = Dense::new(layer.inputs / segment, segment, layer.outputs, weight, bias, activation)
        .map_err(|source| refused(layer, source))?;
    Ok(Some(DenseLayer { name: layer.name.clone(), dense }))
}
