//! Division of many integers by the same one, without divisions.
//!
//! With y = RN(1 / b), q = RN(a y), r = a - b q, RN(q + r y) (Markstein, IBM Journal of Research
//! and Development, 1990) is RN(a / b) for integers |a| < 2^53, 1 <= b <= 2^48. Let u = 2^-53:
//!
//! - q is within 2.01 u |a / b|. So r is a multiple of ulp(q) below 2.01 b ulp(q): at most 50 bits,
//!   computed exactly.
//! - q + r y is off by |a / b - q| times y's relative error: <= 2.01 u^2 |a / b| <= 2.01 u ulp.
//! - Halfway points between two f64 near a / b are odd multiples of h = ulp / 2, never a / b: a
//!   would have 54 bits. a - b times one is a multiple of h, not 0, so a / b is at least h / b >=
//!   2^-49 ulp from it. The sum above lies on the same side as a / b, and rounds as it does.

use super::vector::Simd;

/// An integer to divide by.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isa::{Isa, Task};
    use proptest::prelude::*;

    struct Divide(i64, i64);

    impl Task for Divide {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            Divisor::new(self.1).divide(simd, self.0 as f64)
        }
    }

    fn check(a: i64, b: i64) {
        for isa in Isa::available() {
            let found = isa.run(Divide(a, b));
            let expected = a as f64 / b as f64;
            assert_eq!(found.to_bits(), expected.to_bits(), "{a} / {b}, {}", isa.name());
        }
    }

    #[test]
    fn the_columns_of_a_sensor_are_divided_exactly() {
        for b in [1, 3, 260, 346, 720, 1280, 65_535] {
            for a in 0..b {
                check(a, b);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200_000))]

        #[test]
        fn any_integer_is_divided_exactly(
            a in 0i64..1 << 53,
            short in 0u32..53,
            b in 1..=Divisor::MAX,
            shorter in 0u32..48,
            near in -2i64..=2,
        ) {
            let (a, b) = (a >> short, (b >> shorter).max(1));
            check(a, b);
            check(-a - 1, b);
            // Near a quotient with few bits, and near one that is halfway between two f64.
            let multiple = (a / b).saturating_mul(b).saturating_add(near);
            check(multiple.clamp(1 - (1 << 53), (1 << 53) - 1), b);
            let odd = ((1 << 53) - 1 - 2 * i64::from(short)) / b * b + near;
            check(odd.clamp(1 - (1 << 53), (1 << 53) - 1), b);
        }
    }
}
