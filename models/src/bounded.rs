//! Reads files up to a bound.
//!
//! Enters: a path and a bound. Leaves: the file's bytes. Invariant: at most one byte beyond the
//! bound is read, also from a device or pipe.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::ModelError;

/// The bytes of the file at `path`, `limit` at most.
pub(crate) fn read(path: &Path, limit: u64) -> Result<Vec<u8>, ModelError> {
    let unreadable = |source| ModelError::Read { path: path.to_owned(), source };
    let large = |found| ModelError::Large { path: path.to_owned(), limit, found };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    if length > limit {
        return Err(large(length));
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit { Err(large(limit + 1)) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::read;
    use crate::ModelError;

    #[test]
    fn a_file_of_the_bound_is_read_and_one_byte_more_is_refused() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 100]).expect("a place to write to");
        assert_eq!(read(&path, 100).expect("as long as the bound"), [7; 100]);
        let error = read(&path, 99).expect_err("longer");
        assert!(matches!(error, ModelError::Large { limit: 99, found: 100, .. }), "{error}");
        assert!(matches!(read(&folder.path().join("none"), 99), Err(ModelError::Read { .. })));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_without_an_end_is_refused_at_the_bound() {
        let error = read("/dev/zero".as_ref(), 1000).expect_err("without an end");
        assert!(matches!(error, ModelError::Large { limit: 1000, found: 1001, .. }), "{error}");
    }
}
