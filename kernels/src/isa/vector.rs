//! The operations on vectors that kernels are written with.

use crate::lanes::{Lanes, Wide};

/// Work that can be compiled for several instruction sets. `run` must be `#[inline(always)]`, and so must be all that
/// it calls in its inner loops, or it runs with the build's baseline instructions.
pub trait Task {
    /// The result of the work.
    type Output;
    /// Does the work with `simd`'s vectors.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// An instruction set, as a value that proves that the processor has it.
pub trait Simd: Copy {
    /// Eight f32.
    type V8: Exponent<Self, Memory = Lanes>;
    /// Sixteen f32: one register, or several that are used as one.
    type V16: Exponent<Self, Memory = Wide>;
    /// Whether a `V16` is one register of 32, and not two of 16.
    const WIDE: bool;

    /// Runs `task` as a function of its own, so that its inner loop has all the registers.
    fn apart<T: Task>(self, task: T) -> T::Output;
}

/// A register of f32. Every operation acts on each element by itself and rounds to nearest, ties to even.
pub trait Vector<S>: Copy {
    /// The same values in memory.
    type Memory: Copy + AsMut<[f32]>;
    /// Number of elements.
    const LANES: usize;
    /// Zeros in memory.
    const ZEROS: Self::Memory;

    /// Every element `value`.
    fn splat(simd: S, value: f32) -> Self;
    /// Reads.
    fn load(simd: S, from: &Self::Memory) -> Self;
    /// Reads the first values of a slice.
    ///
    /// # Panics
    /// If `from` is shorter than the vector.
    fn load_slice(simd: S, from: &[f32]) -> Self;
    /// Writes.
    fn store(self, to: &mut Self::Memory);
    /// Writes to the first values of a slice.
    ///
    /// # Panics
    /// If `to` is shorter than the vector.
    fn store_slice(self, to: &mut [f32]);
    /// self + other.
    #[must_use]
    fn add(self, other: Self) -> Self;
    /// self - other.
    #[must_use]
    fn sub(self, other: Self) -> Self;
    /// self other.
    #[must_use]
    fn mul(self, other: Self) -> Self;
    /// self + a b, rounded once.
    #[must_use]
    fn add_product(self, a: Self, b: Self) -> Self;
    /// `other` where it is larger, else self: where either is NaN, self.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// `other` where it is larger or NaN, else self: what is NaN on either side stays NaN.
    #[must_use]
    #[inline(always)]
    fn max_or_nan(self, simd: S, other: Self) -> Self {
        let (mut values, mut others) = (Self::ZEROS, Self::ZEROS);
        self.store(&mut values);
        other.store(&mut others);
        for (value, &mut other) in values.as_mut().iter_mut().zip(others.as_mut()) {
            // By value, so that the comparison is one of vectors.
            let (v, larger) = (*value, other > *value);
            *value = if larger | other.is_nan() { other } else { v };
        }
        Self::load(simd, &values)
    }
    /// Bit i is set where element i is at most that of `other`; clear where either is NaN.
    #[must_use]
    fn at_most(self, other: Self) -> u32;
    /// Bit i is set where element i and that of `other` are not the same bits.
    #[must_use]
    fn differs(self, other: Self) -> u32;

    /// `f` of every element; vectorised as far as the compiler can, so best without branches.
    #[must_use]
    #[inline(always)]
    fn map(self, simd: S, f: impl Fn(f32) -> f32) -> Self {
        let mut values = Self::ZEROS;
        self.store(&mut values);
        for value in values.as_mut() {
            *value = f(*value);
        }
        Self::load(simd, &values)
    }
}

/// A register of f32 that can be divided, and whose bits can be made and moved.
pub trait Exponent<S>: Vector<S> {
    /// self / other.
    #[must_use]
    fn div(self, other: Self) -> Self;
    /// 2^(n + more), where self is 1.5 2^23 + n and -126 <= n + more <= 127.
    #[must_use]
    fn power_of_two(self, simd: S, more: i32) -> Self;
    /// Its magnitude with the sign of `of`.
    #[must_use]
    fn with_sign(self, simd: S, of: Self) -> Self;
    /// Itself where `of` has the sign bit, else `other`.
    #[must_use]
    fn where_negative(self, of: Self, other: Self) -> Self;
}

/// Two registers used as one.
impl<S: Copy, V: Exponent<S>> Exponent<S> for [V; 2]
where
    Self: Vector<S>,
{
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        [self[0].div(other[0]), self[1].div(other[1])]
    }
    #[inline(always)]
    fn power_of_two(self, simd: S, more: i32) -> Self {
        [self[0].power_of_two(simd, more), self[1].power_of_two(simd, more)]
    }
    #[inline(always)]
    fn with_sign(self, simd: S, of: Self) -> Self {
        [self[0].with_sign(simd, of[0]), self[1].with_sign(simd, of[1])]
    }
    #[inline(always)]
    fn where_negative(self, of: Self, other: Self) -> Self {
        [self[0].where_negative(of[0], other[0]), self[1].where_negative(of[1], other[1])]
    }
}
