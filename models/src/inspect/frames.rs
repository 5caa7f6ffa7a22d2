//! A frame network as a table and as data.

use std::fmt;

use meissner_engine::frames::FrameShape;
use serde::Serialize;

use super::summary::TensorSummary;
use super::table::aligned;
use crate::description::frames::serialize_shape;
use crate::{FrameDescription, FrameLayer, FrameSource};

const HEADINGS: [&str; 7] = ["layer", "kind", "reads", "shape", "parameters", "multiply-adds", "state"];

/// A description of a frame network as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameSummary {
    /// Name of the network.
    pub name: String,
    /// Shape of a frame.
    #[serde(serialize_with = "serialize_shape")]
    pub input: FrameShape,
    /// What makes the frames.
    pub source: FrameSource,
    /// The layers, each after those it reads.
    pub layers: Vec<FrameLayer>,
    /// Trained parameters, without running statistics.
    pub parameters: usize,
    /// Values in the tensors it needs, with running statistics.
    pub values: usize,
    /// Products of weights with values, each with the sum that it enters, for one frame.
    pub multiply_adds: usize,
    /// Values that it keeps from frame to frame.
    pub state: usize,
    /// The tensors it needs.
    pub tensors: Vec<TensorSummary>,
    /// What weights that are trained for it say about their frames, as metadata `preparation`; none where frames are not
    /// made of readings of electrodes.
    pub preparation: Option<String>,
    /// Shape of the prediction.
    #[serde(serialize_with = "serialize_shape")]
    pub output: FrameShape,
    /// Names of the predicted values, or of the channels of a predicted image.
    pub outputs: Vec<String>,
    /// Their unit.
    pub unit: String,
}

impl FrameDescription {
    /// The description as data.
    pub fn summary(&self) -> FrameSummary {
        let tensors: Vec<TensorSummary> = TensorSummary::of_frames(self.layers()).collect();
        let (outputs, unit) = self.outputs();
        FrameSummary {
            name: self.name().to_owned(),
            input: self.input(),
            source: *self.source(),
            layers: self.layers().to_vec(),
            parameters: self.parameters(),
            values: tensors.iter().map(TensorSummary::values).sum(),
            multiply_adds: self.multiply_adds(),
            state: self.layers().iter().map(|layer| layer.state).sum(),
            tensors,
            preparation: self.preparation(),
            output: self.output(),
            outputs: outputs.to_vec(),
            unit: unit.to_owned(),
        }
    }

    /// What `meissner inspect` prints: the frames, a line for each layer, and the totals.
    pub fn to_table(&self) -> String {
        self.to_string()
    }
}

impl fmt::Display for FrameDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = self.summary();
        writeln!(f, "network    {}", summary.name)?;
        writeln!(f, "input      {}", summary.input)?;
        writeln!(f, "frames     {}", summary.source)?;
        writeln!(f, "output     {} ({}), {}\n", summary.outputs.join(", "), summary.unit, summary.output)?;
        aligned(HEADINGS, self.layers().iter().map(row), f)?;
        writeln!(f, "\nparameters {} trained, {} values in all", summary.parameters, summary.values)?;
        write!(
            f,
            "a frame: {} multiply-adds, {} values kept to the next",
            summary.multiply_adds, summary.state
        )
    }
}

pub(super) fn row(layer: &FrameLayer) -> [String; 7] {
    [
        layer.name.clone(),
        layer.kind.to_string(),
        layer.with().map_or_else(|| layer.from.clone(), |with| format!("{}, {with}", layer.from)),
        format!("{} -> {}", layer.input, layer.output),
        layer.parameters.to_string(),
        layer.multiply_adds.to_string(),
        layer.state.to_string(),
    ]
}
