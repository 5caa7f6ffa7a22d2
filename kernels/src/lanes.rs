//! Vectors of eight f32, the unit in which every kernel works.
//!
//! Plain arrays with loops over them. Each loop is one vector instruction if the instruction set
//! has it, otherwise scalar code with the same bits.

use std::ops::Add;

/// Values in one [`Lanes`].
pub const LANES: usize = 8;

/// Eight values, aligned like a vector register.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes(pub [f32; LANES]);

/// Sixteen values in one cache line: two [`Lanes`] that a kernel reads together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Wide(pub [f32; 2 * LANES]);

impl Wide {
    /// Sixteen times +0.
    pub const ZERO: Self = Self([0.0; 2 * LANES]);
}

impl Lanes {
    /// Eight times +0.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// Eight times `value`.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// Applies `f` to each lane.
    #[must_use]
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        let mut out = self.0;
        for value in &mut out {
            *value = f(*value);
        }
        Self(out)
    }

    /// Number of `Lanes` that hold `values` values.
    #[inline(always)]
    pub fn count(values: usize) -> usize {
        values.div_ceil(LANES)
    }

    /// Packs `values` into lanes and pads the last with zeros.
    pub fn pack(values: &[f32]) -> Vec<Self> {
        let mut out = vec![Self::ZERO; Self::count(values.len())];
        for (lanes, values) in out.iter_mut().zip(values.chunks(LANES)) {
            lanes.0[..values.len()].copy_from_slice(values);
        }
        out
    }
}

impl AsMut<[f32]> for Lanes {
    #[inline(always)]
    fn as_mut(&mut self) -> &mut [f32] {
        &mut self.0
    }
}

impl AsMut<[f32]> for Wide {
    #[inline(always)]
    fn as_mut(&mut self) -> &mut [f32] {
        &mut self.0
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a += b;
        }
        Self(out)
    }
}
