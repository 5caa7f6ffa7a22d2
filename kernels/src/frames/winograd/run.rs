//! Computes the tiles of a region in batches: transforms their inputs, multiplies, transforms back.

use std::marker::PhantomData;

use crate::frames::feature_map::{Target, View};
use crate::frames::layer::{MAX, Tiles, in_tiles, most, store_some};
use crate::frames::room;
use crate::frames::shape::Region;
use crate::frames::weights::{BLOCK, Packed};
use crate::isa::{Simd, Task, Vector, accumulate_wide, flat_wide_mut};
use crate::lanes::Wide;

/// Limit in bytes of a batch's transformed inputs and sums: part of the second-level cache.
const AT_HAND: usize = 1 << 19;

/// Largest number of blocks of outputs that are computed at once.
const BLOCKS: usize = 2;

/// Working space of convolutions; grows to the need of the largest layer and is reused.
#[derive(Clone, Debug, Default)]
pub struct ConvScratch {
    /// One patch of inputs that extends beyond the map.
    patch: Vec<Wide>,
    /// Transformed inputs: places, tiles, channels.
    inputs: Vec<Wide>,
    /// Sums: places, tiles, outputs of a block.
    sums: Vec<Wide>,
}

impl ConvScratch {
    /// Room for the layers that need no more bytes of each part: their runs allocate nothing.
    pub fn with_bytes([patch, inputs, sums]: [u128; 3]) -> Self {
        Self { patch: room(patch), inputs: room(inputs), sums: room(sums) }
    }
}

pub(super) struct Job<'a, T, const N: usize> {
    packed: &'a Packed,
    inputs: &'a [View<'a>],
    channels: usize,
    region: Region,
    target: Target<'a>,
    scratch: &'a mut ConvScratch,
    columns: usize,
    transform: PhantomData<T>,
}

/// Layout of one place for a batch of tiles: the first vector of each tile, then the second of
/// each, and so on, plus one vector: otherwise places would be whole pages apart and compete for
/// cache lines.
#[derive(Clone, Copy)]
struct Plane {
    tiles: usize,
    /// Distance between places in vectors.
    place: usize,
}

impl Plane {
    fn new(tiles: usize, vectors: usize) -> Self {
        Self { tiles, place: tiles * vectors + 1 }
    }
}

impl<'a, T: Transform<N>, const N: usize> Job<'a, T, N> {
    pub(super) fn new(
        packed: &'a Packed,
        inputs: &'a [View<'a>],
        region: Region,
        target: Target<'a>,
        scratch: &'a mut ConvScratch,
    ) -> Self {
        let columns = region.width.div_ceil(T::OUT);
        let channels = inputs.iter().map(|view| view.channels).sum();
        Self { packed, inputs, channels, region, target, scratch, columns, transform: PhantomData }
    }
}

impl<T: Transform<N>, const N: usize> Task for Job<'_, T, N> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let tiles = self.columns * self.region.height.div_ceil(T::OUT);
        let vectors: usize = self.inputs.iter().map(|view| view.channels.div_ceil(BLOCK)).sum();
        let blocks = if S::WIDE { BLOCKS } else { 1 };
        let bytes = N * N * size_of::<Wide>() * (vectors + blocks);
        let at_hand = (AT_HAND / bytes / most::<S>()).max(1) * most::<S>();
        // Batches of nearly equal size, so that no batch is too small to share the loaded weights.
        let at_hand = tiles.div_ceil(tiles.div_ceil(at_hand));
        let inputs = Plane::new(at_hand, vectors);
        let sums = Plane::new(at_hand, blocks);
        grow(&mut self.scratch.inputs, N * N * inputs.place);
        grow(&mut self.scratch.sums, N * N * sums.place);
        let mut first = 0;
        while first < tiles {
            let count = at_hand.min(tiles - first);
            for t in 0..count {
                self.read(simd, first + t, t, inputs);
            }
            let mut block = 0;
            while block < self.packed.blocks() {
                let end = if S::WIDE && block + 2 <= self.packed.blocks() {
                    self.multiply::<S, 2>(simd, block, count, inputs, sums);
                    block + 2
                } else {
                    self.multiply::<S, 1>(simd, block, count, inputs, sums);
                    block + 1
                };
                for t in 0..count {
                    for b in block..end {
                        self.write(simd, first + t, b, (b - block) * sums.tiles + t, sums.place);
                    }
                }
                block = end;
            }
            first += count;
        }
    }
}

impl<T: Transform<N>, const N: usize> Job<'_, T, N> {
    /// B^t d B of tile `tile`, number `t` of the batch.
    #[inline(always)]
    fn read<S: Simd>(&mut self, simd: S, tile: usize, t: usize, plane: Plane) {
        let ConvScratch { patch, inputs: planes, .. } = &mut *self.scratch;
        let (y, x) =
            (self.region.y + tile / self.columns * T::OUT, self.region.x + tile % self.columns * T::OUT);
        let mut to = t;
        for view in self.inputs {
            let halo = view.shape.halo;
            // Number of stored rows and columns from the first place on.
            let (y, x) = (y + halo - 1, x + halo - 1);
            let rows = (view.shape.height + 2 * halo - y).min(N);
            let columns = (view.shape.width + 2 * halo - x).min(N);
            let from = view.shape.stored(y, x) + view.first;
            let (row, pixel) = (view.shape.row(), view.shape.channels);
            let grid = if rows == N && columns == N {
                Grid { values: &view.values[from..], row, pixel }
            } else {
                let stride = view.channels.next_multiple_of(BLOCK);
                grow(patch, N * N * stride / BLOCK);
                let patch = flat_wide_mut(patch);
                patch[..N * N * stride].fill(0.0);
                for r in 0..rows {
                    for c in 0..columns {
                        patch[(r * N + c) * stride..][..view.channels]
                            .copy_from_slice(&view.values[from + r * row + c * pixel..][..view.channels]);
                    }
                }
                Grid { values: patch, row: N * stride, pixel: stride }
            };
            transform_inputs::<S, T, N>(simd, grid, view.channels, &mut planes[to..], plane);
            to += view.channels.div_ceil(BLOCK) * plane.tiles;
        }
    }

    /// Sums of B blocks for `count` tiles.
    #[inline(always)]
    fn multiply<S: Simd, const B: usize>(
        &mut self,
        simd: S,
        block: usize,
        count: usize,
        inputs: Plane,
        sums: Plane,
    ) {
        let mut weights: [&[Wide]; B] = [&[]; B];
        for (b, weights) in weights.iter_mut().enumerate() {
            *weights = self.packed.block(block + b);
        }
        for place in 0..N * N {
            simd.apart(Product {
                values: &self.scratch.inputs[place * inputs.place..][..inputs.place],
                tiles: inputs.tiles,
                count,
                maps: self.inputs,
                weights: part(weights, place * self.channels, self.channels),
                out: &mut self.scratch.sums[place * sums.place..][..sums.place],
            });
        }
    }

    /// A^t m A of `tile`, with bias and rectifier; m starts at `from`, places are `step` apart.
    #[inline(always)]
    fn write<S: Simd>(&mut self, simd: S, tile: usize, block: usize, from: usize, step: usize) {
        let sums = &self.scratch.sums[from..][..=(N * N - 1) * step];
        let zero = S::V16::splat(simd, 0.0);
        let mut half = [[zero; N]; N];
        for c in 0..N {
            let mut column = [zero; N];
            for (r, value) in column.iter_mut().enumerate() {
                *value = S::V16::load(simd, &sums[(r * N + c) * step]);
            }
            for (half, value) in half.iter_mut().zip(T::output(simd, column)) {
                half[c] = value;
            }
        }
        let bias = S::V16::load(simd, &self.packed.bias[block]);
        let (y, x) = (tile / self.columns * T::OUT, tile % self.columns * T::OUT);
        let columns = (self.region.width - x).min(T::OUT);
        let rows = (self.region.height - y).min(T::OUT);
        for (r, &half) in half.iter().enumerate().take(rows) {
            let row = T::output(simd, half);
            let at = (y + r) * self.target.row + x * self.target.pixel + block * BLOCK;
            for (c, &sum) in row.iter().enumerate().take(columns) {
                let sum = sum.add(bias);
                let sum = sum.add(zero);
                let sum = if self.packed.relu { sum.max(zero) } else { sum };
                let to = &mut self.target.values[at + c * self.target.pixel..];
                store_some(sum, &mut to[..self.packed.real(block)]);
            }
        }
    }
}

/// N x N pixels in memory.
#[derive(Clone, Copy)]
struct Grid<'a> {
    values: &'a [f32],
    row: usize,
    pixel: usize,
}

/// B^t d B of all channels of a patch.
#[inline(always)]
fn transform_inputs<S: Simd, T: Transform<N>, const N: usize>(
    simd: S,
    grid: Grid<'_>,
    channels: usize,
    out: &mut [Wide],
    plane: Plane,
) {
    let zero = S::V16::splat(simd, 0.0);
    for vector in 0..channels.div_ceil(BLOCK) {
        let mut half = [[zero; N]; N];
        for c in 0..N {
            let mut column = [zero; N];
            for (r, value) in column.iter_mut().enumerate() {
                let at = r * grid.row + c * grid.pixel + vector * BLOCK;
                *value = S::V16::load_slice(simd, &grid.values[at..]);
            }
            for (half, value) in half.iter_mut().zip(T::input(simd, column)) {
                half[c] = value;
            }
        }
        for (r, &half) in half.iter().enumerate() {
            for (c, value) in T::input(simd, half).into_iter().enumerate() {
                value.store(&mut out[(r * N + c) * plane.place + vector * plane.tiles]);
            }
        }
    }
}

/// Sums of one place: `count` of its tiles times blocks of outputs. Run it [as a separate
/// function](Simd::apart): it is equal for all transforms.
struct Product<'a, const B: usize> {
    values: &'a [Wide],
    tiles: usize,
    count: usize,
    maps: &'a [View<'a>],
    weights: [&'a [Wide]; B],
    out: &'a mut [Wide],
}

impl<const B: usize> Task for Product<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        in_tiles::<S, _>(self.count, &mut (simd, self));
    }
}

impl<S: Simd, const B: usize> Tiles for (S, Product<'_, B>) {
    #[inline(always)]
    fn tile<const R: usize>(&mut self, first: usize) {
        let (simd, Product { values, tiles, maps, weights, out, .. }) = self;
        let mut acc = [[S::V16::splat(*simd, 0.0); B]; R];
        let (mut at, mut row) = (first, 0);
        for map in *maps {
            let weights = part(*weights, row, map.channels);
            accumulate_wide(*simd, &mut acc, &values[at..], *tiles, weights);
            at += map.channels.div_ceil(BLOCK) * *tiles;
            row += map.channels;
        }
        for b in 0..B {
            let out = &mut out[b * *tiles + first..][..R];
            for (sums, out) in acc.iter().zip(out) {
                sums[b].store(out);
            }
        }
    }
}

/// Rows `first..first + count` of each block.
#[inline(always)]
fn part<const B: usize>(mut weights: [&[Wide]; B], first: usize, count: usize) -> [&[Wide]; B] {
    for weights in &mut weights {
        *weights = &weights[first..][..count];
    }
    weights
}

/// Maximum bytes of `tiles` tiles of `side` x `side` inputs of maps with `channels`: a patch,
/// transformed inputs, sums.
pub(super) fn scratch_bytes(side: usize, channels: &[usize], tiles: u128) -> [u128; 3] {
    let place = (side * side * size_of::<Wide>()) as u128;
    let vectors = |channels: usize| channels.div_ceil(BLOCK) as u128;
    let all: u128 = channels.iter().map(|&channels| vectors(channels)).sum();
    let patch = place * channels.iter().map(|&channels| vectors(channels)).max().unwrap_or(0);
    let at_hand = |blocks: u128| (AT_HAND as u128 / (place * (all + blocks))).max(MAX as u128).min(tiles);
    let blocks = BLOCKS as u128;
    // One block leaves more space for inputs; two blocks have more sums.
    [patch, place * (at_hand(1) * all + 1), place * (at_hand(blocks) * blocks + 1)]
}

#[inline(always)]
fn grow(memory: &mut Vec<Wide>, vectors: usize) {
    if memory.len() < vectors {
        memory.resize(vectors, Wide::ZERO);
    }
}

/// The matrices of F(M, 3) with N = M + 2.
pub(super) trait Transform<const N: usize> {
    /// M.
    const OUT: usize;
    /// G.
    const KERNEL: [[f64; 3]; N];
    /// B^t d.
    fn input<S: Copy, V: Vector<S>>(simd: S, d: [V; N]) -> [V; N];
    /// A^t m, in the first M places.
    fn output<S: Copy, V: Vector<S>>(simd: S, m: [V; N]) -> [V; N];
}

/// F(2, 3).
pub(super) struct Two;

impl Transform<4> for Two {
    const OUT: usize = 2;
    const KERNEL: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 0.0, 1.0]];

    #[inline(always)]
    fn input<S: Copy, V: Vector<S>>(_: S, [a, b, c, d]: [V; 4]) -> [V; 4] {
        [a.sub(c), b.add(c), c.sub(b), b.sub(d)]
    }

    #[inline(always)]
    fn output<S: Copy, V: Vector<S>>(_: S, [a, b, c, d]: [V; 4]) -> [V; 4] {
        [a.add(b).add(c), b.sub(c).sub(d), a, a]
    }
}

/// F(4, 3).
pub(super) struct Four;

impl Transform<6> for Four {
    const OUT: usize = 4;
    const KERNEL: [[f64; 3]; 6] = [
        [1.0 / 4.0, 0.0, 0.0],
        [-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
        [-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
        [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
        [1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
        [0.0, 0.0, 1.0],
    ];

    /// 4a - 5c + e; (d - 4b) + (e - 4c); (e - 4c) - (d - 4b); (e - c) + 2(d - b); (e - c) - 2(d -
    /// b); 4b - 5d + f.
    #[inline(always)]
    fn input<S: Copy, V: Vector<S>>(simd: S, [a, b, c, d, e, f]: [V; 6]) -> [V; 6] {
        let (four, less_four) = (V::splat(simd, 4.0), V::splat(simd, -4.0));
        let less_five = V::splat(simd, -5.0);
        let (two, less_two) = (V::splat(simd, 2.0), V::splat(simd, -2.0));
        let (odd, even) = (d.add_product(b, less_four), e.add_product(c, less_four));
        let (db, ec) = (d.sub(b), e.sub(c));
        [
            e.add_product(c, less_five).add_product(a, four),
            even.add(odd),
            even.sub(odd),
            ec.add_product(db, two),
            ec.add_product(db, less_two),
            f.add_product(d, less_five).add_product(b, four),
        ]
    }

    /// a + (b + c) + (d + e); (b - c) + 2(d - e); (b + c) + 4(d + e); (b - c) + 8(d - e) + f.
    #[inline(always)]
    fn output<S: Copy, V: Vector<S>>(simd: S, [a, b, c, d, e, f]: [V; 6]) -> [V; 6] {
        let (bc, de, b_c, d_e) = (b.add(c), d.add(e), b.sub(c), d.sub(e));
        let (two, four, eight) = (V::splat(simd, 2.0), V::splat(simd, 4.0), V::splat(simd, 8.0));
        [
            a.add(bc).add(de),
            b_c.add_product(d_e, two),
            bc.add_product(de, four),
            f.add(b_c).add_product(d_e, eight),
            a,
            a,
        ]
    }
}
