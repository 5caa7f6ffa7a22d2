//! Rows of lanes: maxima independent of order, sums that depend on it, comparison, replacement.

use crate::isa::{Isa, Simd, Task, Vector};
use crate::lanes::{LANES, Lanes};
use crate::matrix::Matrix;

/// `acc = max(acc, row)` by channel for each of `rows`, from negative infinity; end with
/// [`clear_negative_zero`], because the order of rows affects the sign of zero. NaN members are
/// ignored.
///
/// # Panics
/// If a row has fewer lanes than `acc`.
#[inline(always)]
pub fn maximum<'a, S: Simd>(
    simd: S,
    acc: &mut [Lanes],
    rows: impl IntoIterator<Item = &'a [Lanes], IntoIter: Clone>,
) {
    let rows = rows.into_iter();
    let (fours, rest) = acc.as_chunks_mut::<4>();
    let at = 4 * fours.len();
    for (i, acc) in fours.iter_mut().enumerate() {
        maximum_of(simd, acc, rows.clone().map(|row| &row[4 * i..]));
    }
    for (i, acc) in rest.iter_mut().enumerate() {
        maximum_of(simd, std::array::from_mut(acc), rows.clone().map(|row| &row[at + i..]));
    }
}

/// [`maximum`] over the first N lanes, in registers.
#[inline(always)]
fn maximum_of<'a, S: Simd, const N: usize>(
    simd: S,
    acc: &mut [Lanes; N],
    rows: impl Iterator<Item = &'a [Lanes]>,
) {
    let mut largest = [S::V8::splat(simd, 0.0); N];
    for (largest, acc) in largest.iter_mut().zip(&*acc) {
        *largest = S::V8::load(simd, acc);
    }
    for row in rows {
        for (largest, row) in largest.iter_mut().zip(&row[..N]) {
            *largest = largest.max(S::V8::load(simd, row));
        }
    }
    for (largest, acc) in largest.into_iter().zip(acc) {
        largest.store(acc);
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

/// The outcome for up to 32 rows: bit i stands for row i.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Replaced {
    /// Rows that differed from the stored ones and replaced them.
    pub changed: u32,
    /// Rows that differed by at most the tolerance: the stored rows are kept.
    pub within: u32,
    /// Computed rows that hold NaN.
    pub nan: u32,
}

/// Writes `rows`, one after the other, to the rows `places` of `stored` if their bits differ.
///
/// # Panics
/// For more than 32 places, other numbers of rows and places, or a place beyond `stored`.
pub fn replace_rows(isa: Isa, rows: &[Lanes], stored: &mut Matrix, places: &[u32]) -> Replaced {
    isa.run(Replace { rows, stored, places, tolerance: None })
}

/// As [`replace_rows`], but keeps a stored row within `tolerance` of the computed one.
///
/// A difference is formed in f32 before it is compared. NaN on either side, and infinities of
/// different sign, are beyond every tolerance.
///
/// # Panics
/// As [`replace_rows`].
pub fn replace_rows_beyond(
    isa: Isa,
    tolerance: f32,
    rows: &[Lanes],
    stored: &mut Matrix,
    places: &[u32],
) -> Replaced {
    isa.run(Replace { rows, stored, places, tolerance: Some(tolerance) })
}

/// One bit per value of a [`Lanes`].
const ALL: u32 = (1 << LANES) - 1;

struct Replace<'a> {
    rows: &'a [Lanes],
    stored: &'a mut Matrix,
    places: &'a [u32],
    tolerance: Option<f32>,
}

impl Task for Replace<'_> {
    type Output = Replaced;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Replaced {
        let lanes = Lanes::count(self.stored.columns());
        assert!(self.places.len() <= u32::BITS as usize, "a bit stands for each row");
        assert_eq!(self.rows.len(), self.places.len() * lanes, "each place must have a row");
        let mut replaced = Replaced::default();
        for (i, (&place, row)) in self.places.iter().zip(self.rows.chunks_exact(lanes)).enumerate() {
            let stored = self.stored.row_mut(place as usize);
            let (mut differs, mut ordered) = (0, ALL);
            for (new, old) in row.iter().zip(&*stored) {
                let (new, old) = (S::V8::load(simd, new), S::V8::load(simd, old));
                differs |= new.differs(old);
                ordered &= new.at_most(new);
            }
            replaced.nan |= u32::from(ordered != ALL) << i;
            if differs == 0 {
                continue;
            }
            if self.tolerance.is_some_and(|tolerance| is_within(simd, tolerance, row, stored)) {
                replaced.within |= 1 << i;
            } else {
                replaced.changed |= 1 << i;
                // A few vectors, for which a call of memcpy takes longer.
                for (new, old) in row.iter().zip(stored) {
                    S::V8::load(simd, new).store(old);
                }
            }
        }
        replaced
    }
}

/// Whether every value of `row` has the bits of the stored one or is within `tolerance` of it.
#[inline(always)]
fn is_within<S: Simd>(simd: S, tolerance: f32, row: &[Lanes], stored: &[Lanes]) -> bool {
    let tolerance = S::V8::splat(simd, tolerance);
    let mut beyond = 0;
    for (new, old) in row.iter().zip(stored) {
        let (new, old) = (S::V8::load(simd, new), S::V8::load(simd, old));
        // The difference of equal infinities is NaN, so equal bits are tested separately.
        let near = new.sub(old).at_most(tolerance) & old.sub(new).at_most(tolerance);
        beyond |= new.differs(old) & !near;
    }
    beyond == 0
}
