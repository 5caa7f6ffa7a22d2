//! Computed rows in the place of stored ones: which of them differ, by bits.

use crate::isa::{Isa, Simd, Task, Vector};
use crate::lanes::{LANES, Lanes};
use crate::matrix::Matrix;

/// What became of up to 32 rows: bit i stands for the ith.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Replaced {
    /// Rows that differed from what was stored.
    pub changed: u32,
    /// Rows that hold NaN.
    pub nan: u32,
}

/// Writes `rows`, one after the other, to the rows `places` of `stored`, where their bits differ.
///
/// # Panics
/// If there are more than 32 places, not a row for each, or no such row in `stored`.
pub fn replace_rows(isa: Isa, rows: &[Lanes], stored: &mut Matrix, places: &[u32]) -> Replaced {
    isa.run(Replace { rows, stored, places })
}

/// A bit for each value of a [`Lanes`].
const ALL: u32 = (1 << LANES) - 1;

struct Replace<'a> {
    rows: &'a [Lanes],
    stored: &'a mut Matrix,
    places: &'a [u32],
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
            if differs != 0 {
                replaced.changed |= 1 << i;
                stored.copy_from_slice(row);
            }
        }
        replaced
    }
}
