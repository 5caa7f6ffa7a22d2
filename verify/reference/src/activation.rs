//! Elementary functions in f64, from the platform's exp, expm1 and tanh.

use meissner_kernels::{Activation, Elementary};

/// x for x > 0, else e^x - 1.
pub(crate) fn elu(x: f64) -> f64 {
    if x > 0.0 { x } else { x.exp_m1() }
}

/// 1 / (1 + e^-x).
pub(crate) fn sigmoid(x: f64) -> f64 {
    // From e^x for x < 0: e^-x would overflow although the result is representable.
    if x < 0.0 { x.exp() / (1.0 + x.exp()) } else { 1.0 / (1.0 + (-x).exp()) }
}

/// Applies a layer's activation to its sum `x`.
pub(crate) fn activated(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::Identity => x,
        Activation::Relu => x.max(0.0),
        Activation::Elu => elu(x),
        Activation::Sigmoid => sigmoid(x),
        Activation::Tanh => x.tanh(),
    }
}

/// The exact function that `function` approximates.
pub fn elementary(function: Elementary, x: f64) -> f64 {
    match function {
        Elementary::Exp => x.exp(),
        Elementary::Expm1 => x.exp_m1(),
        Elementary::Elu => elu(x),
        Elementary::Sigmoid => sigmoid(x),
        Elementary::Tanh => x.tanh(),
    }
}
