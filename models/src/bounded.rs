//! Reads files up to a bound.
//!
//! Enters: a path and a bound. Leaves: the file's bytes. Invariant: at most one byte beyond the
//! bound is read, also from a device or pipe.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::ModelError;

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
