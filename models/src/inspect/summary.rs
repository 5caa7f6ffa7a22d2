//! What a description says, as data for `--json`.

use meissner_engine::{Candidates, Lifetime, Normalisation, Reach};
use serde::Serialize;

use crate::{Description, FrameLayer, Layer};

/// A description as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Name of the network.
    pub name: String,
    /// Length of the window in microseconds.
    pub span_us: i64,
    /// Most events that the window holds.
    pub capacity: usize,
    /// "fixed", or "per-graph" (batch only).
    pub normalisation: &'static str,
    /// Rule of the event graph.
    pub graph: GraphSummary,
    /// The layers, each after those it reads.
    pub layers: Vec<Layer>,
    /// The layers that read the readout as an image, each after those it reads; none where there are dense layers.
    pub head: Vec<FrameLayer>,
    /// Trained parameters, without running statistics.
    pub parameters: usize,
    /// Values in the tensors it needs, with running statistics.
    pub values: usize,
    /// The tensors it needs.
    pub tensors: Vec<TensorSummary>,
    /// Names of the predicted values.
    pub outputs: Vec<String>,
    /// Their unit.
    pub unit: String,
    /// What weights that are trained for it carry as metadata `preparation`.
    pub preparation: String,
}

/// Rule of the event graph, in the words of a description file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GraphSummary {
    /// "knn" or "radius".
    pub kind: &'static str,
    /// Most in-edges of an event.
    pub most: usize,
    /// Largest distance, in shares of sensor and span; none for "knn".
    pub radius: Option<f64>,
    /// "all" or "past".
    pub candidates: &'static str,
    /// "window" or "frozen"; none for "all".
    pub lifetime: Option<&'static str>,
    /// Scale of the event level's edge attributes; none where they are normalised per graph.
    pub scale: Option<f32>,
}

/// A tensor that a network needs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct TensorSummary {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
}

impl Description {
    /// The description as data.
    pub fn summary(&self) -> Summary {
        let tensors = self.tensors();
        let (outputs, unit) = self.outputs();
        Summary {
            name: self.name().to_owned(),
            span_us: self.span_us(),
            capacity: self.capacity(),
            normalisation: match self.normalisation() {
                Normalisation::Fixed => "fixed",
                Normalisation::PerGraph => "per-graph",
            },
            graph: self.graph_summary(),
            layers: self.layers().to_vec(),
            head: self.head().to_vec(),
            parameters: self.parameters(),
            values: tensors.iter().map(|(_, shape)| shape.iter().product::<usize>()).sum(),
            tensors: tensors.into_iter().map(|(name, shape)| TensorSummary { name, shape }).collect(),
            outputs: outputs.to_vec(),
            unit: unit.to_owned(),
            preparation: self.preparation(),
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
