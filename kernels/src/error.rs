//! Errors in the sizes and values of a layer's parameters and inputs.

use thiserror::Error;

use crate::frames::shape::Region;

/// A layer cannot compute with its parameters or inputs.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum KernelError {
    /// The number of a tensor's values does not match its shape.
    #[error("{tensor}: expected {expected} values, found {found}")]
    Length {
        /// Name of the tensor.
        tensor: &'static str,
        /// Number of values according to the shape.
        expected: usize,
        /// Number of values found.
        found: usize,
    },
    /// A size is zero or beyond what the kernel can index.
    #[error("{what}: expected {expected}, found {found}")]
    Size {
        /// Name of the size.
        what: &'static str,
        /// The admissible range, in words.
        expected: &'static str,
        /// The size found.
        found: usize,
    },
    /// A parameter is NaN or infinite.
    #[error("{tensor}: expected finite values, found {value} at index {index}")]
    NotFinite {
        /// Name of the tensor.
        tensor: &'static str,
        /// Flat index in the tensor.
        index: usize,
        /// The value found.
        value: f32,
    },
    /// A map does not have the shape that a layer needs.
    #[error("{what}: expected {expected:?}, found {found:?}")]
    Shape {
        /// Name of the map, and of its size.
        what: &'static str,
        /// Expected sizes.
        expected: [usize; 3],
        /// Sizes found.
        found: [usize; 3],
    },
    /// A region reaches beyond its map, or does not lie on the kernel's tiles.
    #[error("region {found:?}: expected {expected} of {height} x {width} outputs")]
    Region {
        /// The admissible regions, in words.
        expected: &'static str,
        /// Rows of outputs.
        height: usize,
        /// Number of outputs in a row.
        width: usize,
        /// The region found.
        found: Region,
    },
}

/// Largest number of channels of a convolution.
pub(crate) const MAX_CHANNELS: usize = 1 << 16;

/// Refuses sizes of zero. Errors: [`KernelError::Size`].
pub(crate) fn check_sizes<const N: usize>(sizes: [(&'static str, usize); N]) -> Result<(), KernelError> {
    let zero = sizes.into_iter().find(|&(_, size)| size == 0);
    zero.map_or(Ok(()), |(what, found)| Err(KernelError::Size { what, expected: "at least 1", found }))
}

/// Refuses numbers of channels of zero or above [`MAX_CHANNELS`]. Errors: [`KernelError::Size`].
pub(crate) fn check_channels(inputs: &[usize], outputs: usize) -> Result<(), KernelError> {
    let sizes = inputs.iter().map(|&inputs| ("input channels", inputs)).chain([("output channels", outputs)]);
    for (what, found) in sizes {
        if found == 0 || found > MAX_CHANNELS {
            return Err(KernelError::Size { what, expected: "1 to 65536", found });
        }
    }
    Ok(())
}

/// Refuses a tensor of the wrong length, or one that holds NaN or an infinity. Errors:
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
