//! Reports on a description: a readable table, data for programs, pictures of the graph.
//!
//! Input: a checked description. Output: text. Invariant: equal descriptions give equal bytes.

pub(crate) mod picture;
pub(crate) mod view;

use meissner_engine::frames::FrameShape;
use meissner_engine::{Candidates, Lifetime, Normalisation, Reach};
use serde::Serialize;

use crate::description::frames::{FrameDescription, FrameLayer, serialize_shape};
use crate::description::{AnyDescription, ConvolutionKind, Description, Layer, LayerKind, Needed};

pub use view::grouped;

/// A description as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// The network with its layers and outputs.
    #[serde(flatten)]
    pub description: Description,
    /// Rule of the event graph.
    pub graph: GraphSummary,
    /// Definition of the edge attributes on each level.
    pub edge_attributes: EdgeSummary,
    /// Trained parameters, without running statistics.
    pub parameters: usize,
    /// Values in the tensors it needs, with running statistics.
    pub values: usize,
    /// The tensors it needs.
    pub tensors: Vec<TensorSummary>,
    /// The metadata `preparation` of weights that are trained for it.
    pub preparation: String,
}

/// A description of a frame network as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameSummary {
    /// The network with its layers and outputs.
    #[serde(flatten)]
    pub description: FrameDescription,
    /// Trained parameters, without running statistics.
    pub parameters: usize,
    /// Values in the tensors it needs, with running statistics.
    pub values: usize,
    /// Number of multiply-adds of weights with values for one frame.
    pub multiply_adds: usize,
    /// Number of values that it keeps from frame to frame.
    pub state: usize,
    /// The tensors it needs.
    pub tensors: Vec<TensorSummary>,
    /// The metadata `preparation` of weights trained for it; `None` if frames do not come from
    /// electrodes.
    pub preparation: Option<String>,
    /// Shape of the prediction.
    #[serde(serialize_with = "serialize_shape")]
    pub output: FrameShape,
}

/// A description of either kind as data; only a frame network has "input".
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum AnySummary {
    /// Data of a network over events.
    Events(Summary),
    /// Data of a frame network.
    Frames(FrameSummary),
}

/// Rule of the event graph, in the words of a description file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GraphSummary {
    /// "knn" or "radius".
    pub kind: &'static str,
    /// Maximum number of in-edges of an event.
    pub most: usize,
    /// Largest distance, in shares of sensor and span; none for "knn".
    pub radius: Option<f64>,
    /// "all" or "past".
    pub candidates: &'static str,
    /// "window" or "frozen"; none for "all".
    pub lifetime: Option<&'static str>,
    /// Scale of the event level's edge attributes; `None` if they are normalised per graph.
    pub scale: Option<f32>,
}

/// Definition of edge attributes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EdgeSummary {
    /// The attribute of the edge by which row i reads row j.
    pub attribute: &'static str,
    /// The offset of that edge, if a layer reads it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<&'static str>,
    /// Positions p.
    pub position: &'static str,
    /// The event level, then one for each pooling.
    pub levels: Vec<LevelSummary>,
}

/// A level of a network over events.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LevelSummary {
    /// Its number, 0 for the events.
    pub level: usize,
    /// "events", or the pooling that starts it.
    pub rows: String,
    /// Scale s of its edge attributes; none if s is the largest difference over the edges.
    pub scale: Option<f32>,
}

/// A tensor that a network needs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct TensorSummary {
    /// Its name.
    pub name: String,
    /// The layer that reads it.
    pub layer: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Type of its values; F16, BF16 and F64 are converted to it.
    pub dtype: &'static str,
    /// Its content and its axes, outermost first.
    pub meaning: &'static str,
    /// Strides of a spline kernel for the index along x, y and t: slot = the sum of index times
    /// stride.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slot_strides: Option<[usize; 3]>,
}

impl TensorSummary {
    /// The tensors of a layer, in order; a spline kernel has `slot_strides`.
    fn of(layer: &str, needed: Vec<Needed>, slot_strides: Option<[usize; 3]>) -> impl Iterator<Item = Self> {
        needed.into_iter().map(move |Needed { name, shape, meaning, .. }| {
            // Only the kernel has slots.
            let slot_strides = slot_strides.filter(|_| shape.len() == 3);
            Self { name, layer: layer.to_owned(), shape, dtype: "F32", meaning, slot_strides }
        })
    }

    /// The tensors of layers of a frame network or a head, in order.
    fn of_frames(layers: &[FrameLayer]) -> impl Iterator<Item = Self> {
        layers.iter().flat_map(|layer| Self::of(&layer.name, layer.tensors(), None))
    }

    fn values(&self) -> usize {
        self.shape.iter().product()
    }
}

impl Description {
    /// The description as data.
    pub fn summary(&self) -> Summary {
        let layers = self.layers().iter();
        let strides = |l: &Layer| l.convolution().and_then(ConvolutionKind::slot_strides);
        let of_layers = layers.flat_map(|l| TensorSummary::of(&l.name, l.tensors(), strides(l)));
        let tensors: Vec<_> = of_layers.chain(TensorSummary::of_frames(self.head())).collect();
        Summary {
            description: self.clone(),
            graph: self.graph_summary(),
            edge_attributes: self.edge_summary(),
            parameters: self.parameters(),
            values: tensors.iter().map(TensorSummary::values).sum(),
            tensors,
            preparation: self.preparation(),
        }
    }

    fn edge_summary(&self) -> EdgeSummary {
        let scaled = |scale| Some(scale).filter(|_| self.normalisation() == Normalisation::Fixed);
        let mut levels =
            vec![LevelSummary { level: 0, rows: "events".to_owned(), scale: scaled(self.scale()) }];
        for layer in self.layers() {
            if let LayerKind::Pool { scale, .. } = layer.kind {
                let level = levels.len();
                levels.push(LevelSummary { level, rows: layer.name.clone(), scale: scaled(scale) });
            }
        }
        let offsets = self.layers().iter().filter_map(Layer::convolution).any(ConvolutionKind::reads_offsets);
        EdgeSummary {
            attribute: "clamp((p_j - p_i) / (2 scale) + 0.5, 0, 1) along x, y and t, of the edge by which row i reads row j",
            offset: offsets
                .then_some("(p_j - p_i) / scale along x, y and t, of the edge by which row i reads row j"),
            position: "p = (x / width, y / height, t / span) of an event; of a cell as its pooling says",
            levels,
        }
    }

    pub(crate) fn graph_summary(&self) -> GraphSummary {
        let rule = self.graph();
        let (kind, radius) = match rule.reach {
            Reach::Knn { .. } => ("knn", None),
            Reach::Radius { r, .. } => ("radius", Some(r)),
        };
        let (candidates, lifetime) = match rule.candidates {
            Candidates::All => ("all", None),
            Candidates::Past(Lifetime::Window) => ("past", Some("window")),
            Candidates::Past(Lifetime::Frozen) => ("past", Some("frozen")),
        };
        let scale = (self.normalisation() == Normalisation::Fixed).then(|| self.scale());
        GraphSummary { kind, most: rule.reach.most(), radius, candidates, lifetime, scale }
    }
}

impl FrameDescription {
    /// The description as data.
    pub fn summary(&self) -> FrameSummary {
        let tensors: Vec<_> = TensorSummary::of_frames(self.layers()).collect();
        FrameSummary {
            description: self.clone(),
            parameters: self.parameters(),
            values: tensors.iter().map(TensorSummary::values).sum(),
            multiply_adds: self.multiply_adds(),
            state: self.state(),
            tensors,
            preparation: self.preparation(),
            output: self.output(),
        }
    }
}

impl AnyDescription {
    /// The description as data.
    pub fn summary(&self) -> AnySummary {
        match self {
            Self::Events(description) => AnySummary::Events(description.summary()),
            Self::Frames(description) => AnySummary::Frames(description.summary()),
        }
    }
}

impl std::fmt::Display for GraphSummary {
    /// In one line: "knn, k = 16, all, scale 0.5".
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.radius {
            None => write!(f, "knn, k = {}", self.most)?,
            Some(r) => write!(f, "radius, r = {r}, max = {}", self.most)?,
        }
        write!(f, ", {}", self.candidates)?;
        if let Some(lifetime) = self.lifetime {
            write!(f, ", {lifetime}")?;
        }
        self.scale.map_or(Ok(()), |scale| write!(f, ", scale {scale}"))
    }
}
