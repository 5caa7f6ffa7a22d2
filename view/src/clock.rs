//! The clock of a session.

/// Microseconds from an arbitrary start; never decreases.
pub type Clock = fn() -> f64;
