//! Transposed convolution with 2 x 2 places and stride 2: each input pixel becomes four output pixels.
//!
//! y(2 p + d, o) = relu(b(o) + sum over i, ascending, of x(p, i) W(i, o, d)), one chain of sums from the bias.

use super::conv::{check_inputs, place};
use super::layer::{Layer, Source};
use super::region::Region;
use super::view::{Band, Target, View};
use super::weights::{ConvParts, Layout, Packed};
use crate::error::KernelError;
use crate::isa::Isa;

/// A layer that doubles height and width.
#[derive(Clone, Debug)]
pub struct TransposedConv2x2 {
    inputs: Vec<usize>,
    /// By place: upper left, upper right, lower left, lower right.
    places: [Packed; 4],
}

impl TransposedConv2x2 {
    /// Packs a layer's parameters.
    ///
    /// # Errors
    /// A size that is zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(parts: &ConvParts) -> Result<Self, KernelError> {
        parts.check(4)?;
        let packed = |d: usize| {
            Packed::new(parts, parts.channels(), |row, o| {
                let (_, i) = place(&parts.inputs, 1, row);
                parts.weight(Layout::InputsFirst, 4, [i, d, o])
            })
        };
        Ok(Self { inputs: parts.inputs.clone(), places: std::array::from_fn(packed) })
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.places[0].outputs
    }

    /// Computes the four outputs of each pixel in `region`, a region of the inputs.
    ///
    /// # Errors
    /// [`KernelError::Shape`] or [`KernelError::Length`] of a map that does not fit (the output has twice the inputs'
    /// height and width), [`KernelError::Region`] where the region's outputs are not within the band.
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
    ) -> Result<(), KernelError> {
        let [height, width] = inputs.first().map_or([0; 2], |view| [view.shape.height, view.shape.width]);
        check_inputs(&self.inputs, inputs, [height, width], 0)?;
        region.check_within(height, width)?;
        let Region { y, x, .. } = region;
        let outputs = Region { y: 2 * y, x: 2 * x, height: 2 * region.height, width: 2 * region.width };
        out.check([2 * height, 2 * width, self.outputs()], outputs)?;
        if region.is_empty() {
            return Ok(());
        }
        for (d, packed) in self.places.iter().enumerate() {
            let sources = std::array::from_fn(|m| {
                let view = inputs.get(m)?;
                Some(Source::new(*view, 1, y + view.shape.halo, x + view.shape.halo))
            });
            let Target { values, row, pixel } = out.target(2 * y + d / 2, 2 * x + d % 2);
            let target = Target { values, row: 2 * row, pixel: 2 * pixel };
            isa.run(Layer { packed, sources, rows: region.height, columns: region.width, target });
        }
        Ok(())
    }
}
