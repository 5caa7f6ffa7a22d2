//! The header matches the library.

use std::path::Path;

/// `include/meissner.h` is what cbindgen generates from the source. If `MEISSNER_WRITE` is set, the
/// test writes it.
#[test]
fn the_header_is_made_from_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("a configuration");
    let made = cbindgen::Builder::new().with_crate(folder).with_config(config).generate().expect("a header");
    let mut text = Vec::new();
    made.write(&mut text);
    let path = folder.join("include/meissner.h");
    if std::env::var_os("MEISSNER_WRITE").is_some() {
        std::fs::write(&path, &text).expect("the header can be written");
    }
    let kept = std::fs::read(&path).unwrap_or_default();
    assert!(kept == text, "run MEISSNER_WRITE=1 cargo test -p meissner-c --test header");
}
