//! Messages on standard error.

use std::fmt::Display;
use std::io::{Write, stderr};

use meissner_run::interrupt;

use crate::progress::above;

/// Writes `line` to standard error. Failures are ignored, since a message is not a result.
pub(crate) fn tell(line: impl Display) {
    let _ = above(|| interrupt::output(stderr()).write_all(format!("{line}\n").as_bytes()));
}

/// Messages of libraries, written to standard error.
struct Messages;

impl log::Log for Messages {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::max_level() && metadata.target().starts_with("meissner")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            match record.level() {
                log::Level::Warn => tell(format_args!("warning: {}", record.args())),
                level => {
                    let level = level.as_str().to_ascii_lowercase();
                    tell(format_args!("{level}: {}: {}", record.target(), record.args()));
                }
            }
        }
    }

    fn flush(&self) {}
}

/// Environment variable that names the minimum level of the messages of libraries.
pub(crate) const LOG: &str = "MEISSNER_LOG";

/// Writes messages of libraries to standard error from now on: warnings, or the levels that [`LOG`]
/// names.
pub(crate) fn install_logger() {
    let asked = std::env::var(LOG).ok();
    let level = asked.as_deref().map_or(Some(log::LevelFilter::Warn), |level| level.parse().ok());
    // Fails only if another logger is installed. That logger then gets the messages.
    if log::set_logger(&Messages).is_ok() {
        log::set_max_level(level.unwrap_or(log::LevelFilter::Warn));
    }
    if level.is_none() {
        tell(format_args!("warning: {LOG}: expected off, error, warn, info, debug or trace"));
    }
}
