//! The errors of reading weights files.

use thiserror::Error;

/// The bytes are not a weights file that can be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum FormatError {
    /// Not a valid safetensors file (and not a zip archive).
    #[error("expected a safetensors file or a zip archive of torch.save, found neither: {0}")]
    Safetensors(String),
    /// A file of an old `torch.save`, which did not write zip archives.
    #[error(
        "expected a zip archive, found the format torch.save had before version 1.6: load and save it again in PyTorch"
    )]
    Legacy,
    /// A zip archive that is damaged, or that `torch.save` would not write.
    #[error("zip archive: {what}: expected {expected}, found {found}")]
    Zip { what: String, expected: String, found: String },
    /// The archive's pickle has an instruction, a global or a value that no state dict needs.
    #[error("pickle, byte {at}: expected {expected}, found {found}")]
    Pickle {
        /// Offset in `data.pkl`.
        at: usize,
        expected: &'static str,
        found: String,
    },
    /// The archive holds a whole module, or another object of a class. Nothing of it is executed.
    #[error(
        "pickle, byte {at}: expected a state dict, found an object of class \"{class}\", as {} writes it: \
         save the state dict alone, torch.save({}.state_dict(), \"weights.pth\"); nothing was executed",
        if is_script(class) { "torch.jit.save(model)" } else { "torch.save(model)" },
        if is_script(class) { "torch.jit.load(FILE)" } else { "model" }
    )]
    Object {
        /// Offset in `data.pkl`.
        at: usize,
        /// Its module and name.
        class: String,
    },
    /// The archive contains no state dict, or several.
    #[error(
        "expected a state dict, or a checkpoint with one as \"state_dict\", \"model_state_dict\", \"model\", \"net\" \
         or \"module\"; found {found}"
    )]
    NoStateDict { found: String },
    /// A tensor does not fit the bytes that it refers to.
    #[error("tensor {tensor:?}: {what}: expected {expected}, found {found}")]
    Tensor { tensor: String, what: &'static str, expected: String, found: String },
}

impl FormatError {
    pub(super) fn zip(what: &str, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Zip { what: quoted(what), expected: expected.into(), found: found.into() }
    }

    pub(super) fn tensor(
        tensor: &str,
        what: &'static str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Tensor { tensor: quoted(tensor), what, expected: expected.into(), found: found.into() }
    }
}

/// Whether a class belongs to a module that `torch.jit` compiled.
fn is_script(class: &str) -> bool {
    class.starts_with("__torch__")
}

/// The start of a name, without control characters, for messages.
pub(super) fn quoted(name: &str) -> String {
    const MAX: usize = 120;
    let mut quoted: String = name.chars().take(MAX).flat_map(char::escape_debug).collect();
    if name.chars().nth(MAX).is_some() {
        quoted.push_str("..");
    }
    quoted
}
