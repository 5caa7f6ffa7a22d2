//! Descriptions of frame networks: a TOML file, checked into layers over images and vectors.
//!
//! Enters: text. Leaves: a [`FrameDescription`], or every inconsistency of the file with its line. A frame network has a table
//! `[input]` in place of `[graph]`:
//!
//! ```toml
//! [network]
//! name = "small"               # for reports
//!
//! [input]
//! kind = "image"               # with channels, height, width; or "vector", with values
//! channels = 2
//! height = 115
//! width = 115
//! frames = "event-counts"      # source of the frames, with its settings (see below)
//! period_us = 10000            # default
//! crop = "centre"              # default; or the first column and row, such as [116, 72]
//! maximum = 8                  # the count that becomes 1
//!
//! [[layer]]
//! name = "conv1"
//! kind = "conv"
//! from = "frame"               # default: the layer before; for the first layer the frame
//! channels = 3
//! kernel = 3                   # or 1
//! bias = true                  # default
//! norm = "bn1"                 # prefix of the names of batch norm's tensors; default: no batch norm
//! activation = "relu"          # default: "identity"
//! weights = "convs.0"          # prefix of the names of its tensors; default: its name
//!
//! [output]
//! names = ["force"]            # of the values of the last layer, or of the channels of a predicted image
//! unit = "N"                   # or classes = ["left", "right"] in place of names and unit
//! ```
//!
//! | `frames` | a frame | settings |
//! |---|---|---|
//! | `event-counts` | image, 2 channels | `period_us`, `crop`, `maximum` |
//! | `signed` | image, 1 channel | `span_us` (sliding) or `period_us` (consecutive), `crop`, `rule = "sum"` or `"latest"` |
//! | `tactile-image` | image, 1 x 12 x 11 | `steps`, `sampling = "consecutive"`, `"sliding"` or a stride, `scaling = "image"`, `"reading"` or `[minimum, maximum]` |
//! | `electrodes` | vector, 24 values | as `tactile-image` |
//! | `electrodes` | vector, 48 values: the 24 by `"reading"`, then the 24 by the range | as `tactile-image`, but `scaling = ["reading", [minimum, maximum]]` |
//! | `picture` | image, 3 channels | `difference = false`, or `true` for the difference from a picture without contact; `mean` and `std` of red, green, blue in [0, 1], or of the difference; `force_mean`, `force_std` in N per pixel; `pixel_mm = [x, y]`; `threshold_n`, `median_window` |
//!
//! | `kind` | reads -> writes | keys, with their defaults | tensors |
//! |---|---|---|---|
//! | `conv` | image -> image | `channels`, `kernel`, `bias = true`, `norm`, `activation = "identity"` or `"relu"` | `weight`, `bias` |
//! | `upconv` | image -> image twice as large | `channels`, `bias = true` | `weight`, `bias` |
//! | `max_pool` | image -> image half as large | | |
//! | `average_pool` | image -> smaller image | `size` | |
//! | `global_average`, `sum` | image -> a value a channel | | |
//! | `concat` | two images -> image of the channels of both; two vectors -> vector of the values of both | `with` | |
//! | `squeeze_excite` | image -> image | `reduction = 16` | `down.weight`, `up.weight` |
//! | `conv_lstm` | image -> image | `hidden`, `peepholes = false`, `activation = "tanh"` or `"sigmoid"` | `gates.weight`, `gates.bias`, `peephole` |
//! | `lstm` | vector -> vector | `hidden`, `layer = 0` | `weight_ih_l0`, `weight_hh_l0`, `bias_ih_l0`, `bias_hh_l0` |
//! | `delay` | vector -> the last vectors | `frames` | |
//! | `flatten` | image -> vector | | |
//! | `dense` | vector -> vector | `outputs`, `bias = true`, `norm`, `activation = "identity"`, `"relu"` or `"elu"` | `weight`, `bias` |
//!
//! Layers stand in the order of evaluation. Each layer reads layers above it. The last layer predicts, and it must depend on
//! all layers.

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
use super::table::{self, NAME, Table};
use super::tensors::{Needed, report_shared};
use super::wiring::Scope;

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

    /// Names of the predicted values, or of the channels of a predicted image, and the unit of each.
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
