//! Exact fractions, used for the sizes of pooling cells.

use std::fmt;
use std::str::FromStr;

/// A positive fraction such as 16/346.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fraction {
    numerator: u32,
    denominator: u32,
}

impl Fraction {
    /// `numerator` / `denominator`; `None` if either is zero.
    pub fn new(numerator: u32, denominator: u32) -> Option<Self> {
        (numerator > 0 && denominator > 0).then_some(Self { numerator, denominator })
    }

    /// The numerator.
    pub fn numerator(self) -> u32 {
        self.numerator
    }

    /// The denominator.
    pub fn denominator(self) -> u32 {
        self.denominator
    }

    pub(crate) const ONE: Self = Self { numerator: 1, denominator: 1 };

    /// The smallest number of `size`s whose total length is at least this one. Saturates.
    pub(crate) fn cells_of(self, size: Self) -> usize {
        let length = u64::from(self.numerator) * u64::from(size.denominator);
        let part = u64::from(self.denominator) * u64::from(size.numerator);
        usize::try_from(length.div_ceil(part)).unwrap_or(usize::MAX)
    }

    /// Number of cells of this size that cover 0 <= p < 1 from an origin of 0.
    pub fn cells(self) -> usize {
        (self.denominator as usize).div_ceil(self.numerator as usize)
    }

    /// Cell that contains `position` / `extent`: floor(position / extent / self), in integers.
    /// Saturates.
    ///
    /// # Panics
    /// If `extent` is not positive, or has more than 62 bits.
    #[inline]
    pub fn cell(self, position: i128, extent: i128) -> i128 {
        assert!(0 < extent && extent >> 62 == 0, "an extent must be positive and of at most 62 bits");
        let [size, parts] = [extent * i128::from(self.numerator), self.denominator.into()];
        if position.unsigned_abs() >> 95 == 0 {
            return (position * parts).div_euclid(size);
        }
        // Two steps, as the product does not fit: the upper bits, then their remainder (below 2^94)
        // with the lower bits.
        let upper = (position >> 32) * parts;
        let lower = (upper.rem_euclid(size) << 32) + (position & 0xffff_ffff) * parts;
        upper.div_euclid(size).saturating_mul(1 << 32).saturating_add(lower.div_euclid(size))
    }

    /// Place of the centre of pixel `pixel` of `extent` in its cell: -1 at the start, 1 at the end.
    /// The cell is that of [`Self::cell`]; its last pixel's centre can lie beyond its end.
    ///
    /// # Panics
    /// If `extent` is 0.
    pub fn place(self, pixel: u16, extent: u16) -> f32 {
        // Twice the lengths in 1 / denominator pixels: below 2^50, so only the quotient is rounded.
        let [size, parts] = [i64::from(extent) * i64::from(self.numerator), self.denominator.into()];
        let within = 2 * (i64::from(pixel) * parts % size) + parts;
        ((within - size) as f64 / size as f64) as f32
    }

    /// Centre of cell `index`, as a fraction of the whole.
    #[inline]
    pub fn centre(self, index: i64) -> f64 {
        (index as f64 + 0.5) * f64::from(self.numerator) / f64::from(self.denominator)
    }
}

impl fmt::Display for Fraction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.numerator, self.denominator)
    }
}

impl FromStr for Fraction {
    type Err = String;

    /// Parses "16/346".
    fn from_str(s: &str) -> Result<Self, String> {
        let parse = || {
            let (n, d) = s.split_once('/')?;
            Self::new(n.trim().parse().ok()?, d.trim().parse().ok()?)
        };
        parse().ok_or_else(|| {
            format!("expected a fraction of positive integers such as \"16/346\", found {s:?}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Fraction;
    use proptest::prelude::*;

    fn fraction(numerator: u32, denominator: u32) -> Fraction {
        Fraction::new(numerator, denominator).expect("positive")
    }

    #[test]
    fn lengths_are_rounded_up_to_whole_cells() {
        assert_eq!([1, 2, 3, 4].map(|n| fraction(n, 3).cells_of(fraction(1, 3))), [1, 2, 3, 4]);
        assert_eq!(fraction(1, 3).cells_of(fraction(1, 4)), 2);
        assert_eq!(fraction(1, 4).cells_of(fraction(1, 3)), 1);
        assert_eq!(fraction(u32::MAX, 1).cells_of(fraction(1, u32::MAX)), (u32::MAX as usize).pow(2));
    }

    #[test]
    fn cells_of_positions_whose_products_do_not_fit_are_exact() {
        let most = u32::MAX;
        // 2^127 (2^32 - 1) / 2^32 is between 2^127 - 2^95 - 1 and 2^127 - 2^95.
        assert_eq!(fraction(1, most).cell(i128::MAX, 1 << 32), i128::MAX - (1 << 95));
        assert_eq!(fraction(1, most).cell(i128::MIN, 1 << 32), i128::MIN + (1 << 95));
        assert_eq!(fraction(most, most).cell(i128::MAX, 1), i128::MAX);
        assert_eq!([i128::MIN, i128::MAX].map(|p| fraction(1, 2).cell(p, 1)), [i128::MIN, i128::MAX]);
        assert_eq!(fraction(most, 1).cell(i128::MIN, (1 << 62) - 1), -((1 << 33) + 3));
    }

    #[test]
    fn places_run_evenly_from_one_end_of_a_cell_to_the_other() {
        let places = |n, d, extent| (0..extent).map(|x| fraction(n, d).place(x, extent)).collect::<Vec<_>>();
        assert_eq!(places(1, 2, 8), [-0.75, -0.25, 0.25, 0.75, -0.75, -0.25, 0.25, 0.75]);
        assert_eq!(places(1, 4, 4), [0.0; 4]);
        assert_eq!(places(3, 4, 4), [-2.0 / 3.0, 0.0, 2.0 / 3.0, -2.0 / 3.0].map(|v: f64| v as f32));
        // Cells of 2.5 pixels: the third pixel begins in the first cell, its centre at the end.
        assert_eq!(places(1, 2, 5)[2], 1.0);
        // The whole sensor is one cell, and a larger cell is not filled.
        assert_eq!(places(1, 1, 2), [-0.5, 0.5]);
        assert_eq!(places(2, 1, 2), [-0.75, -0.25]);
        assert!(fraction(u32::MAX, 1).place(u16::MAX - 1, u16::MAX) < -0.99);
    }

    proptest! {
        #[test]
        fn pixels_of_one_cell_have_ascending_places(n in 1u32..400, d in 1u32..400, x in 0u16..999, extent in 1000u16..2000) {
            let size = fraction(n, d);
            let [a, b] = [x, x + 1].map(|x| size.place(x, extent));
            let [cell, next] = [x, x + 1].map(|x| size.cell(x.into(), extent.into()));
            prop_assert!(cell != next || a < b);
            let width = f64::from(d) / (f64::from(n) * f64::from(extent));
            prop_assert!((-1.0..=1.0 + width).contains(&f64::from(a)), "{}", a);
        }

        #[test]
        fn large_positions_fall_into_the_cells_of_the_same_share(
            n in 1..u32::MAX, d in 1..u32::MAX, position in any::<i64>(), extent in 1i64..1 << 30, times in 0u32..33,
        ) {
            let size = fraction(n, d);
            let small = size.cell(position.into(), extent.into());
            prop_assert_eq!(size.cell(i128::from(position) << times, i128::from(extent) << times), small);
            prop_assert_eq!((i128::from(position) * i128::from(d)).div_euclid(i128::from(extent) * i128::from(n)), small);
        }
    }
}
