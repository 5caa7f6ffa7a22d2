//! Vectors in memory as the values that they hold.

use crate::lanes::{LANES, Lanes, Wide};

const _: () = assert!(size_of::<Lanes>() == LANES * size_of::<f32>());
const _: () =
    assert!(size_of::<Wide>() == 2 * size_of::<Lanes>() && align_of::<Wide>() >= align_of::<Lanes>());

/// The values of `lanes`, one after the other.
#[inline(always)]
pub(crate) fn flat(lanes: &[Lanes]) -> &[f32] {
    // SAFETY: `Lanes` is `repr(C)` around [f32; LANES] and as large as that, so that a slice of it is LANES times as
    // many f32 without a gap; alignment only loosens, and the lifetime is the same.
    unsafe { std::slice::from_raw_parts(lanes.as_ptr().cast(), lanes.len() * LANES) }
}

/// The values of `lanes`, to write.
#[inline(always)]
pub(crate) fn flat_mut(lanes: &mut [Lanes]) -> &mut [f32] {
    // SAFETY: as in `flat`; any bits are a valid f32, and the borrow is unique.
    unsafe { std::slice::from_raw_parts_mut(lanes.as_mut_ptr().cast(), lanes.len() * LANES) }
}

/// The values of `wide`, one after the other.
#[inline(always)]
pub(crate) fn flat_wide(wide: &[Wide]) -> &[f32] {
    // SAFETY: as in `flat`: `Wide` is `repr(C)` around [f32; 2 LANES] and as large as that.
    unsafe { std::slice::from_raw_parts(wide.as_ptr().cast(), wide.len() * 2 * LANES) }
}

/// The values of `wide`, to write.
#[inline(always)]
pub(crate) fn flat_wide_mut(wide: &mut [Wide]) -> &mut [f32] {
    // SAFETY: as in `flat_wide`; any bits are a valid f32, and the borrow is unique.
    unsafe { std::slice::from_raw_parts_mut(wide.as_mut_ptr().cast(), wide.len() * 2 * LANES) }
}

/// The values of `wide`, in lanes.
#[inline(always)]
pub(crate) fn lanes_of_wide(wide: &[Wide]) -> &[Lanes] {
    // SAFETY: a `Wide` is as large as two `Lanes`, both are f32 without a gap, and alignment only loosens.
    unsafe { std::slice::from_raw_parts(wide.as_ptr().cast(), wide.len() * 2) }
}
