//! Pushes and predicts under the real-time sanitizer, which stops the program at a call that may
//! block.
//!
//!     .ci/sanitize realtime
//!
//! Without `--cfg meissner_realtime`, which needs a nightly toolchain, nothing is checked.
#![cfg_attr(meissner_realtime, feature(sanitize))]

use meissner_engine::{Engine, EngineError, Event, Sensor};
use meissner_models::{Description, Weights};
use meissner_verify::Random;

const SENSOR: Sensor = Sensor { width: 240, height: 180 };
const EVENTS: i64 = 5_000;

/// An event and its prediction.
#[cfg_attr(meissner_realtime, sanitize(realtime = "nonblocking"))]
fn step(engine: &mut Engine, event: Event) -> Result<f32, EngineError> {
    engine.push(event);
    Ok(engine.predict()?.values[0])
}

fn main() -> Result<(), EngineError> {
    for name in ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"] {
        let weights = Weights::shipped(name).expect("shipped weights");
        let network = Description::shipped(name).expect("a shipped network").network(&weights);
        let mut engine = Engine::new(network.expect("the weights fit"), SENSOR)?;
        let mut random = Random::new(4);
        for i in 0..EVENTS {
            let (dot, dx, dy) = (random.below(30), random.below(9), random.below(9));
            let (x, y) = ((dot % 6 * 36 + dx) as u16, (dot / 6 * 34 + dy) as u16);
            step(&mut engine, Event::new(i * 100, x, y, random.below(2) == 0))?;
        }
        println!("{name}: {EVENTS} events and predictions");
    }
    Ok(())
}
