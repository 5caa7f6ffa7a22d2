//! Sets `no_shared` for crates whose tests read recordings and golden files, if there are none:
//! these tests then count as ignored, not as passed.

use std::env;
use std::path::{Path, PathBuf};

fn main() {
    let package = env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo");
    let root = Path::new(&package).ancestors().find(|folder| folder.join("Cargo.lock").exists());
    let beside = || root.map_or_else(PathBuf::new, |root| root.join("../shared"));
    let named = env::var_os("MEISSNER_SHARED").filter(|folder| !folder.is_empty());
    let folder = named.map_or_else(beside, PathBuf::from);
    println!("cargo::rustc-check-cfg=cfg(no_shared)");
    println!("cargo::rerun-if-env-changed=MEISSNER_SHARED");
    println!("cargo::rerun-if-env-changed=MEISSNER_REQUIRE_SHARED");
    // A file, because cargo would search a folder for changes. With a missing file, cargo would
    // compile the crate again in every build: a folder that is added later is found if
    // MEISSNER_SHARED names it.
    let readme = folder.join("README.md");
    if readme.exists() {
        println!("cargo::rerun-if-changed={}", readme.display());
    }
    if !folder.exists() && env::var_os("MEISSNER_REQUIRE_SHARED").is_none() {
        println!("cargo::rustc-cfg=no_shared");
    }
}
