//! Elementary functions of many values, as the kernels use them: in place, with the bits of the
//! scalar functions.

use crate::elementary::{
    divided, elu, elus, exp, expm1, expm1s, sigmoid, sigmoid_quotients, tanh, tanh_quotients,
};
use crate::isa::{Isa, Simd, Task, Vector};
use crate::lanes::LANES;

/// An elementary function of one f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elementary {
    /// [`exp`].
    Exp,
    /// [`expm1`].
    Expm1,
    /// [`elu`].
    Elu,
    /// [`sigmoid`].
    Sigmoid,
    /// [`tanh`].
    Tanh,
}

impl Elementary {
    /// All functions.
    pub const ALL: [Self; 5] = [Self::Exp, Self::Expm1, Self::Elu, Self::Sigmoid, Self::Tanh];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exp => "exp",
            Self::Expm1 => "expm1",
            Self::Elu => "elu",
            Self::Sigmoid => "sigmoid",
            Self::Tanh => "tanh",
        }
    }

    /// Its largest error over all f32, in ULP of the correctly rounded result.
    pub fn bound(self) -> f64 {
        match self {
            Self::Exp => 1.1,
            Self::Expm1 | Self::Elu => 1.4,
            Self::Sigmoid | Self::Tanh => 2.5,
        }
    }

    /// Its value at `x`.
    pub fn of(self, x: f32) -> f32 {
        match self {
            Self::Exp => exp(x),
            Self::Expm1 => expm1(x),
            Self::Elu => elu(x),
            Self::Sigmoid => sigmoid(x),
            Self::Tanh => tanh(x),
        }
    }

    /// Replaces each of `values` by the function's value. O(values).
    pub fn apply(self, isa: Isa, values: &mut [f32]) {
        isa.run(Apply { function: self, values });
    }
}

struct Apply<'a> {
    function: Elementary,
    values: &'a mut [f32],
}

impl Task for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let mut chunks = self.values.chunks_exact_mut(2 * LANES);
        for chunk in &mut chunks {
            vector(simd, self.function, chunk);
        }
        let rest = chunks.into_remainder();
        let mut padded = [0.0; 2 * LANES];
        padded[..rest.len()].copy_from_slice(rest);
        vector(simd, self.function, &mut padded);
        rest.copy_from_slice(&padded[..rest.len()]);
    }
}

/// Applies the function to whole vectors.
#[inline(always)]
fn vector<S: Simd>(simd: S, function: Elementary, values: &mut [f32]) {
    let x = S::V16::load_slice(simd, values);
    let [y] = match function {
        Elementary::Exp => [x.map(simd, exp)],
        Elementary::Expm1 => expm1s(simd, [x]),
        Elementary::Elu => elus(simd, [x]),
        Elementary::Sigmoid => divided(sigmoid_quotients(simd, [x])),
        Elementary::Tanh => divided(tanh_quotients(simd, [x])),
    };
    y.store_slice(values);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_give_the_bits_of_the_scalar_functions_on_every_instruction_set() {
        let inputs: Vec<f32> = (0..=u32::MAX).step_by(65_519).map(f32::from_bits).collect();
        assert_ne!(inputs.len() % (2 * LANES), 0, "some values are left over");
        for function in Elementary::ALL {
            let expected: Vec<f32> = inputs.iter().map(|&x| function.of(x)).collect();
            for isa in Isa::available() {
                let mut values = inputs.clone();
                function.apply(isa, &mut values);
                for ((x, got), want) in inputs.iter().zip(&values).zip(&expected) {
                    let equal = got.to_bits() == want.to_bits() || (got.is_nan() && want.is_nan());
                    assert!(equal, "{} of {x:e} with {}: {got:e}, {want:e}", function.name(), isa.name());
                }
            }
        }
    }
}
