//! A target: a function over bytes with a name.

/// The outcome of an input. A broken promise is a panic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The input gave a result that keeps its promises.
    Accepted,
    /// The input was refused with a typed error.
    Refused,
}

/// A function over bytes that panics where a promise is broken.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is also that of its corpus and of its cargo-fuzz binary.
    pub name: &'static str,
    /// The function.
    pub run: fn(&[u8]) -> Verdict,
}
