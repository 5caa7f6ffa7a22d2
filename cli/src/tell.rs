//! Messages on standard error.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Writes `line` to standard error. Failures are ignored, since a message is not a result.
pub(crate) fn tell(line: impl Display) {
    let _ = stderr().write_all(format!("{line}\n").as_bytes());
}

/// Warnings of libraries, written to standard error.
struct Warnings;

impl log::Log for Warnings {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn && metadata.target().starts_with("meissner")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            tell(format_args!("warning: {}", record.args()));
        }
    }

    fn flush(&self) {}
}

/// Writes warnings of libraries to standard error from now on.
pub(crate) fn tell_warnings() {
    // Fails only if another logger is installed. That logger then gets the warnings.
    if log::set_logger(&Warnings).is_ok() {
        log::set_max_level(log::LevelFilter::Warn);
    }
}
