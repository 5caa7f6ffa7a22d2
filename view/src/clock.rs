//! The clock of a session.

/// Microseconds from any start, never back.
pub type Clock = fn() -> f64;
