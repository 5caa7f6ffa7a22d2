//! What elementary functions need beyond sums and products.

use super::Vector;

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

/// 2^(n + more), where `shifted` is 1.5 2^23 + n.
#[inline(always)]
fn power_of_two(shifted: f32, more: i32) -> f32 {
    // The shift leaves n, modulo 2^9, where the exponent is.
    f32::from_bits((shifted.to_bits() << 23).wrapping_add(((127 + more) << 23) as u32))
}

/// Implements [`Exponent`] for a register, from an instruction set's own names.
#[cfg(target_arch = "x86_64")]
macro_rules! exponent {
    ($simd:ty, $vector:ident, [$set1:ident, $div:ident, $and:ident, $andnot:ident, $or:ident],
     [$set1_i:ident, $shift:ident, $add_i:ident, $to_i:ident, $to_f:ident], $blend:expr) => {
        impl $crate::isa::Exponent<$simd> for $vector {
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $div(self.0, other.0) })
            }
            #[inline(always)]
            fn power_of_two(self, _: $simd, more: i32) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $to_f($add_i($shift::<23>($to_i(self.0)), $set1_i((127 + more) << 23))) })
            }
            #[inline(always)]
            fn with_sign(self, _: $simd, of: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe {
                    let sign = $set1(-0.0);
                    $or($and(sign, of.0), $andnot(sign, self.0))
                })
            }
            #[inline(always)]
            fn where_negative(self, of: Self, other: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $blend(self.0, of.0, other.0) })
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
pub(super) use exponent;

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

/// Plain arrays.
macro_rules! array {
    ($n:expr) => {
        impl Exponent<super::Portable> for [f32; $n] {
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                std::array::from_fn(|i| self[i] / other[i])
            }
            #[inline(always)]
            fn power_of_two(self, _: super::Portable, more: i32) -> Self {
                std::array::from_fn(|i| power_of_two(self[i], more))
            }
            #[inline(always)]
            fn with_sign(self, _: super::Portable, of: Self) -> Self {
                std::array::from_fn(|i| self[i].copysign(of[i]))
            }
            #[inline(always)]
            fn where_negative(self, of: Self, other: Self) -> Self {
                std::array::from_fn(|i| if of[i].is_sign_negative() { self[i] } else { other[i] })
            }
        }
    };
}

array!(8);
array!(16);
