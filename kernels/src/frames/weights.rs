//! Parameters of convolutions in the layout of files, and packed for the kernels.

use crate::error::{KernelError, check, check_channels};
use crate::lanes::{LANES, Wide};

/// Outputs per block of packed weights.
pub(super) const BLOCK: usize = 2 * LANES;

/// A convolution's parameters in `PyTorch`'s layouts.
#[derive(Clone, Debug, Default)]
pub struct ConvParts {
    /// Channels of each of the 1 or 2 input maps: the layer reads their concatenation.
    pub inputs: Vec<usize>,
    /// Output channels O.
    pub outputs: usize,
    /// (O, I, rows, columns) of kernels; of a transposed convolution (I, O, rows, columns). I is
    /// the sum of `inputs`.
    pub weight: Vec<f32>,
    /// (O).
    pub bias: Option<Vec<f32>>,
    /// A batch norm y = scale x + shift after the convolution, (O) each. The weights are multiplied
    /// by the scale in f64 and rounded once, when the layer is made.
    pub norm: Option<(Vec<f32>, Vec<f32>)>,
    /// Whether a rectifier follows: y where y > 0, else +0.
    pub relu: bool,
}

/// Order of the axes of a weight tensor.
#[derive(Clone, Copy)]
pub(super) enum Layout {
    /// (O, I, places).
    OutputsFirst,
    /// (I, O, places).
    InputsFirst,
}

impl ConvParts {
    pub(super) fn channels(&self) -> usize {
        self.inputs.iter().sum()
    }

    /// Refuses sizes and tensors that do not fit a kernel of `places`.
    pub(super) fn check(&self, places: usize) -> Result<(), KernelError> {
        let found = self.inputs.len();
        if found == 0 || found > 2 {
            return Err(KernelError::Size { what: "input maps", expected: "1 or 2", found });
        }
        check_channels(&self.inputs, self.outputs)?;
        check("weight", &self.weight, self.outputs * self.channels() * places)?;
        if let Some(bias) = &self.bias {
            check("bias", bias, self.outputs)?;
        }
        if let Some((scale, shift)) = &self.norm {
            check("norm scale", scale, self.outputs)?;
            check("norm shift", shift, self.outputs)?;
        }
        Ok(())
    }

    pub(super) fn scale(&self, o: usize) -> f64 {
        self.norm.as_ref().map_or(1.0, |(scale, _)| f64::from(scale[o]))
    }

    /// The bias of output `o` after the batch norm.
    fn offset(&self, o: usize) -> f32 {
        let bias = self.bias.as_ref().map_or(0.0, |bias| f64::from(bias[o]));
        let shift = self.norm.as_ref().map_or(0.0, |(_, shift)| f64::from(shift[o]));
        (self.scale(o) * bias + shift) as f32
    }

    /// Biases of all blocks of outputs after batch norm, the last padded with zeros.
    pub(super) fn biases(&self) -> Vec<Wide> {
        let blocks = 0..self.outputs.div_ceil(BLOCK);
        blocks.map(|block| wide(self.outputs, block, |o| self.offset(o))).collect()
    }

    /// Weight of input channel `i` at `place` for output `o` after the batch norm.
    pub(super) fn weight(&self, layout: Layout, places: usize, of: [usize; 3]) -> f32 {
        self.weight_f64(layout, places, of) as f32
    }

    /// The same without rounding.
    pub(super) fn weight_f64(&self, layout: Layout, places: usize, [i, place, o]: [usize; 3]) -> f64 {
        let at = match layout {
            Layout::OutputsFirst => (o * self.channels() + i) * places + place,
            Layout::InputsFirst => (i * self.outputs + o) * places + place,
        };
        f64::from(self.weight[at]) * self.scale(o)
    }
}

/// The values of a block of outputs, padded with zeros.
fn wide(outputs: usize, block: usize, value: impl Fn(usize) -> f32) -> Wide {
    let first = block * BLOCK;
    Wide(std::array::from_fn(|lane| if first + lane < outputs { value(first + lane) } else { 0.0 }))
}

/// Weights by blocks of sixteen outputs, all rows of a block together; the last is padded with
/// zeros.
#[derive(Clone, Debug)]
pub(super) struct Packed {
    pub(super) rows: usize,
    pub(super) outputs: usize,
    pub(super) weight: Vec<Wide>,
    pub(super) bias: Vec<Wide>,
    pub(super) relu: bool,
}

impl Packed {
    pub(super) fn new(parts: &ConvParts, rows: usize, weight: impl Fn(usize, usize) -> f32) -> Self {
        let outputs = parts.outputs;
        let row = |block: usize| {
            let weight = &weight;
            (0..rows).map(move |row| wide(outputs, block, |o| weight(row, o)))
        };
        Self {
            rows,
            outputs,
            weight: (0..outputs.div_ceil(BLOCK)).flat_map(row).collect(),
            bias: parts.biases(),
            relu: parts.relu,
        }
    }

    #[inline(always)]
    pub(super) fn blocks(&self) -> usize {
        self.bias.len()
    }

    #[inline(always)]
    pub(super) fn block(&self, block: usize) -> &[Wide] {
        &self.weight[block * self.rows..][..self.rows]
    }

    /// Number of outputs in a block, without padding.
    #[inline(always)]
    pub(super) fn real(&self, block: usize) -> usize {
        (self.outputs - block * BLOCK).min(BLOCK)
    }
}
