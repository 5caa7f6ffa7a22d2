//! Messages on standard error.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Writes `line` to standard error. Where that is closed or full, the program goes on without it: a message is no result.
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

/// From now on, warnings of libraries are written to standard error.
pub(crate) fn tell_warnings() {
    // Fails only where another logger is installed, which gets them then.
    if log::set_logger(&Warnings).is_ok() {
        log::set_max_level(log::LevelFilter::Warn);
    }
}
