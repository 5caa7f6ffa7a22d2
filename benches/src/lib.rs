//! Shared by all benches: streams, networks, checks of answers, costs, limits, clocks, tables.
#![forbid(unsafe_code)]

pub mod cost;
pub mod kernel_cases;
pub mod networks;
pub mod peak;
pub mod report;
pub mod streams;
pub mod suite;
#[cfg(test)]
mod tests;
pub mod timing;

/// The result of a program that prints any error.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;
