//! The inner loop of planar convolutions: a few outputs times a few vectors of positions.

use super::vector::{Simd, Vector};

/// Taps of a 3 x 3 window: row dy, column dx, channel c is at `c plane + dy stride + dx`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taps<'a> {
    /// Values, from the first tap of the first position on.
    pub(crate) values: &'a [f32],
    /// Distance between rows in values.
    pub(crate) stride: usize,
    /// Distance between channels in values.
    pub(crate) plane: usize,
}

/// acc(o, b) += sum over channels, rows and columns of the window, ascending, of weights(tap, o)
/// values(tap + b), each product rounded once with the sum. `weights`: (channels x 9, O).
///
/// # Panics
/// If `weights` are not whole windows, or there are too few values.
#[inline(always)]
pub(crate) fn accumulate_taps<S: Simd, V: Vector<S>, const O: usize, const B: usize>(
    simd: S,
    acc: &mut [[V; B]; O],
    taps: Taps<'_>,
    weights: &[[f32; O]],
) {
    let Taps { values, stride, plane } = taps;
    if weights.is_empty() {
        return;
    }
    assert!(weights.len().is_multiple_of(9), "there must be a weight for each tap");
    let last = plane.checked_mul(weights.len() / 9 - 1).zip(stride.checked_mul(2));
    let end = last.and_then(|(plane, rows)| plane.checked_add(rows)?.checked_add(2 + B * V::LANES));
    assert!(end.is_some_and(|end| end <= values.len()), "there must be a value for each tap");
    // A local variable, so that it stays in registers.
    let mut sums = *acc;
    let (mut channel, mut k) = (0, 0);
    while k < weights.len() {
        let mut row = channel;
        for _ in 0..3 {
            for dx in 0..3 {
                // Not by `from_fn`: where a closure stays a call, so do the instructions in it.
                let mut x = [V::splat(simd, 0.0); B];
                for (b, x) in x.iter_mut().enumerate() {
                    let at = row + dx + b * V::LANES;
                    // SAFETY: `row` <= (channels - 1) plane + 2 stride and dx <= 2: at + LANES <=
                    // `end`, within `values`.
                    *x = V::load_slice(simd, unsafe { values.get_unchecked(at..at + V::LANES) });
                }
                // SAFETY: k counts nine weights a turn of the outer loop, and their number is a
                // multiple of nine.
                let weights = unsafe { weights.get_unchecked(k) };
                for (sums, &weight) in sums.iter_mut().zip(weights) {
                    let weight = V::splat(simd, weight);
                    for (sum, &x) in sums.iter_mut().zip(&x) {
                        *sum = sum.add_product(weight, x);
                    }
                }
                k += 1;
            }
            row += stride;
        }
        channel += plane;
    }
    *acc = sums;
}

#[cfg(test)]
mod tests {
    use super::{Taps, accumulate_taps};
    use crate::isa::portable::Portable;
    use crate::lanes::LANES;

    fn accumulate(stride: usize, plane: usize) {
        let mut sums = [[[0.0; LANES]; 1]; 1];
        let taps = Taps { values: &[0.0; 40], stride, plane };
        accumulate_taps(Portable, &mut sums, taps, &[[0.0; 1]; 27]);
    }

    #[test]
    fn taps_within_the_values_are_taken() {
        accumulate(4, 10);
    }

    #[should_panic(expected = "there must be a value for each tap")]
    #[test]
    fn a_stride_that_wraps_is_refused() {
        accumulate(1 << 63, 10);
    }

    #[should_panic(expected = "there must be a value for each tap")]
    #[test]
    fn a_plane_that_wraps_is_refused() {
        accumulate(4, 1 << 63);
    }
}
