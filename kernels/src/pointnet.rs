//! `PointNet` convolution of one row: maximum over in-edges and the row, batch norm, skip
//! (`PointNet++`, Qi et al. 2017, with one linear layer; on events `EvGNN`, Yang et al. 2024).
//!
//! Row i has in-edges e = 1..n from rows j(e) with offsets d(e) = (`p_j` - `p_i`) / s; the row
//! itself has d = 0:
//!
//! ```text
//! a(e,o) = b(o) + sum over c ascending of x(j,c) W(o,c), then over x, y, t of d(e) W(o,C + axis)
//! y(o)   = max(0, a(0,o), a(1,o), ..., a(n,o)) scale(o) + shift(o)  (+ skip)
//! ```
//!
//! a is one chain: each product is rounded once with the sum, as is the product with scale. `ReLU`
//! is the 0 in the maximum, so the order of edges and their tiles does not matter. If any a(e,o) is
//! NaN, so is y(o).

use crate::error::{KernelError, check, check_channels};
use crate::graph::{GraphRow, Neighbour};
use crate::isa::{Isa, Simd, Task, Vector, accumulate, flat, flat_mut};
use crate::lanes::{LANES, Lanes};
use crate::matrix::Matrix;
use crate::packed::{Affine, Packed};

const AXES: usize = 3;
/// Largest number of edges that share each loaded weight.
const TILE: usize = 8;

/// Parameters of a `PointNet` block in `PyTorch`'s layouts.
#[derive(Clone, Debug, Default)]
pub struct PointNetParts {
    /// C, input channels.
    pub inputs: usize,
    /// O, output channels.
    pub outputs: usize,
    /// (O, C + 3), as in a linear layer: for the channels, then for the offset along x, y and t.
    pub weight: Vec<f32>,
    /// (O).
    pub bias: Vec<f32>,
    /// Batch norm with running statistics, folded into a factor (O) and a shift (O).
    pub norm: Option<(Vec<f32>, Vec<f32>)>,
}

/// A `PointNet` block, ready to run.
#[derive(Clone, Debug)]
pub struct PointNetConv {
    inputs: usize,
    outputs: usize,
    /// (C + 3, O).
    weight: Packed,
    affine: Affine,
}

/// Working space of [`PointNetConv::rows`]; grows to the widest block seen and is reused.
#[derive(Clone, Debug, Default)]
pub struct PointNetScratch {
    /// Channels and offset of each of a tile's edges, one edge after the other.
    values: Vec<f32>,
}

impl PointNetScratch {
    /// Working space for all of `convs`: nothing is allocated later.
    pub fn new<'a>(convs: impl Iterator<Item = &'a PointNetConv>) -> Self {
        Self { values: vec![0.0; Self::values(convs)] }
    }

    /// Bytes that [`Self::new`] allocates.
    pub fn bytes<'a>(convs: impl Iterator<Item = &'a PointNetConv>) -> usize {
        Self::values(convs) * size_of::<f32>()
    }

    fn values<'a>(convs: impl Iterator<Item = &'a PointNetConv>) -> usize {
        convs.map(|conv| TILE * (conv.inputs + AXES)).max().unwrap_or(0)
    }
}

impl PointNetConv {
    /// Checks and packs `parts`.
    ///
    /// # Errors
    /// A bad size ([`crate::SplineConv::MAX_CHANNELS`]) or length, or a value that is not finite.
    pub fn new(parts: &PointNetParts) -> Result<Self, KernelError> {
        let PointNetParts { inputs, outputs, .. } = *parts;
        check_channels(&[inputs], outputs)?;
        check("weight", &parts.weight, outputs * (inputs + AXES))?;
        let affine = Affine::new(&parts.bias, parts.norm.as_ref(), outputs)?;
        Ok(Self { inputs, outputs, weight: Packed::transposed(&parts.weight, outputs), affine })
    }

    /// The parameters in `PyTorch`'s layouts: a block made from them computes the same bits.
    /// Without a norm, an identity norm. O(parameters).
    pub fn parts(&self) -> PointNetParts {
        let Self { inputs, outputs, ref weight, ref affine } = *self;
        let (bias, norm) = affine.unpacked(outputs);
        PointNetParts { inputs, outputs, weight: weight.untransposed(outputs), bias, norm: Some(norm) }
    }

    /// C, input channels.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// O, output channels.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Multiply-adds of one row with `degree` in-edges.
    pub fn multiply_adds(&self, degree: usize) -> usize {
        pointnet_multiply_adds(self.inputs, self.outputs, degree)
    }

    /// Computes rows, each as if it were alone.
    ///
    /// `features` is (rows, C); `out` holds the rows' O values in lanes, one row after the other.
    ///
    /// # Panics
    /// If a row or a slice does not have the sizes of this block, or an in-edge has no offset.
    pub fn rows(
        &self,
        isa: Isa,
        features: &Matrix,
        rows: &[GraphRow<'_>],
        scratch: &mut PointNetScratch,
        out: &mut [Lanes],
    ) {
        isa.run(Run { conv: self, features, rows, scratch, out });
    }
}

/// Multiply-adds of one row of a `PointNet` block with `degree` in-edges. Saturates.
pub fn pointnet_multiply_adds(inputs: usize, outputs: usize, degree: usize) -> usize {
    degree.saturating_add(1).saturating_mul(inputs.saturating_add(AXES)).saturating_mul(outputs)
}

struct Run<'a> {
    conv: &'a PointNetConv,
    features: &'a Matrix,
    rows: &'a [GraphRow<'a>],
    scratch: &'a mut PointNetScratch,
    out: &'a mut [Lanes],
}

impl Task for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { conv, features, rows, scratch: PointNetScratch { values }, out } = self;
        let lanes = conv.affine.bias.len();
        assert_eq!(features.columns(), conv.inputs, "features must have the block's input channels");
        assert_eq!(out.len(), rows.len() * lanes, "the output must have the block's output channels");
        values.resize(values.len().max(TILE * (conv.inputs + AXES)), 0.0);
        for (row, out) in rows.iter().zip(out.chunks_mut(lanes)) {
            conv.row(simd, features, row, values, out);
        }
    }
}

impl PointNetConv {
    #[inline(always)]
    fn row<S: Simd>(
        &self,
        simd: S,
        features: &Matrix,
        row: &GraphRow<'_>,
        values: &mut [f32],
        out: &mut [Lanes],
    ) {
        let GraphRow { neighbours, offsets, own, .. } = *row;
        assert_eq!(neighbours.len(), offsets.len(), "every in-edge must have an offset");
        out.fill(Lanes::ZERO);
        self.gather(values, flat(own), [0.0; AXES]);
        // The row itself is the first edge of the first tile.
        let (mut edge, mut held) = (0, 1);
        loop {
            let most = if S::WIDE && held + neighbours.len() - edge > TILE / 2 { TILE } else { TILE / 2 };
            while held < most && edge < neighbours.len() {
                let Neighbour { row, .. } = neighbours[edge];
                let at = &mut values[held * (self.inputs + AXES)..];
                self.gather(at, flat(features.row(row as usize)), offsets[edge]);
                (edge, held) = (edge + 1, held + 1);
            }
            if most == TILE {
                self.tile::<S, TILE>(simd, values, held, out);
            } else {
                self.tile::<S, { TILE / 2 }>(simd, values, held, out);
            }
            held = 0;
            if edge == neighbours.len() {
                break;
            }
        }
        self.finish(simd, row.skip, out);
    }

    /// Copies the inputs of one edge: C channels of its source row, and its offset.
    #[inline(always)]
    fn gather(&self, values: &mut [f32], row: &[f32], offset: [f32; AXES]) {
        values[..self.inputs].copy_from_slice(&row[..self.inputs]);
        values[self.inputs..][..AXES].copy_from_slice(&offset);
    }

    /// Merges the first `held` edges of a tile of R into the maxima in `out`.
    #[inline(always)]
    fn tile<S: Simd, const R: usize>(&self, simd: S, values: &[f32], held: usize, out: &mut [Lanes]) {
        let mut lane = 0;
        while lane + 2 <= self.affine.bias.len() {
            self.block::<S, S::V16, R>(simd, values, held, self.weight.wide(lane), lane, out);
            lane += 2;
        }
        if lane < self.affine.bias.len() {
            self.block::<S, S::V8, R>(simd, values, held, self.weight.last(), lane, out);
        }
    }

    /// Computes the outputs of one vector, from lane `lane`.
    #[inline(always)]
    fn block<S: Simd, V: Vector<S>, const R: usize>(
        &self,
        simd: S,
        values: &[f32],
        held: usize,
        weight: &[V::Memory],
        lane: usize,
        out: &mut [Lanes],
    ) {
        let mut sums = [[V::load_slice(simd, &flat(&self.affine.bias)[lane * LANES..])]; R];
        accumulate::<S, V, R, 1, 0, 1>(simd, &mut sums, values, self.inputs + AXES, [weight]);
        let out = &mut flat_mut(out)[lane * LANES..];
        let mut most = V::load_slice(simd, out);
        for [sum] in &sums[..held] {
            most = most.max_or_nan(simd, *sum);
        }
        most.store_slice(out);
    }

    #[inline(always)]
    fn finish<S: Simd>(&self, simd: S, skip: Option<&[Lanes]>, out: &mut [Lanes]) {
        for (lane, out) in out.iter_mut().enumerate() {
            let load = |lanes: &[Lanes]| S::V8::load(simd, &lanes[lane]);
            let mut y =
                load(&self.affine.shift).add_product(S::V8::load(simd, out), load(&self.affine.scale));
            if let Some(skip) = skip {
                y = y.add(load(skip));
            }
            y.store(out);
        }
    }
}
