//! S(s, c): the inputs of a row, summed per kernel slot in the order of the edges.

use super::SplineConv;
use crate::graph::{GraphRow, Neighbour};
use crate::isa::{Simd, Sum, Vector, begin, end, flat, flat_mut};
use crate::lanes::{LANES, Lanes, Wide};
use crate::matrix::Matrix;

/// Vectors of totals per group of rows: two vectors in two sums for each row.
pub(super) const TOTALS: usize = 2 * 2 * SplineConv::GROUP;

/// Working space of [`SplineConv::rows`]; grows to the largest rows seen and is reused.
#[derive(Debug, Default)]
pub struct SplineScratch {
    /// B(e, s) of each edge in turn, for kernels of 2 x 2 x 2.
    pub(super) basis: Vec<Lanes>,
    /// S(s, c) of each row in turn, each slot padded to whole lanes of c.
    pub(super) sums: Vec<Lanes>,
    /// Sums of a group of rows over the weights: of sixteen outputs, and of eight.
    pub(super) totals: (Vec<Wide>, Vec<Lanes>),
    /// Slots touched by some in-edge, ascending.
    pub(super) touched: Vec<u32>,
}

struct Sizes {
    basis: usize,
    sums: usize,
    totals: usize,
    touched: usize,
}

impl Sizes {
    /// Sizes for `convs` and rows of at most `most` in-edges.
    fn of<'a>(convs: impl Iterator<Item = &'a SplineConv>, most: usize) -> Self {
        let mut sizes = Self { basis: 0, sums: 0, totals: 0, touched: 0 };
        for conv in convs {
            sizes.sums = sizes.sums.max(conv.sums());
            if conv.is_flat() {
                sizes.totals = TOTALS;
                sizes.basis = if conv.reads_basis() { most } else { sizes.basis };
            } else {
                // Every in-edge touches at most eight slots.
                sizes.touched = 8 * most;
            }
        }
        sizes
    }
}

impl SplineScratch {
    /// Working space for all of `convs` and rows of at most `most` in-edges; never grows.
    pub fn new<'a>(convs: impl Iterator<Item = &'a SplineConv>, most: usize) -> Self {
        let Sizes { basis, sums, totals, touched } = Sizes::of(convs, most);
        Self {
            basis: Vec::with_capacity(basis),
            sums: vec![Lanes::ZERO; sums],
            totals: (vec![Wide::ZERO; totals], vec![Lanes::ZERO; totals]),
            touched: Vec::with_capacity(touched),
        }
    }

    /// Bytes that [`Self::new`] allocates.
    pub fn bytes<'a>(convs: impl Iterator<Item = &'a SplineConv>, most: usize) -> usize {
        let Sizes { basis, sums, totals, touched } = Sizes::of(convs, most);
        (basis + sums + totals) * size_of::<Lanes>() + totals * size_of::<Wide>() + touched * size_of::<u32>()
    }
}

impl Clone for SplineScratch {
    /// A working space of the same size; the content is not copied.
    fn clone(&self) -> Self {
        Self {
            basis: Vec::with_capacity(self.basis.capacity()),
            sums: self.sums.clone(),
            totals: self.totals.clone(),
            touched: Vec::with_capacity(self.touched.capacity()),
        }
    }
}

/// B(e, s) of a 2 x 2 x 2 kernel for attribute `u`: every slot is touched and v = u.
#[inline(always)]
pub fn spline_basis(u: [f32; 3]) -> Lanes {
    let [x, y, t] = u.map(|v| [1.0 - v, v]);
    let mut out = [0.0; 8];
    for (s, out) in out.iter_mut().enumerate() {
        *out = (x[s & 1] * y[s >> 1 & 1]) * t[s >> 2];
    }
    Lanes(out)
}

/// Sums of a 2 x 2 x 2 kernel over fewer channels than a lane: slot after slot, the channels of
/// each.
#[inline(always)]
pub(super) fn eight_slots_of_few_channels<S: Simd, const C: usize>(
    simd: S,
    neighbours: &[Neighbour],
    features: &Matrix,
    sums: &mut [Lanes],
) {
    let mut acc = [[S::V8::splat(simd, 0.0); C]];
    if !add_few::<S, <S::V8 as Vector<S>>::Sum, C>(simd, neighbours, features, &mut acc) {
        add_few::<S, S::V8, C>(simd, neighbours, features, &mut acc);
    }
    let sums = flat_mut(sums);
    for (c, acc) in acc[0].into_iter().enumerate() {
        let mut slots = Lanes::ZERO;
        acc.store(&mut slots);
        for (slot, sum) in slots.0.into_iter().enumerate() {
            sums[slot * C + c] = sum;
        }
    }
}

/// Adds B(e, s) x(c) of each edge to sum c, in the form A, as
/// [`accumulate`](crate::isa::accumulate) does.
#[inline(always)]
fn add_few<S: Simd, A: Sum<S, Vector = S::V8>, const C: usize>(
    simd: S,
    neighbours: &[Neighbour],
    features: &Matrix,
    acc: &mut [[S::V8; C]; 1],
) -> bool {
    let (mut sums, mut doubt) = begin::<S, A, 1, C>(simd, acc);
    for n in neighbours {
        let x = &features.row(n.row as usize)[0].0;
        let basis = A::factor(simd, S::V8::load(simd, &spline_basis(n.u)), &mut doubt);
        for (sum, &x) in sums[0].iter_mut().zip(x) {
            let x = A::factor_of_all(simd, x, &mut doubt);
            *sum = sum.plus_product(basis, x, &mut doubt);
        }
    }
    end(&sums, doubt, acc)
}

/// Sums of a 2 x 2 x 2 kernel over whole lanes of channels: slot after slot.
#[inline(always)]
pub(super) fn eight_slots<S: Simd>(
    simd: S,
    row: &GraphRow<'_>,
    features: &Matrix,
    computed: &mut Vec<Lanes>,
    sums: &mut [Lanes],
) {
    let neighbours = row.neighbours;
    let mut basis = row.basis;
    if basis.len() != neighbours.len() {
        computed.clear();
        computed.extend(neighbours.iter().map(|n| spline_basis(n.u)));
        basis = computed;
    }
    let stride = sums.len() / 8;
    let mut lane = 0;
    while S::WIDE && lane + 4 <= stride {
        slots_of_lanes::<S, S::V16, 8, 2>(simd, neighbours, features, basis, 0, lane, sums);
        lane += 4;
    }
    while lane + 2 <= stride {
        if S::WIDE {
            slots_of_lanes::<S, S::V16, 8, 1>(simd, neighbours, features, basis, 0, lane, sums);
        } else {
            slots_of_lanes::<S, S::V16, 4, 1>(simd, neighbours, features, basis, 0, lane, sums);
            slots_of_lanes::<S, S::V16, 4, 1>(simd, neighbours, features, basis, 4, lane, sums);
        }
        lane += 2;
    }
    if lane < stride {
        slots_of_lanes::<S, S::V8, 8, 1>(simd, neighbours, features, basis, 0, lane, sums);
    }
}

/// Sums of N slots from `slot` over the channels of B vectors from lane `lane`.
#[inline(always)]
fn slots_of_lanes<S: Simd, V: Vector<S>, const N: usize, const B: usize>(
    simd: S,
    neighbours: &[Neighbour],
    features: &Matrix,
    basis: &[Lanes],
    slot: usize,
    lane: usize,
    sums: &mut [Lanes],
) {
    let stride = sums.len() / 8;
    let mut acc = [[V::splat(simd, 0.0); B]; N];
    if !add_slots::<S, V::Sum, N, B>(simd, neighbours, features, basis, slot, lane, &mut acc) {
        add_slots::<S, V, N, B>(simd, neighbours, features, basis, slot, lane, &mut acc);
    }
    for (i, acc) in acc.into_iter().enumerate() {
        let to = &mut flat_mut(sums)[((slot + i) * stride + lane) * LANES..][..B * V::LANES];
        for (b, acc) in acc.into_iter().enumerate() {
            acc.store_slice(&mut to[b * V::LANES..]);
        }
    }
}

/// Adds B(e, s) x of each edge to the sums of slot s, in the form A, as
/// [`accumulate`](crate::isa::accumulate) does.
#[inline(always)]
fn add_slots<S: Simd, A: Sum<S>, const N: usize, const B: usize>(
    simd: S,
    neighbours: &[Neighbour],
    features: &Matrix,
    basis: &[Lanes],
    slot: usize,
    lane: usize,
    acc: &mut [[A::Vector; B]; N],
) -> bool {
    let lanes = A::Vector::LANES;
    let (mut sums, mut doubt) = begin::<S, A, N, B>(simd, acc);
    for (n, basis) in neighbours.iter().zip(basis) {
        let row = &flat(features.row(n.row as usize))[lane * LANES..][..B * lanes];
        let mut x = [A::factor(simd, A::Vector::splat(simd, 0.0), &mut doubt); B];
        for (b, x) in x.iter_mut().enumerate() {
            *x = A::factor(simd, A::Vector::load_slice(simd, &row[b * lanes..]), &mut doubt);
        }
        for (sums, &weight) in sums.iter_mut().zip(&basis.0[slot..slot + N]) {
            let weight = A::factor_of_all(simd, weight, &mut doubt);
            for (sum, &x) in sums.iter_mut().zip(&x) {
                *sum = sum.plus_product(weight, x, &mut doubt);
            }
        }
    }
    end(&sums, doubt, acc)
}

/// Slot and fraction along one axis: the lower of the two slots, and the weight of the upper one.
#[inline(always)]
pub(crate) fn locate(u: f32, kernel: usize) -> (usize, f32) {
    let v = u * (kernel - 1) as f32;
    let lower = (v as usize).min(kernel - 2);
    (lower, v - lower as f32)
}

/// Calls `visit` with slot and weight of each corner that attribute `u` touches. Corners of weight
/// 0, seven of eight between centres of adjacent cells, change no sum and are skipped.
#[inline(always)]
fn for_each_corner(kernel: [usize; 3], u: [f32; 3], mut visit: impl FnMut(usize, f32)) {
    let mut axes = [([0, 0], [1.0, 0.0], 1); 3];
    for d in 0..3 {
        if kernel[d] > 1 {
            let (lower, upper) = locate(u[d], kernel[d]);
            axes[d] = ([lower, lower + 1], [1.0 - upper, upper], 2);
        }
    }
    let [x, y, t] = axes;
    for it in 0..t.2 {
        for iy in 0..y.2 {
            for ix in 0..x.2 {
                let slot = x.0[ix] + kernel[0] * (y.0[iy] + kernel[1] * t.0[it]);
                let weight = (x.1[ix] * y.1[iy]) * t.1[it];
                if weight != 0.0 {
                    visit(slot, weight);
                }
            }
        }
    }
}

/// For any kernel and any number of channels: writes the touched slots and their sums to `scratch`.
#[inline(always)]
pub(super) fn any_slots<S: Simd>(
    simd: S,
    kernel: [usize; 3],
    neighbours: &[Neighbour],
    features: &Matrix,
    scratch: &mut SplineScratch,
) {
    let stride = Lanes::count(features.columns());
    let slots: usize = kernel.iter().product();
    let SplineScratch { sums, touched, .. } = scratch;
    sums.resize(sums.len().max(slots * stride), Lanes::ZERO);
    touched.clear();
    for n in neighbours {
        for_each_corner(kernel, n.u, |slot, _| touched.push(slot as u32));
    }
    touched.sort_unstable();
    touched.dedup();
    for &slot in touched.iter() {
        sums[slot as usize * stride..][..stride].fill(Lanes::ZERO);
    }
    for n in neighbours {
        let x = features.row(n.row as usize);
        for_each_corner(kernel, n.u, |slot, weight| {
            let weight = S::V8::splat(simd, weight);
            for (sum, x) in sums[slot * stride..][..stride].iter_mut().zip(x) {
                S::V8::load(simd, sum).add_product(weight, S::V8::load(simd, x)).store(sum);
            }
        });
    }
}
