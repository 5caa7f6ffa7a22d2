//! Splits rows of positions into tiles as large as the registers allow.

use crate::isa::{Simd, Vector};

/// Work on R adjacent positions at a time.
pub(super) trait Tiles {
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

/// Covers `count` positions with the fewest tiles, nearly equal, multiples of `unit` (1 or 2).
#[inline(always)]
pub(super) fn in_tiles<S: Simd>(count: usize, unit: usize, work: &mut impl Tiles) {
    let tiles = count.div_ceil(most::<S>());
    let mut first = 0;
    for t in 0..tiles {
        let end = (t + 1) * (count / unit) / tiles * unit;
        match end - first {
            1 => work.tile::<1>(first),
            2 => work.tile::<2>(first),
            3 => work.tile::<3>(first),
            4 => work.tile::<4>(first),
            5 => work.tile::<5>(first),
            6 => work.tile::<6>(first),
            size if S::WIDE => match size {
                7 => work.tile::<7>(first),
                8 => work.tile::<8>(first),
                9 => work.tile::<9>(first),
                10 => work.tile::<10>(first),
                11 => work.tile::<11>(first),
                12 => work.tile::<12>(first),
                13 => work.tile::<13>(first),
                _ => work.tile::<14>(first),
            },
            _ => unreachable!("a tile has at most `most` positions"),
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
