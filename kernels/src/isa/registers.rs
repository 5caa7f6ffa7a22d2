//! [`Vector`](super::Vector) over one register, through the intrinsics of an instruction set.

/// Implements `Vector<$simd>` for `$vector`, a register of `$n` f32 made with a `$simd` only.
macro_rules! register {
    ($simd:ty, $vector:ident, $n:expr, $memory:ty, [$set1:ident, $load:ident, $store:ident], [$add:ident, $sub:ident, $mul:ident, $fused:ident, $max:ident], [$at_most:expr, $differs:expr]) => {
        impl Vector<$simd> for $vector {
            type Memory = $memory;
            type Sum = Self;
            const LANES: usize = $n;
            const ZEROS: $memory = <$memory>::ZERO;

            #[inline(always)]
            fn splat(_: $simd, value: f32) -> Self {
                // SAFETY: the first argument is the proof that the processor has the instruction.
                Self(unsafe { $set1(value) })
            }
            #[inline(always)]
            fn load(_: $simd, from: &$memory) -> Self {
                // SAFETY: proven as above; `from` is as many readable f32 as the register holds.
                Self(unsafe { $load(from.0.as_ptr()) })
            }
            #[inline(always)]
            fn load_slice(_: $simd, from: &[f32]) -> Self {
                let from = &from[..$n];
                // SAFETY: proven as above; `from` is as many readable f32 as the register holds.
                Self(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut $memory) {
                // SAFETY: a vector exists after its proof alone; `to` is as many writable f32.
                unsafe { $store(to.0.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn store_slice(self, to: &mut [f32]) {
                let to = &mut to[..$n];
                // SAFETY: a vector exists after its proof alone; `to` is as many writable f32.
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $add(self.0, other.0) })
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $sub(self.0, other.0) })
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $mul(self.0, other.0) })
            }
            #[inline(always)]
            fn add_product(self, a: Self, b: Self) -> Self {
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $fused(a.0, b.0, self.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // The instruction returns its second operand if either is NaN.
                // SAFETY: a vector exists after its proof alone.
                Self(unsafe { $max(other.0, self.0) })
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> u32 {
                // SAFETY: a vector exists after its proof alone.
                unsafe { $at_most(self.0, other.0) }
            }
            #[inline(always)]
            fn differs(self, other: Self) -> u32 {
                // SAFETY: a vector exists after its proof alone.
                unsafe { $differs(self.0, other.0) }
            }
        }
    };
}

/// Implements [`Exponent`] for a register, through the intrinsics of an instruction set.
macro_rules! exponent {
    ($simd:ty, $vector:ident, [$set1:ident, $div:ident, $and:ident, $andnot:ident, $or:ident],
     [$set1_i:ident, $shift:ident, $add_i:ident, $to_i:ident, $to_f:ident], $blend:expr) => {
        impl $crate::isa::vector::Exponent<$simd> for $vector {
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

pub(super) use {exponent, register};
