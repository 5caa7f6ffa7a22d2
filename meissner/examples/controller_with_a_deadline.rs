//! A control loop of 1 kHz beside a sensor that can be faster than the engine: each cycle has a prediction within half a
//! millisecond, fresh or with its age.
//!
//! ```text
//! cargo run --release -p meissner --example controller_with_a_deadline
//! ```

use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use meissner::live::{Live, Overload, QueueOptions};
use meissner::{Description, Engine, Event, Sensor, Weights};

const CYCLE: Duration = Duration::from_millis(1);
const DEADLINE: Duration = Duration::from_micros(500);
const CYCLES: u16 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let description = Description::shipped("tactigraph-past").ok_or("no such network")?;
    let weights = Weights::shipped("tactigraph-past").ok_or("no weights")?;
    let engine = Engine::new(description.network(&weights)?, Sensor::new(240, 180))?;
    // A controller wants recent events: where the queue is full, the oldest that waits makes room.
    let options = QueueOptions::new().with_capacity(4096).with_overload(Overload::DropOldest);
    let (mut input, mut live) = Live::spawn(engine, options)?;

    // The sensor: an edge that moves to the right, a column of 40 events every millisecond.
    let sensor = thread::spawn(move || {
        for cycle in 0..CYCLES {
            let column =
                (0..40).map(|i| Event::new(i64::from(cycle) * 1000 + i64::from(i), 60 + cycle, 70 + i, true));
            input.push_slice(&column.collect::<Vec<_>>())?;
            thread::sleep(CYCLE);
        }
        Ok::<_, meissner::live::LiveError>(())
    });

    let mut fresh = 0;
    let mut next = Instant::now();
    for _ in 0..CYCLES {
        let timely = live.predict(DEADLINE)?;
        // A real controller acts here on `timely.values`, and trusts them less the older they are.
        fresh += u32::from(timely.fresh);
        next += CYCLE;
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    sensor.join().map_err(|_| "the sensor's thread panicked")??;
    println!("{fresh} of {CYCLES} predictions were fresh; {:?}", live.counters());
    Ok(())
}
