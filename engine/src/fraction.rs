//! Exact fractions, in which the sizes of pooling cells are given.

use std::fmt;
use std::str::FromStr;

/// A positive fraction such as 16/346.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fraction {
    numerator: u32,
    denominator: u32,
}

impl Fraction {
    /// `numerator` / `denominator`; `None` where either is zero.
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

    /// Number of cells of this size, from an origin of 0, that cover 0 <= p < 1.
    pub fn cells(self) -> usize {
        (self.denominator as usize).div_ceil(self.numerator as usize)
    }

    /// The cell that holds `position` / `extent`: floor(position / extent / self), computed in integers.
    #[inline]
    pub fn cell(self, position: i128, extent: i128) -> i128 {
        (position * i128::from(self.denominator)).div_euclid(extent * i128::from(self.numerator))
    }

    /// Centre of cell `index`, as a share of the whole.
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

    /// Reads "16/346".
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
