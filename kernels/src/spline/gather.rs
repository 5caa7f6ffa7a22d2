//! S(s, c): the inputs of a row, summed per kernel slot in the order of the edges.

use super::Neighbour;
use crate::lanes::Lanes;
use crate::matrix::Matrix;

/// Working space of [`SplineConv::row`](super::SplineConv::row), grown to the largest row seen and kept.
#[derive(Clone, Debug, Default)]
pub struct SplineScratch {
    /// B(e, s) of one edge after the other, for kernels of 2 x 2 x 2.
    basis: Vec<Lanes>,
    /// S(s, c), each slot padded to whole lanes of c.
    pub(super) sums: Vec<Lanes>,
    /// Slots that some in-edge touches, ascending.
    pub(super) touched: Vec<u32>,
}

/// Leaves in `scratch` the touched slots and their sums over `neighbours`.
#[inline(always)]
pub(super) fn gather(
    kernel: [usize; 3],
    neighbours: &[Neighbour],
    features: &Matrix,
    scratch: &mut SplineScratch,
) {
    let stride = Lanes::count(features.columns());
    let slots: usize = kernel.iter().product();
    scratch.sums.resize(scratch.sums.len().max(slots * stride), Lanes::ZERO);
    match (kernel, features.columns()) {
        _ if neighbours.is_empty() => scratch.touched.clear(),
        ([2, 2, 2], 1) => eight_slots_of_one_channel(neighbours, features, scratch),
        ([2, 2, 2], _) => eight_slots(neighbours, features, stride, scratch),
        _ => any_slots(kernel, neighbours, features, stride, scratch),
    }
}

/// B(e, s) of a 2 x 2 x 2 kernel, where every slot is touched and v = u.
#[inline(always)]
fn basis_of_eight(u: [f32; 3]) -> Lanes {
    let [x, y, t] = u.map(|v| [1.0 - v, v]);
    let mut out = [0.0; 8];
    for (s, out) in out.iter_mut().enumerate() {
        *out = (x[s & 1] * y[s >> 1 & 1]) * t[s >> 2];
    }
    Lanes(out)
}

#[inline(always)]
fn eight_slots_of_one_channel(neighbours: &[Neighbour], features: &Matrix, scratch: &mut SplineScratch) {
    let mut sums = Lanes::ZERO;
    for n in neighbours {
        sums = sums + basis_of_eight(n.u) * Lanes::splat(features.row(n.row as usize)[0].0[0]);
    }
    for (sum, s) in scratch.sums.iter_mut().zip(sums.0) {
        sum.0[0] = s;
    }
    touch_eight(scratch);
}

#[inline(always)]
fn eight_slots(neighbours: &[Neighbour], features: &Matrix, stride: usize, scratch: &mut SplineScratch) {
    scratch.basis.clear();
    scratch.basis.extend(neighbours.iter().map(|n| basis_of_eight(n.u)));
    for lane in 0..stride {
        let mut sums = [Lanes::ZERO; 8];
        for (n, basis) in neighbours.iter().zip(&scratch.basis) {
            let x = features.row(n.row as usize)[lane];
            for (sum, &b) in sums.iter_mut().zip(&basis.0) {
                *sum = *sum + Lanes::splat(b) * x;
            }
        }
        for (slot, sum) in sums.iter().enumerate() {
            scratch.sums[slot * stride + lane] = *sum;
        }
    }
    touch_eight(scratch);
}

#[inline(always)]
fn touch_eight(scratch: &mut SplineScratch) {
    if scratch.touched.len() != 8 || scratch.touched[7] != 7 {
        scratch.touched.clear();
        scratch.touched.extend(0..8);
    }
}

/// Slot and fraction along one axis: the lower of the two slots, and the weight of the upper one.
#[inline(always)]
pub(crate) fn locate(u: f32, kernel: usize) -> (usize, f32) {
    let v = u * (kernel - 1) as f32;
    let lower = (v as usize).min(kernel - 2);
    (lower, v - lower as f32)
}

/// Calls `visit` with slot and weight of each corner that an edge with attribute `u` touches.
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
                visit(slot, (x.1[ix] * y.1[iy]) * t.1[it]);
            }
        }
    }
}

/// Any kernel: touched slots first, then their sums.
#[inline(always)]
fn any_slots(
    kernel: [usize; 3],
    neighbours: &[Neighbour],
    features: &Matrix,
    stride: usize,
    scratch: &mut SplineScratch,
) {
    let SplineScratch { sums, touched, .. } = scratch;
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
            for (sum, &x) in sums[slot * stride..][..stride].iter_mut().zip(x) {
                *sum = *sum + Lanes::splat(weight) * x;
            }
        });
    }
}
