//! The binary of every fuzz target: runs the target of its name.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| meissner_fuzz::run(env!("CARGO_BIN_NAME"), bytes));
