//! Parameters packed for kernels whose vectors run over outputs.

use crate::error::{KernelError, check};
use crate::isa::flat;
use crate::lanes::{LANES, Lanes, Wide};

/// Weights (I, O) by blocks of sixteen outputs, all rows of a block together; a remainder of at
/// most eight is a block of single lanes.
#[derive(Clone, Debug)]
pub(crate) struct Packed {
    rows: usize,
    wide: Vec<Wide>,
    last: Vec<Lanes>,
}

impl Packed {
    /// Packs `weight`, rows of `outputs` values.
    pub(crate) fn new(weight: &[f32], outputs: usize) -> Self {
        let (rows, lanes) = (weight.len() / outputs, Lanes::count(outputs));
        let (mut wide, mut last) = (vec![Wide::ZERO; lanes / 2 * rows], vec![Lanes::ZERO; lanes % 2 * rows]);
        for (r, row) in weight.chunks_exact(outputs).enumerate() {
            for (block, values) in row.chunks(2 * LANES).enumerate() {
                let to =
                    if values.len() > LANES { &mut wide[block * rows + r].0[..] } else { &mut last[r].0 };
                to[..values.len()].copy_from_slice(values);
            }
        }
        Self { rows, wide, last }
    }

    /// Packs `weight`, (O, I) as in a linear layer.
    pub(crate) fn transposed(weight: &[f32], outputs: usize) -> Self {
        Self::new(&transpose(weight, weight.len() / outputs), outputs)
    }

    /// The weights as in a linear layer, (O, I).
    pub(crate) fn untransposed(&self, outputs: usize) -> Vec<f32> {
        transpose(&self.unpacked(outputs), outputs)
    }

    /// The weights in their original layout: rows of `outputs` values.
    pub(crate) fn unpacked(&self, outputs: usize) -> Vec<f32> {
        let blocks = Lanes::count(outputs) / 2;
        let value = |row: usize, o: usize| match o / (2 * LANES) {
            block if block < blocks => self.wide[block * self.rows + row].0[o % (2 * LANES)],
            _ => self.last[row].0[o % LANES],
        };
        (0..self.rows).flat_map(|row| (0..outputs).map(move |o| value(row, o))).collect()
    }

    /// All rows of the sixteen outputs from lane `lane`, which is even.
    #[inline(always)]
    pub(crate) fn wide(&self, lane: usize) -> &[Wide] {
        &self.wide[lane / 2 * self.rows..][..self.rows]
    }

    /// All rows of the outputs of a single last lane.
    #[inline(always)]
    pub(crate) fn last(&self) -> &[Lanes] {
        &self.last
    }
}

/// Turns rows of `columns` values into columns.
fn transpose(values: &[f32], columns: usize) -> Vec<f32> {
    let mut turned = Vec::with_capacity(values.len());
    for column in 0..columns {
        turned.extend(values.iter().skip(column).step_by(columns));
    }
    turned
}

/// Bias and batch norm after a graph convolution, one value per output.
#[derive(Clone, Debug)]
pub(crate) struct Affine {
    pub(crate) bias: Vec<Lanes>,
    pub(crate) scale: Vec<Lanes>,
    pub(crate) shift: Vec<Lanes>,
}

impl Affine {
    /// Checks and packs a bias and a norm of `outputs` values; without a norm, the identity.
    /// Errors: a tensor of the wrong length, or a value that is not finite.
    pub(crate) fn new(
        bias: &[f32],
        norm: Option<&(Vec<f32>, Vec<f32>)>,
        outputs: usize,
    ) -> Result<Self, KernelError> {
        let identity = (vec![1.0; outputs], vec![0.0; outputs]);
        let (scale, shift) = norm.unwrap_or(&identity);
        check("bias", bias, outputs)?;
        check("batch norm scale", scale, outputs)?;
        check("batch norm shift", shift, outputs)?;
        Ok(Self { bias: Lanes::pack(bias), scale: Lanes::pack(scale), shift: Lanes::pack(shift) })
    }

    /// The bias and the norm, of `outputs` values each.
    pub(crate) fn unpacked(&self, outputs: usize) -> (Vec<f32>, (Vec<f32>, Vec<f32>)) {
        let values = |lanes: &[Lanes]| flat(lanes)[..outputs].to_vec();
        (values(&self.bias), (values(&self.scale), values(&self.shift)))
    }
}
