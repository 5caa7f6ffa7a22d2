//! Networks in f64, one value after the other, to measure rounding by.
//!
//! Enters: the parameters of a network and its stream or frames. Leaves: what every layer computes, in f64. Nothing is
//! shared with kernels and engine but the parameters and the exact integers and fractions in which pixels, times and cells
//! are given. Every sum is a plain loop, so that the code can be read beside the equations; errors of f64 are 2^29 times
//! smaller than those that are measured. Elementary functions are the platform's, and results may differ in their last bits
//! from machine to machine.
#![forbid(unsafe_code)]

mod activation;
mod difference;
mod error;
mod events;
mod frames;
mod spline;
mod ulp;

pub use activation::{activated, elementary, elu, sigmoid};
pub use difference::Difference;
pub use error::ReferenceError;
pub use events::{EventReference, EventTrace, ReferenceLevel, Rows};
pub use frames::FrameReference;
pub use spline::{BatchNorm, Norm};
pub use ulp::ulps;
