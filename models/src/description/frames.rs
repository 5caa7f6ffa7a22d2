//! Descriptions of frame networks: a TOML file, checked into layers over images and vectors.
//!
//! Enters: text. Leaves: a [`FrameDescription`], or every inconsistency with its line. It has a
//! table `[input]` instead of `[graph]` (`docs/network-files.md`).

mod build;
mod file;
mod input;
mod layer;
mod shapes;
mod source;

use meissner_engine::frames::FrameShape;
use serde::Serialize;

use super::document::{EVENT_NETWORK, FRAME_NETWORK, INPUT, output};
use super::problem::ProblemKind;
use super::references::Scope;
use super::table::{self, NAME, Table};
use super::tensors::{Needed, report_shared};

pub(super) use build::parts;
pub(super) use file::read_head;
pub(crate) use layer::{FRAME, serialize_shape};
pub use layer::{FrameKind, FrameLayer};
pub(super) use shapes::{Stack, check, extent, fits};
pub use source::{CropPlace, FrameSource, PictureSettings, Readings, SignedTiming};

/// A checked description of a frame network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameDescription {
    name: String,
    #[serde(serialize_with = "serialize_shape")]
    input: FrameShape,
    source: FrameSource,
    layers: Vec<FrameLayer>,
    outputs: Vec<String>,
    units: Vec<String>,
}

impl FrameDescription {
    /// Checks the file whose table is `root`.
    pub(super) fn check(mut root: Table<'_, '_>) -> Option<Self> {
        if root.line_of(INPUT).is_none()
            && let Some(line) = root.line_of("graph")
        {
            root.report(line, ProblemKind::Family { expected: FRAME_NETWORK, found: EVENT_NETWORK });
            return None;
        }
        let mut name = String::new();
        if let Some(mut table) = root.table("network", "a table with the network's name") {
            name = table.value("name", NAME, None, table::name);
            table.finish();
        }
        let input = root.table(INPUT, "a table with a frame's shape and source");
        let (shape, source) = input.map_or((None, None), input::read);
        let output = output(&mut root);
        let layers = file::read_layers(&mut root);
        let problems = root.finish();
        let stack = Stack {
            layers: &layers,
            scope: Scope { input: FRAME, second: "with", place: "in this file", above: true },
            shape,
            state: true,
            names: output.names.as_ref(),
            by_channel: true,
        };
        let layers = check(stack, problems);
        report_shared(layers.iter().map(|layer| (&*layer.name, layer.line, layer.tensors())), problems);
        let (outputs, units) = (output.names?.value, output.units);
        Some(Self { name, input: shape?, source: source?, layers, outputs, units })
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Shape of a frame.
    pub fn input(&self) -> FrameShape {
        self.input
    }

    /// The source of the frames.
    pub fn source(&self) -> &FrameSource {
        &self.source
    }

    /// The layers, each after those it reads; the last one predicts.
    pub fn layers(&self) -> &[FrameLayer] {
        &self.layers
    }

    /// Shape of the prediction.
    pub fn output(&self) -> FrameShape {
        self.layers.last().map_or(self.input, |layer| layer.output)
    }

    /// Names of the predicted values or of a predicted image's channels, and their units.
    pub fn outputs(&self) -> (&[String], &[String]) {
        (&self.outputs, &self.units)
    }

    /// Trained parameters: weights, biases, and batch norm's two, without its running statistics.
    pub fn parameters(&self) -> usize {
        self.layers.iter().map(|layer| layer.parameters).sum()
    }

    /// Products of weights with values, each with the sum that it enters, for one frame.
    pub fn multiply_adds(&self) -> usize {
        self.layers.iter().map(|layer| layer.multiply_adds).sum()
    }

    /// Values that it keeps from frame to frame.
    pub fn state(&self) -> usize {
        self.layers.iter().map(|layer| layer.state).sum()
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        self.layers.iter().flat_map(FrameLayer::tensors).collect()
    }
}
