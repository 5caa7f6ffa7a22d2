//! A 3 x 3 convolution fused with the 2 x 2 maximum that alone reads it, with their bits. The map
//! between is never written: it is four times the result, and memory limits such layers.

use super::conv::{Conv3x3, check_inputs};
use super::layer::{Layer, PAIR, sources};
use super::shape::Region;
use super::view::{Band, View};
use crate::error::KernelError;
use crate::isa::Isa;
use crate::lanes::Wide;

/// The fused layers.
#[derive(Clone, Debug)]
pub struct PooledConv3x3 {
    conv: Conv3x3,
}

/// Working space for half of a row of outputs; grows to the need of the largest layer.
#[derive(Clone, Debug, Default)]
pub struct PooledScratch {
    halves: Vec<Wide>,
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

    /// Most bytes of scratch for a map whose rows have `width` pooled outputs, on one thread.
    pub fn scratch_bytes(width: usize) -> u128 {
        (PAIR * size_of::<Wide>()) as u128 * width as u128
    }

    /// Computes the pooled outputs of `region` alone. Input maps have a halo of at least 1 and
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
        let halves = PAIR * region.width;
        scratch.halves.resize(scratch.halves.len().max(halves), Wide::ZERO);
        isa.run(Layer {
            packed: &self.conv.packed,
            sources: sources(inputs, 3, 1, [2 * region.y, 2 * region.x]),
            rows: 2 * region.height,
            columns: 2 * region.width,
            target: out.target(region.y, region.x),
            halves: Some(&mut scratch.halves),
        });
        Ok(())
    }
}
