//! Streams a recording through a network over events and prints a prediction every 10 ms of it.
//!
//! ```text
//! cargo run --release -p meissner --example stream_a_recording [RECORDING]
//! ```

// ANCHOR: book
use std::error::Error;

use meissner::{Description, Engine, Weights, io};

/// A simulated press and release.
const DEFAULT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../run/assets/dome_press.evt3");

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| DEFAULT.to_owned());
    let recording = io::read(path.as_ref())?;
    let sensor = recording.sensor.ok_or("the recording does not name the size of its sensor")?;

    let description = Description::shipped("tactigraph-past").ok_or("no such network")?;
    let weights = Weights::shipped("tactigraph-past").ok_or("no weights")?;
    let mut engine = Engine::new(description.network(&weights)?, sensor)?;

    let start_us = recording.events.first().ok_or("the recording is empty")?.t_us;
    let mut due_us = start_us + 10_000;
    for event in recording.events {
        // An event at the due time belongs to the window of the prediction.
        while event.t_us > due_us {
            engine.advance(due_us);
            let prediction = engine.predict()?;
            println!(
                "{:7.1} ms  {:4} events  {:?}",
                (due_us - start_us) as f64 / 1e3,
                prediction.nodes,
                prediction.values
            );
            due_us += 10_000;
        }
        engine.push(event);
    }
    println!("{:?}", engine.counters().events);
    Ok(())
}
// ANCHOR_END: book
