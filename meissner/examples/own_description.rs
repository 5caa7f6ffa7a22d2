//! Your own network: a description in TOML, weights from a seed, incremental and batch.
//!
//! ```text
//! cargo run --release -p meissner --example own_description
//! ```

use std::error::Error;

use meissner::{Batch, Description, Engine, Event, Sensor, Stream, draw};

/// Two spline blocks over the 8 nearest earlier events, a maximum over 2 x 2 cells, a dense layer.
const NETWORK: &str = r#"
[network]
name = "edge-direction"
span_us = 50000
capacity = 2048

[graph]
kind = "knn"
k = 8
candidates = "past"
lifetime = "frozen"
scale = 0.2

[[layer]]
name = "block1"
kind = "spline"
channels = 8
kernel = 2

[[layer]]
name = "block2"
kind = "spline"
channels = 16
kernel = 2

[[layer]]
name = "readout"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "out"
kind = "dense"
outputs = 2

[output]
names = ["x", "y"]
unit = "px/ms"
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let description = Description::parse(NETWORK)?;
    println!("{}", description.to_table());
    let weights = draw(&description, 7);
    let network = description.network(&weights)?;
    let sensor = Sensor::new(128, 96);

    let events: Vec<Event> = (0..1500_u16)
        .map(|i| Event::new(i64::from(i) * 20, 20 + i / 30, 20 + i * 7 % 50, i % 3 > 0))
        .collect();
    let mut engine = Engine::new(network, sensor)?;
    engine.push_slice(&events);
    let network = engine.network().clone();
    let incremental = engine.predict()?.values.to_vec();
    let from_scratch = Batch::new(network, sensor)?.forward(Stream::new(&events))?.prediction;
    assert!(incremental.iter().zip(&from_scratch).all(|(a, b)| a.to_bits() == b.to_bits()));
    println!("{incremental:?}, equal to full recomputation bit for bit");
    Ok(())
}
