//! Messages on standard error.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Writes `line` to standard error. Where that is closed or full, the program goes on without it: a message is no result.
pub(crate) fn tell(line: impl Display) {
    let _ = stderr().write_all(format!("{line}\n").as_bytes());
}
