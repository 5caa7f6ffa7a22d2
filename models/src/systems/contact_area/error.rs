//! What can be wrong with a setting, an image or a map.

use thiserror::Error;

/// A setting, an image or a map does not fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A setting is outside what it may be.
    #[error("{what}: expected {expected}, found {found}")]
    Setting {
        /// Which setting.
        what: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// A buffer has another length than the images.
    #[error("{what}: expected {expected} values, found {found}")]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Length that fits.
        expected: usize,
        /// Its length.
        found: usize,
    },
    /// A map holds a value that is NaN or infinite.
    #[error("{what}: expected finite values, found {found} at column {column}, row {row}")]
    NotFinite {
        /// Which map.
        what: &'static str,
        /// The pixel's column.
        column: usize,
        /// The pixel's row.
        row: usize,
        /// The value.
        found: f32,
    },
}

/// `Ok` where `found` is `expected`.
pub(super) fn same_length(what: &'static str, expected: usize, found: usize) -> Result<(), ContactError> {
    if found == expected { Ok(()) } else { Err(ContactError::Length { what, expected, found }) }
}

/// `Ok` where `holds`.
pub(super) fn setting(
    what: &'static str,
    expected: &'static str,
    found: f64,
    holds: bool,
) -> Result<(), ContactError> {
    if holds { Ok(()) } else { Err(ContactError::Setting { what, expected, found }) }
}
