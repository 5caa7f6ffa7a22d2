//! The loop of all direct convolutions: sums over some places of one or two maps, for a rectangle of outputs.
//!
//! y(o) = relu(b(o) + sum over maps, places, channels of x W(o)), one chain of sums from the bias, each product rounded
//! once with its sum. Blocks of 32 (or 16) outputs are outermost, so that their weights stay in the second-level cache
//! during the loop over positions; a tile of positions shares each loaded weight.

use super::tiles::{Tiles, in_tiles, store_some};
use super::view::{Target, View};
use super::weights::{BLOCK, Packed};
use crate::isa::{Runs, Simd, Task, Vector, accumulate_runs};
use crate::lanes::Wide;

/// Largest number of places of a kernel.
const PLACES: usize = 9;

/// The values of one map that a rectangle of outputs reads.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    values: &'a [f32],
    /// Starts for the first output; only the first `runs` are valid.
    starts: [usize; PLACES],
    runs: usize,
    count: usize,
    row: usize,
    pixel: usize,
}

impl<'a> Source<'a> {
    /// A kernel of `size` x `size` places whose first place is the stored pixel (y, x) for the first output.
    fn new(view: View<'a>, size: usize, y: usize, x: usize) -> Self {
        let (row, pixel) = (view.shape.row(), view.shape.channels);
        // If the places of a kernel row are contiguous, they form one run.
        let dense = pixel == view.channels;
        let (columns, count) = if dense { (1, size * pixel) } else { (size, view.channels) };
        let first = view.shape.stored(y, x) + view.first;
        let mut starts = [0; PLACES];
        for (i, start) in starts.iter_mut().enumerate().take(size * columns) {
            *start = first + i / columns * row + i % columns * pixel;
        }
        Self { values: view.values, starts, runs: size * columns, count, row, pixel }
    }
}

/// The [`Source`]s of a kernel of `size` x `size` places that begins `padding` pixels before pixel (y, x).
pub(super) fn sources<'a>(
    inputs: &[View<'a>],
    size: usize,
    padding: usize,
    [y, x]: [usize; 2],
) -> [Option<Source<'a>>; 2] {
    std::array::from_fn(|m| {
        let view = inputs.get(m)?;
        let margin = view.shape.halo - padding;
        Some(Source::new(*view, size, y + margin, x + margin))
    })
}

/// A rectangle of outputs.
pub(super) struct Layer<'a> {
    pub(super) packed: &'a Packed,
    pub(super) sources: [Option<Source<'a>>; 2],
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) target: Target<'a>,
}

impl Task for Layer<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let mut block = 0;
        while S::WIDE && block + 2 <= self.packed.blocks() {
            self.block::<S, 2>(simd, block);
            block += 2;
        }
        while block < self.packed.blocks() {
            self.block::<S, 1>(simd, block);
            block += 1;
        }
    }
}

impl Layer<'_> {
    /// All positions of B blocks of outputs.
    #[inline(always)]
    fn block<S: Simd, const B: usize>(&mut self, simd: S, block: usize) {
        for y in 0..self.rows {
            let mut row = Row::<S, B> {
                simd,
                packed: self.packed,
                weights: std::array::from_fn(|b| self.packed.block(block + b)),
                block,
                sources: &self.sources,
                y,
                out: &mut self.target.values[y * self.target.row..],
                pixel: self.target.pixel,
            };
            in_tiles::<S>(self.columns, &mut row);
        }
    }
}

/// One row of positions.
struct Row<'a, S, const B: usize> {
    simd: S,
    packed: &'a Packed,
    weights: [&'a [Wide]; B],
    block: usize,
    sources: &'a [Option<Source<'a>>; 2],
    y: usize,
    out: &'a mut [f32],
    pixel: usize,
}

impl<S: Simd, const B: usize> Tiles for Row<'_, S, B> {
    #[inline(always)]
    fn tile<const R: usize>(&mut self, first: usize) {
        let simd = self.simd;
        let mut bias = [S::V16::splat(simd, 0.0); B];
        for (b, bias) in bias.iter_mut().enumerate() {
            *bias = S::V16::load(simd, &self.packed.bias[self.block + b]);
        }
        let mut acc = [bias; R];
        let mut row = 0;
        for source in self.sources.iter().flatten() {
            let at = self.y * source.row + first * source.pixel;
            let starts = source.starts.map(|start| start + at);
            let starts = &starts[..source.runs];
            let runs = Runs { values: source.values, starts, count: source.count, stride: source.pixel };
            let rows = source.runs * source.count;
            accumulate_runs(simd, &mut acc, runs, self.weights.map(|w| &w[row..][..rows]));
            row += rows;
        }
        let zero = S::V16::splat(simd, 0.0);
        for (r, sums) in acc.into_iter().enumerate() {
            for (b, sum) in sums.into_iter().enumerate() {
                let sum = sum.add(zero);
                let y = if self.packed.relu { sum.max(zero) } else { sum };
                let at = (first + r) * self.pixel + (self.block + b) * BLOCK;
                store_some(y, &mut self.out[at..][..self.packed.real(self.block + b)]);
            }
        }
    }
}
