//! The vector operations in which kernels are written.

use crate::lanes::{Lanes, Wide};

/// Work compiled for several instruction sets. `run`, and all functions that its inner loops call,
/// must be `#[inline(always)]`; otherwise they run with the build's baseline instructions.
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
    /// Whether a `V16` is a single register (one of 32), rather than a pair (of 16).
    const WIDE: bool;
    /// Whether a product and a sum of f64 are one instruction.
    const FUSED: bool;

    /// Runs `task` as a separate function, so that its inner loop has all registers.
    fn apart<T: Task>(self, task: T) -> T::Output;
}

/// A vector as it is in memory, which an instruction set computes with in [`Self::Of`].
pub(crate) trait Stored: Copy {
    type Of<S: Simd>: Exponent<S, Memory = Self>;
}

impl Stored for Lanes {
    type Of<S: Simd> = S::V8;
}

impl Stored for Wide {
    type Of<S: Simd> = S::V16;
}

/// A register of f32. Every operation acts element by element and rounds to nearest, ties to even.
pub trait Vector<S>: Copy {
    /// Representation in memory.
    type Memory: Copy + AsMut<[f32]>;
    /// A sum of many products as it grows.
    type Sum: Sum<S, Vector = Self>;
    /// Number of elements.
    const LANES: usize;
    /// Zeros in memory.
    const ZEROS: Self::Memory;

    /// A vector with every element equal to `value`.
    fn splat(simd: S, value: f32) -> Self;
    /// Loads a vector.
    fn load(simd: S, from: &Self::Memory) -> Self;
    /// Loads the first values of a slice. Panics if `from` is shorter than the vector.
    fn load_slice(simd: S, from: &[f32]) -> Self;
    /// Stores the vector.
    fn store(self, to: &mut Self::Memory);
    /// Stores the vector to the first values of a slice. Panics if `to` is shorter than the vector.
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
    /// `other` if it is larger, otherwise self; self if either is NaN.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// `other` if it is larger or NaN, otherwise self; NaN if either is NaN.
    #[must_use]
    #[inline(always)]
    fn max_or_nan(self, simd: S, other: Self) -> Self {
        let (mut values, mut others) = (Self::ZEROS, Self::ZEROS);
        self.store(&mut values);
        other.store(&mut others);
        for (value, &mut other) in values.as_mut().iter_mut().zip(others.as_mut()) {
            // By value, so that the comparison is vectorised.
            let (v, larger) = (*value, other > *value);
            *value = if larger | other.is_nan() { other } else { v };
        }
        Self::load(simd, &values)
    }
    /// Bit i is set if element i is at most that of `other`; clear if either is NaN.
    #[must_use]
    fn at_most(self, other: Self) -> u32;
    /// Bit i is set if the bits of element i differ from those in `other`.
    #[must_use]
    fn differs(self, other: Self) -> u32;

    /// Applies `f` to every element; branch-free, the compiler can vectorise it.
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

/// A sum of products as it grows, in the form to which the next product is added fastest. With a
/// fused product this is the vector itself. With another form, it may be unclear at the end whether
/// each product was rounded once with the sum: then the sum must be computed again with vectors.
pub trait Sum<S>: Copy {
    /// Form of the sum at the beginning and at the end.
    type Vector: Vector<S>;
    /// A factor of products.
    type Factor: Copy;
    /// What is known about all sums and factors that it was given.
    type Doubt: Copy;

    /// The state before any sum or factor.
    fn no_doubt(simd: S) -> Self::Doubt;
    /// Whether the sums are right.
    fn is_right(doubt: Self::Doubt) -> bool;
    /// The sum before the first product.
    fn from_vector(simd: S, vector: Self::Vector, doubt: &mut Self::Doubt) -> Self;
    /// The sum after the last.
    fn to_vector(self) -> Self::Vector;
    /// Factors, element by element.
    fn factor(simd: S, vector: Self::Vector, doubt: &mut Self::Doubt) -> Self::Factor;
    /// One factor of all elements.
    fn factor_of_all(simd: S, value: f32, doubt: &mut Self::Doubt) -> Self::Factor;
    /// self + a b.
    #[must_use]
    fn plus_product(self, a: Self::Factor, b: Self::Factor, doubt: &mut Self::Doubt) -> Self;
}

impl<S: Copy, V: Vector<S>> Sum<S> for V {
    type Vector = V;
    type Factor = V;
    type Doubt = ();

    #[inline(always)]
    fn no_doubt(_: S) -> Self::Doubt {}
    #[inline(always)]
    fn is_right((): Self::Doubt) -> bool {
        true
    }
    #[inline(always)]
    fn from_vector(_: S, vector: V, (): &mut Self::Doubt) -> Self {
        vector
    }
    #[inline(always)]
    fn to_vector(self) -> V {
        self
    }
    #[inline(always)]
    fn factor(_: S, vector: V, (): &mut Self::Doubt) -> V {
        vector
    }
    #[inline(always)]
    fn factor_of_all(simd: S, value: f32, (): &mut Self::Doubt) -> V {
        V::splat(simd, value)
    }
    #[inline(always)]
    fn plus_product(self, a: V, b: V, (): &mut Self::Doubt) -> Self {
        self.add_product(a, b)
    }
}

/// A register of f32 with division and with operations on the bits.
pub trait Exponent<S>: Vector<S> {
    /// self / other.
    #[must_use]
    fn div(self, other: Self) -> Self;
    /// 2^(n + more), where self is 1.5 2^23 + n and -126 <= n + more <= 127.
    #[must_use]
    fn power_of_two(self, simd: S, more: i32) -> Self;
    /// The magnitude of self with the sign of `of`.
    #[must_use]
    fn with_sign(self, simd: S, of: Self) -> Self;
    /// Self where `of` has the sign bit, otherwise `other`.
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

/// An integer to divide by.
///
/// With y = RN(1 / b), q = RN(a y), r = a - b q, RN(q + r y) (Markstein, IBM Journal of Research
/// and Development, 1990) is RN(a / b) for integers |a| < 2^53, 1 <= b <= 2^48. Let u = 2^-53:
///
/// - q is within 2.01 u |a / b|. So r is a multiple of ulp(q) below 2.01 b ulp(q): at most 50
///   bits, computed exactly.
/// - q + r y is off by |a / b - q| times y's relative error: <= 2.01 u^2 |a / b| <= 2.01 u ulp.
/// - Halfway points between two f64 near a / b are odd multiples of h = ulp / 2, never a / b: a
///   would have 54 bits. a minus b times a halfway point is a multiple of h, not 0, so a / b is at
///   least h / b >= 2^-49 ulp from it. The sum above lies on the same side, and rounds as a / b
///   does.
#[derive(Clone, Copy, Debug)]
pub struct Divisor {
    value: f64,
    inverse: f64,
}

impl Divisor {
    /// The largest divisor.
    pub const MAX: i64 = 1 << 48;

    /// Division by `value`.
    ///
    /// # Panics
    /// If `value` is not within 1 and [`Self::MAX`].
    pub fn new(value: i64) -> Self {
        assert!((1..=Self::MAX).contains(&value), "a divisor is within its limits");
        Self { value: value as f64, inverse: 1.0 / value as f64 }
    }

    /// The divisor.
    #[inline(always)]
    pub fn value(self) -> f64 {
        self.value
    }

    /// a / divisor, rounded once, of an integer |a| < 2^53.
    #[inline(always)]
    pub fn divide<S: Simd>(self, _: S, a: f64) -> f64 {
        if !S::FUSED {
            return a / self.value;
        }
        let quotient = a * self.inverse;
        let rest = (-quotient).mul_add(self.value, a);
        rest.mul_add(self.inverse, quotient)
    }
}
