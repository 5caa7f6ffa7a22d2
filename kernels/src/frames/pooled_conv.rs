//! A 3 x 3 convolution fused with the 2 x 2 maximum that alone reads its outputs, with the bits of the two in sequence.
//! The map between them is never written: it would be four times the result, and such layers are limited by memory.

use super::conv::{Conv3x3, check_inputs};
use super::layer::{Layer, sources};
use super::shape::Region;
use super::tiles::store_some;
use super::view::{Band, Target, View};
use crate::error::KernelError;
use crate::isa::{Isa, Simd, Task, Vector, flat_wide_mut};
use crate::lanes::{LANES, Wide};

/// Values of the current strip of outputs; small enough for the second-level cache.
const STRIP: usize = 1 << 16;

/// The fused layers.
#[derive(Clone, Debug)]
pub struct PooledConv3x3 {
    conv: Conv3x3,
}

/// Working space for a strip of outputs before pooling; grows to the need of the largest layer.
#[derive(Clone, Debug, Default)]
pub struct PooledScratch {
    strip: Vec<Wide>,
}

impl PooledConv3x3 {
    /// `conv`, followed by the maximum.
    pub fn new(conv: Conv3x3) -> Self {
        Self { conv }
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.conv.outputs()
    }

    /// Total number of channels of the input maps.
    pub fn reads(&self) -> usize {
        self.conv.inputs.iter().sum()
    }

    /// Largest number of bytes of scratch for a map of `height` x `width` pooled outputs, on one thread.
    pub fn scratch_bytes(&self, height: usize, width: usize) -> u128 {
        let row = 2 * width as u128 * self.outputs() as u128;
        let rows = (STRIP as u128).max(2 * row).min(2 * row * height as u128);
        (rows.div_ceil(2 * LANES as u128) + 1) * size_of::<Wide>() as u128
    }

    /// Computes the pooled outputs of `region`; other outputs are unchanged. Input maps have a halo of at least 1 and
    /// twice the output's height and width, or one more.
    ///
    /// # Errors
    /// As [`DirectConv::run`](super::DirectConv::run).
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
        scratch: &mut PooledScratch,
    ) -> Result<(), KernelError> {
        let [height, width] = inputs.first().map_or([0; 2], |view| [view.shape.height, view.shape.width]);
        let outputs = self.outputs();
        out.check([height / 2, width / 2, outputs], region)?;
        check_inputs(&self.conv.inputs, inputs, [height, width], 1)?;
        if region.is_empty() {
            return Ok(());
        }
        let row = 2 * region.width * outputs;
        let most = (STRIP / (2 * row)).clamp(1, region.height);
        // One more vector, so that whole vectors can be read up to the end.
        scratch.strip.resize(scratch.strip.len().max((2 * most * row).div_ceil(2 * LANES) + 1), Wide::ZERO);
        let mut y = region.y;
        while y < region.y + region.height {
            let rows = most.min(region.y + region.height - y);
            let sources = sources(inputs, 3, 1, [2 * y, 2 * region.x]);
            let strip = flat_wide_mut(&mut scratch.strip);
            let target = Target { values: &mut *strip, row, pixel: outputs };
            let packed = &self.conv.packed;
            isa.run(Layer { packed, sources, rows: 2 * rows, columns: 2 * region.width, target });
            let to = out.target(y, region.x);
            isa.run(Pool { strip, outputs, rows, columns: region.width, to });
            y += rows;
        }
        Ok(())
    }
}

/// Maximum of a strip of (2 rows, 2 columns, outputs), in the order of [`max_pool_2x2`](super::max_pool_2x2).
struct Pool<'a> {
    strip: &'a [f32],
    outputs: usize,
    rows: usize,
    columns: usize,
    to: Target<'a>,
}

impl Task for Pool<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { strip, outputs, rows, columns, to } = self;
        let row = 2 * columns * outputs;
        for y in 0..rows {
            for x in 0..columns {
                let first = 2 * y * row + 2 * x * outputs;
                let to = &mut to.values[y * to.row + x * to.pixel..];
                for c in (0..outputs).step_by(2 * LANES) {
                    let at = first + c;
                    let load = |at: usize| S::V16::load_slice(simd, &strip[at..]);
                    let above = load(at).max_or_nan(simd, load(at + outputs));
                    let below = |all: S::V16, at: usize| all.max_or_nan(simd, load(at));
                    let all = below(below(above, at + row), at + row + outputs);
                    store_some(all, &mut to[c..outputs.min(c + 2 * LANES)]);
                }
            }
        }
    }
}
