//! Random values, made in one piece: a large weight has half a million, and most of a test's time
//! would go into strategies of single values.

use proptest::prelude::*;

/// `n` values of -2 to 2, a third of them zeros of both signs. Their number shrinks, the values
/// do not.
pub(crate) fn values(n: usize) -> impl Strategy<Value = Vec<f32>> {
    Just(()).prop_perturb(move |(), mut rng| {
        let mut value = || {
            let bits = rng.next_u32();
            match bits % 6 {
                0 => 0.0,
                1 => -0.0,
                _ => bits as f32 / u32::MAX as f32 * 4.0 - 2.0,
            }
        };
        (0..n).map(|_| value()).collect()
    })
}
