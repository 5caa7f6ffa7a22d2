//! The head of a network over events: layers of frame networks that read the readout as an image.
//!
//! Enters: a [`File`] and its checked layers. Leaves: checked [`FrameLayer`]s, none where there is no head; layers of which
//! something was reported are left out. Invariant: where nothing was reported, the engine accepts them as the head of the
//! network, whose image is
//!
//! ```text
//! channels = (channels of a cell) (cells in time),   height = rows,   width = columns
//! ```

use meissner_engine::frames::FrameShape;

use super::file::{File, FileKind};
use super::frames::{FrameLayer, Stack, check as check_stack, extent, fits};
use super::layer::{Layer, LayerKind};
use super::problem::{ProblemKind, Problems};

/// Checks the head of `file` against `layers`.
pub(super) fn check(file: &File, layers: &[Layer], problems: &mut Problems) -> Vec<FrameLayer> {
    if file.head.is_empty() {
        return Vec::new();
    }
    for layer in file.head.iter().filter(|layer| !layer.name.is_empty()) {
        if let Some(first) = file.layers.iter().find(|first| first.name == layer.name) {
            let kind = ProblemKind::DuplicateName { first: first.line };
            problems.add(layer.line, Some(&layer.name), kind);
        }
    }
    // Without a readout, which was reported, there is no telling what the layers read.
    let Some(readout) = file.layers.iter().find(|layer| matches!(layer.kind, FileKind::Readout { .. }))
    else {
        return Vec::new();
    };
    let image = layers.iter().find(|layer| layer.line == readout.line).and_then(image);
    let shape = image.filter(|&image| fits(image));
    if let Some(image) = image
        && shape.is_none()
    {
        problems.add(readout.line, Some(&readout.name), extent(image));
    }
    let stack = Stack {
        layers: &file.head,
        input: &readout.name,
        shape,
        place: "of a table [[head]]",
        state: false,
        names: file.outputs.as_ref(),
        by_channel: false,
    };
    check_stack(stack, problems)
}

/// The image that a head reads of the readout `layer`.
fn image(layer: &Layer) -> Option<FrameShape> {
    let LayerKind::Readout { columns, rows, times } = layer.kind else { return None };
    Some(FrameShape::Image { channels: layer.inputs.saturating_mul(times), height: rows, width: columns })
}
