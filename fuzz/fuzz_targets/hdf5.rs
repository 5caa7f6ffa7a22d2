#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| meissner_fuzz::run("hdf5", bytes));
