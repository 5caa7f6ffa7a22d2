//! Writes the recording that `meissner run` takes when it is given none: see [`scene`].
//!
//! ```text
//! cargo run --release -p meissner-pipeline --example make_default_recording -- pipeline/assets/press_release_synthetic.evt3
//! ```
#![forbid(unsafe_code)]

mod scene;

use std::path::PathBuf;
use std::process::ExitCode;

use meissner_io::Format;

fn main() -> ExitCode {
    let Some(path) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: make_default_recording OUT.evt3");
        return ExitCode::from(2);
    };
    let events = scene::press_and_release();
    match meissner_io::write(&path, Format::Evt3, Some(scene::SENSOR), &events) {
        Ok(()) => {
            println!("{} events", events.len());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
