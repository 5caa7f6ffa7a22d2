//! The loop of all direct convolutions: sums over places of one or two maps, for a rectangle of
//! outputs or for the maximum of each 2 x 2 of them.
//!
//! y(o) = relu(b(o) + sum over maps, places, channels of x W(o)), a chain from the bias, each
//! product rounded once with its sum. A tile of positions shares each loaded weight. The weights of
//! a block of 32 (or 16) outputs stay in the second-level cache for a strip of rows, and the strip
//! stays there for all blocks. Meanwhile a tile's outputs and the values that only the next tile
//! reads are prefetched, a few lines at a time: many at once would delay the weights.

use std::ops::Range;

use crate::frames::feature_map::{Target, View};
use crate::frames::weights::{BLOCK, Packed};
use crate::isa::{Simd, Task, Vector, accumulate, prefetch};
use crate::lanes::Wide;

/// Number of values of a strip of rows, inputs and outputs.
const STRIP: usize = 1 << 16;

/// Number of products per output from which a tile takes long enough to prefetch lines. Chosen by
/// measurement.
const LONG: usize = 64;

const PLACES: usize = 9;

/// The values of one map that a rectangle of outputs reads.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    values: &'a [f32],
    /// Starts for the first output; only the first `runs` are valid.
    starts: [usize; PLACES],
    runs: usize,
    count: usize,
    /// The kernel's last place for the first output, and its channels.
    last: usize,
    channels: usize,
    row: usize,
    pixel: usize,
}

impl<'a> Source<'a> {
    /// A kernel of `size` x `size` places, at the stored pixel (y, x) for the first output.
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
        let (runs, channels, last) = (size * columns, view.channels, first + (size - 1) * (row + pixel));
        Self { values: view.values, starts, runs, count, last, channels, row, pixel }
    }
}

/// The [`Source`]s of a `size` x `size` kernel that begins `padding` pixels before (y, x).
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

pub(super) struct Layer<'a> {
    pub(super) packed: &'a Packed,
    pub(super) sources: [Option<Source<'a>>; 2],
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) target: Target<'a>,
    /// If present, the target gets the maximum of each 2 x 2 outputs, in the order of
    /// [`max_pool_2x2`](super::max_pool_2x2). It has room for the larger of each two outputs of an
    /// upper row, for [`PAIR`] blocks of two columns. The numbers of rows and columns are then
    /// even.
    pub(super) halves: Option<&'a mut [Wide]>,
}

/// Largest number of blocks of outputs that are computed together.
pub(super) const PAIR: usize = 2;

impl Task for Layer<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        // The decision is made here: if a tile made it, its sums would be in memory instead of
        // registers.
        if self.halves.is_some() {
            self.strips::<S, true>(simd);
        } else {
            self.strips::<S, false>(simd);
        }
    }
}

impl Layer<'_> {
    #[inline(always)]
    fn strips<S: Simd, const POOL: bool>(&mut self, simd: S) {
        let row = self.sources.iter().flatten().map(|source| source.row).sum::<usize>() + self.target.row;
        // Whole pairs of rows.
        let strip = (STRIP / row.max(1) / 2 * 2).max(2);
        for first in (0..self.rows).step_by(strip) {
            let rows = first..self.rows.min(first + strip);
            let mut block = 0;
            while S::WIDE && block + PAIR <= self.packed.blocks() {
                simd.apart(Strip::<PAIR, POOL> { layer: self, block, rows: rows.clone() });
                block += PAIR;
            }
            while block < self.packed.blocks() {
                simd.apart(Strip::<1, POOL> { layer: self, block, rows: rows.clone() });
                block += 1;
            }
        }
    }
}

/// B blocks of outputs of a strip of rows. Run it [as a separate function](Simd::apart): the
/// time to compile a function grows faster than its size.
struct Strip<'a, 'b, const B: usize, const POOL: bool> {
    layer: &'b mut Layer<'a>,
    block: usize,
    rows: Range<usize>,
}

impl<const B: usize, const POOL: bool> Task for Strip<'_, '_, B, POOL> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { layer, block, rows } = self;
        for y in rows {
            let mut row = Row::<S, B, POOL> {
                simd,
                packed: layer.packed,
                weights: std::array::from_fn(|b| layer.packed.block(block + b)),
                block,
                sources: &layer.sources,
                y,
                out: &mut layer.target.values[y / Row::<S, B, POOL>::UNIT * layer.target.row..],
                pixel: layer.target.pixel,
                halves: layer.halves.as_deref_mut().unwrap_or_default(),
            };
            in_tiles::<S, _>(layer.columns, &mut row);
        }
    }
}

struct Row<'a, S, const B: usize, const POOL: bool> {
    simd: S,
    packed: &'a Packed,
    weights: [&'a [Wide]; B],
    block: usize,
    sources: &'a [Option<Source<'a>>; 2],
    y: usize,
    out: &'a mut [f32],
    pixel: usize,
    halves: &'a mut [Wide],
}

impl<S: Simd, const B: usize, const POOL: bool> Tiles for Row<'_, S, B, POOL> {
    const UNIT: usize = if POOL { 2 } else { 1 };

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
            let next = source.last + at + R * source.pixel;
            for (t, start) in source.starts[..source.runs].iter().enumerate() {
                let share = if self.packed.rows < LONG {
                    0..0
                } else {
                    R * t / source.runs..R * (t + 1) / source.runs
                };
                for r in share {
                    let next = next + r * source.pixel;
                    prefetch(source.values.get(next..next + source.channels).unwrap_or_default());
                    let out = (first + r) / Self::UNIT * self.pixel + self.block * BLOCK;
                    prefetch(self.out.get(out..out + B * BLOCK).unwrap_or_default());
                }
                let weights = self.weights.map(|w| &w[row..][..source.count]);
                let values = &source.values[start + at..];
                accumulate::<_, _, R, B, 0, 1>(simd, &mut acc, values, source.pixel, weights);
                row += source.count;
            }
        }
        if POOL {
            let (mut sums, mut x) = (acc.into_iter(), first / 2);
            while let (Some(left), Some(right)) = (sums.next(), sums.next()) {
                self.pool(x, left, right);
                x += 1;
            }
        } else {
            for (r, sums) in acc.into_iter().enumerate() {
                for (b, sum) in sums.into_iter().enumerate() {
                    self.store((first + r) * self.pixel, b, self.output(sum));
                }
            }
        }
    }
}

impl<S: Simd, const B: usize, const POOL: bool> Row<'_, S, B, POOL> {
    #[inline(always)]
    fn output(&self, sum: S::V16) -> S::V16 {
        let zero = S::V16::splat(self.simd, 0.0);
        let y = sum.add(zero);
        if self.packed.relu { y.max(zero) } else { y }
    }

    /// Writes block b of the outputs of the pixel at `pixel`.
    #[inline(always)]
    fn store(&mut self, pixel: usize, b: usize, y: S::V16) {
        let at = pixel + (self.block + b) * BLOCK;
        store_some(y, &mut self.out[at..][..self.packed.real(self.block + b)]);
    }

    /// Keeps the larger of columns 2 x and 2 x + 1, or writes the maximum with the kept ones of the
    /// row above.
    #[inline(always)]
    fn pool(&mut self, x: usize, left: [S::V16; B], right: [S::V16; B]) {
        let simd = self.simd;
        for b in 0..B {
            let (left, right) = (self.output(left[b]), self.output(right[b]));
            let half = &mut self.halves[x * PAIR + b];
            if self.y.is_multiple_of(2) {
                left.max_or_nan(simd, right).store(half);
            } else {
                let above = S::V16::load(simd, half);
                self.store(x * self.pixel, b, above.max_or_nan(simd, left).max_or_nan(simd, right));
            }
        }
    }
}

/// Work on R adjacent positions at a time.
pub(super) trait Tiles {
    /// Number of positions that become one output, 1 or 2: a tile has whole ones.
    const UNIT: usize = 1;

    /// Positions `first..first + R`.
    fn tile<const R: usize>(&mut self, first: usize);
}

/// Positions of the largest tile on any instruction set.
pub(super) const MAX: usize = 14;

/// Positions of the largest tile on this instruction set.
#[inline(always)]
pub(super) fn most<S: Simd>() -> usize {
    if S::WIDE { MAX } else { 6 }
}

/// Covers `count` positions with the fewest tiles, nearly equal.
#[inline(always)]
pub(super) fn in_tiles<S: Simd, W: Tiles>(count: usize, work: &mut W) {
    let tiles = count.div_ceil(most::<S>());
    let mut first = 0;
    for t in 0..tiles {
        let end = (t + 1) * (count / W::UNIT) / tiles * W::UNIT;
        // Sizes that do not occur are not compiled: the conditions are known.
        match end - first {
            1 if W::UNIT == 1 => work.tile::<1>(first),
            2 => work.tile::<2>(first),
            3 if W::UNIT == 1 => work.tile::<3>(first),
            4 => work.tile::<4>(first),
            5 if W::UNIT == 1 => work.tile::<5>(first),
            6 => work.tile::<6>(first),
            7 if S::WIDE && W::UNIT == 1 => work.tile::<7>(first),
            8 if S::WIDE => work.tile::<8>(first),
            9 if S::WIDE && W::UNIT == 1 => work.tile::<9>(first),
            10 if S::WIDE => work.tile::<10>(first),
            11 if S::WIDE && W::UNIT == 1 => work.tile::<11>(first),
            12 if S::WIDE => work.tile::<12>(first),
            13 if S::WIDE && W::UNIT == 1 => work.tile::<13>(first),
            14 if S::WIDE => work.tile::<14>(first),
            _ => unreachable!("a tile has at most `most` positions, and whole outputs"),
        }
        first = end;
    }
}

/// Writes as many of a vector's values as fit in `to`.
#[inline(always)]
pub(super) fn store_some<S: Simd, V: Vector<S>>(values: V, to: &mut [f32]) {
    if to.len() >= V::LANES {
        values.store_slice(to);
    } else {
        let mut whole = V::ZEROS;
        values.store(&mut whole);
        to.copy_from_slice(&whole.as_mut()[..to.len()]);
    }
}
