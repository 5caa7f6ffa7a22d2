//! The folder of recordings and golden files, which may be absent. Several crates include this.
#![allow(dead_code, unreachable_pub, reason = "each crate uses a part of it, and one exports it")]

use std::path::{Path, PathBuf};

/// `path` in the folder that `MEISSNER_SHARED` names, else in `shared` beside the workspace, if it
/// exists.
pub fn find_shared(path: &str) -> Option<PathBuf> {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let root = folders.find(|folder| folder.join("Cargo.lock").exists())?;
    let named = std::env::var_os("MEISSNER_SHARED").filter(|folder| !folder.is_empty());
    let file = named.map_or(root.join("../shared"), PathBuf::from).join(path);
    file.exists().then_some(file)
}

/// `path` in the shared folder, for tests marked `#[cfg_attr(no_shared, ignore = "no ../shared")]`.
///
/// # Panics
/// If it does not exist.
#[track_caller]
pub fn shared(path: &str) -> PathBuf {
    find_shared(path).unwrap_or_else(|| {
        panic!("no ../shared/{path}: set MEISSNER_SHARED, or ignore the test with cfg(no_shared)")
    })
}
