//! Channel-wise maxima independent of order, sums that depend on it, comparisons of bits.

use crate::lanes::Lanes;

/// `acc = max(acc, row)` by channel, from negative infinity; end with [`clear_negative_zero`], as
/// the order of rows affects the sign of zero. NaN members are ignored.
#[inline(always)]
pub fn maximum(acc: &mut [Lanes], row: &[Lanes]) {
    for (a, r) in acc.iter_mut().zip(row) {
        // By value: through the reference, the compiler compares and stores one lane at a time.
        let mut larger = a.0;
        for (larger, &r) in larger.iter_mut().zip(&r.0) {
            *larger = if r > *larger { r } else { *larger };
        }
        a.0 = larger;
    }
}

/// Finishes a maximum: negative zero becomes +0, which makes the result independent of the order.
#[inline(always)]
pub fn clear_negative_zero(acc: &mut [Lanes]) {
    for a in acc {
        *a = *a + Lanes::ZERO;
    }
}

/// `acc = acc + row` channel by channel. The order of rows matters: addition rounds.
#[inline(always)]
pub fn add(acc: &mut [Lanes], row: &[Lanes]) {
    for (a, &r) in acc.iter_mut().zip(row) {
        *a = *a + r;
    }
}

/// Whether two rows have the same bits.
#[inline(always)]
pub fn same_bits(a: &[Lanes], b: &[Lanes]) -> bool {
    let mut difference = 0;
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.0.iter().zip(&b.0) {
            difference |= a.to_bits() ^ b.to_bits();
        }
    }
    difference == 0
}

/// Whether any value of a row is NaN.
#[inline(always)]
pub fn is_nan(row: &[Lanes]) -> bool {
    let mut nan = false;
    for lanes in row {
        for v in lanes.0 {
            nan |= v.is_nan();
        }
    }
    nan
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maximum_of(rows: &[[f32; 8]]) -> [u32; 8] {
        let mut acc = [Lanes::splat(f32::NEG_INFINITY)];
        rows.iter().for_each(|&r| maximum(&mut acc, &[Lanes(r)]));
        clear_negative_zero(&mut acc);
        acc[0].0.map(f32::to_bits)
    }

    #[test]
    fn a_maximum_does_not_depend_on_the_order_of_its_members() {
        let rows = [[0.0; 8], [-0.0; 8], [-1.0, 2.0, -0.0, 1e-45, -1e-45, 0.0, 3.0, -3.0]];
        let expected = maximum_of(&rows);
        for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            assert_eq!(maximum_of(&order.map(|i| rows[i])), expected);
        }
        assert_eq!(maximum_of(&[[-0.0; 8]]), [0; 8]);
    }
}
