//! The binary of every fuzz target: runs the target with the name of its file, so that one build
//! under other names serves all targets.
#![no_main]
use std::path::Path;
use std::sync::LazyLock;

/// The target's name.
static NAME: LazyLock<String> = LazyLock::new(|| {
    let program = std::env::args().next().expect("a program has a name");
    Path::new(&program).file_name().expect("a program is a file").to_string_lossy().into_owned()
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| meissner_fuzz::run(&NAME, bytes));
