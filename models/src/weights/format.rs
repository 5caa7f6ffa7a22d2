//! Why bytes are not weights.

use thiserror::Error;

/// Bytes that are not a weights file that is understood.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FormatError {
    /// Not a valid safetensors file (and not a zip archive).
    #[error("expected a safetensors file or a zip archive of torch.save, found neither: {0}")]
    Safetensors(String),
    /// A file of `torch.save` from before it wrote zip archives.
    #[error(
        "expected a zip archive, found the format torch.save had before version 1.6: load and save it again in PyTorch"
    )]
    Legacy,
    /// A zip archive that is damaged or not of the plain kind `torch.save` writes.
    #[error("zip archive: {what}: expected {expected}, found {found}")]
    Zip {
        /// Where in the archive.
        what: String,
        /// What should be there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The archive's pickle has an instruction, a global or a value that a state dict does not need.
    #[error("pickle, byte {at}: expected {expected}, found {found}")]
    Pickle {
        /// Offset in `data.pkl`.
        at: usize,
        /// What a state dict has.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// The archive holds no state dict.
    #[error("expected a state dict, or a checkpoint with one as {expected}; found {found}")]
    NoStateDict {
        /// Keys that are looked for.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A tensor does not fit the bytes it refers to.
    #[error("tensor {tensor:?}: {what}: expected {expected}, found {found}")]
    Tensor {
        /// Its name.
        tensor: String,
        /// What does not fit.
        what: &'static str,
        /// What would fit.
        expected: String,
        /// What came.
        found: String,
    },
}

/// As much of a name as a message quotes, without control characters.
pub(super) fn quoted(name: &str) -> String {
    const MOST: usize = 120;
    let mut quoted: String = name.chars().take(MOST).flat_map(char::escape_debug).collect();
    if name.chars().nth(MOST).is_some() {
        quoted.push_str("..");
    }
    quoted
}
