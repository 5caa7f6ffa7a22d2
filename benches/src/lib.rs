//! What the suites share: streams and networks to run, checks of answers, counts of operations and bytes, and the
//! machine's measured limits.
#![forbid(unsafe_code)]

pub mod achieved;
pub mod check;
pub mod conv_cases;
pub mod cost;
pub mod kernel_cases;
pub mod lap;
pub mod networks;
pub mod peak;
pub mod streams;
pub mod timing;
pub mod tree;
