//! Runs `meissner_tests::fixed_run` in this build, and fails if a bit differs.
//!
//!     cargo run --release -p meissner-tests --example fixed_run

use std::process::ExitCode;

use meissner_kernels::Isa;
use meissner_tests::fixed_run::{self, Mode};

fn main() -> ExitCode {
    let mut right = true;
    let mut say = |what: String, found: u64, expected: u64| {
        let verdict = if found == expected { "as always" } else { "DIFFERENT" };
        println!("{what:<22} {found:016x}  {verdict}");
        right &= found == expected;
    };
    for isa in Isa::available() {
        let events = fixed_run::of_events(Mode::Incremental { isa, two_threads: false });
        say(format!("events, {}", isa.name()), events, fixed_run::EVENTS_EXPECTED);
        say(format!("frames, {}", isa.name()), fixed_run::of_frames(isa, false), fixed_run::FRAMES_EXPECTED);
        say(format!("press, {}", isa.name()), fixed_run::of_press(isa), fixed_run::PRESS_EXPECTED);
    }
    // WebAssembly has no threads.
    for threads in [1, 2, 8].into_iter().filter(|_| !cfg!(target_family = "wasm")) {
        let batch = fixed_run::of_events(Mode::Batch { threads });
        say(format!("batch, {threads} threads"), batch, fixed_run::EVENTS_EXPECTED);
    }
    if right { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
