//! Errors in the sizes and numbers that a layer is given.

use thiserror::Error;

use crate::frames::shape::Region;

/// A layer was given parameters that it cannot compute with.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum KernelError {
    /// A tensor holds another number of values than its shape asks for.
    #[error("{tensor}: expected {expected} values, found {found}")]
    Length {
        /// Which tensor.
        tensor: &'static str,
        /// Values that the shape asks for.
        expected: usize,
        /// Values that came.
        found: usize,
    },
    /// A size is zero or beyond what the kernel can index.
    #[error("{what}: expected {expected}, found {found}")]
    Size {
        /// Which size.
        what: &'static str,
        /// The admissible range, in words.
        expected: &'static str,
        /// The size that came.
        found: usize,
    },
    /// A parameter is NaN or infinite.
    #[error("{tensor}: expected finite values, found {value} at index {index}")]
    NotFinite {
        /// Which tensor.
        tensor: &'static str,
        /// Where in the tensor, counted flat.
        index: usize,
        /// The value found.
        value: f32,
    },
    /// A map does not have the shape that a layer asks for.
    #[error("{what}: expected {expected:?}, found {found:?}")]
    Shape {
        /// Which map, and which of its sizes.
        what: &'static str,
        /// Sizes asked for.
        expected: [usize; 3],
        /// Sizes that came.
        found: [usize; 3],
    },
    /// A region reaches beyond its map, or does not lie on the kernel's tiles.
    #[error("region {found:?}: expected {expected} of {height} x {width} outputs")]
    Region {
        /// The admissible regions, in words.
        expected: &'static str,
        /// Rows of outputs.
        height: usize,
        /// Outputs in a row.
        width: usize,
        /// The region that came.
        found: Region,
    },
}

/// Refuses a tensor of the wrong length, or one that holds NaN or an infinity.
///
/// # Errors
/// [`KernelError::Length`] or [`KernelError::NotFinite`].
pub(crate) fn check(tensor: &'static str, values: &[f32], expected: usize) -> Result<(), KernelError> {
    if values.len() != expected {
        return Err(KernelError::Length { tensor, expected, found: values.len() });
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(KernelError::NotFinite { tensor, index, value: values[index] }),
        None => Ok(()),
    }
}
