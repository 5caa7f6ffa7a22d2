//! Many engines that take turns on one thread: the cost of another sensor in time and memory.
//! `cargo run --release -p meissner-benches --example engines -- [NETWORK]`.
//!
//! Each engine has the synthetic dots at 5,000 events per second, with a different start. In each
//! millisecond every engine takes its events as a slice and predicts. Each row is measured in a
//! separate process, because freed memory stays with a process. Times are of the second half.

use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use meissner_benches::streams::Recording;
use meissner_benches::{Result, networks};
use meissner_engine::{Engine, Event, Network, Sensor};
use meissner_run::memory::resident_bytes;
use meissner_verify::bits;

const ENGINES: [usize; 4] = [1, 8, 64, 512];
/// Slices of all engines together.
const SLICES: usize = 200_000;
const STEP_US: i64 = 1000;
/// Stream time from the start of one fingertip to that of the next.
const APART: usize = 300;
/// Factor by which the fingertips are slower than the synthetic dots.
const SLOWER: f64 = 9.4;
const MIB: f64 = (1 << 20) as f64;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let name = arguments.first().map_or("tactigraph-past", String::as_str);
    if let Some(engines) = arguments.get(1) {
        return row(name, engines.parse()?);
    }
    println!(
        "{name}: engines, events/s, slice and prediction p50 / p99 (us), MiB an engine declared / idle / used"
    );
    for engines in ENGINES {
        let status = Command::new(std::env::current_exe()?).args([name, &engines.to_string()]).status()?;
        if !status.success() {
            return Err(format!("{engines} engines: {status}").into());
        }
    }
    Ok(())
}

/// Measures and prints a row of the table.
fn row(name: &str, count: usize) -> Result<()> {
    let network = networks::shipped(name);
    let slices = SLICES / count;
    let stream = Slices::new(count * APART + slices);
    let before = resident_bytes().unwrap_or(0);
    let engine = || -> Result<Engine> { Ok(Engine::new(Arc::clone(&network), stream.sensor)?) };
    let mut engines = (0..count).map(|_| engine()).collect::<Result<Vec<_>>>()?;
    let idle = resident_bytes().unwrap_or(0);
    let (mut times_us, mut events) = (Vec::with_capacity(SLICES), 0);
    for at in 0..slices {
        for (number, engine) in engines.iter_mut().enumerate() {
            let slice = stream.slice(number * APART + at);
            let start = Instant::now();
            engine.push_slice(slice);
            engine.predict()?;
            if at >= slices / 2 {
                times_us.push(start.elapsed().as_secs_f64() * 1e6);
                events += slice.len();
            }
        }
    }
    let used = resident_bytes().unwrap_or(0);
    check(&network, &stream, &mut engines[count - 1], (count - 1) * APART, slices)?;
    let seconds = times_us.iter().sum::<f64>() / 1e6;
    times_us.sort_by(f64::total_cmp);
    let quantile = |share: f64| times_us[((times_us.len() - 1) as f64 * share) as usize];
    let each = |bytes: u64| bytes.saturating_sub(before) as f64 / count as f64 / MIB;
    println!(
        "{count:>4} {:>10.0} {:>8.2} / {:>6.2} {:>8.2} / {:.2} / {:.2}",
        events as f64 / seconds,
        quantile(0.5),
        quantile(0.99),
        engines[0].state_bytes() as f64 / MIB,
        each(idle),
        each(used),
    );
    Ok(())
}

/// Checks that the engine predicts the same as one that gets the events one by one.
fn check(
    network: &Arc<Network>,
    stream: &Slices,
    engine: &mut Engine,
    from: usize,
    count: usize,
) -> Result<()> {
    let mut singly = Engine::new(Arc::clone(network), stream.sensor)?;
    for &event in (from..from + count).flat_map(|at| stream.slice(at)) {
        singly.push(event);
    }
    if bits(engine.predict()?.values) != bits(singly.predict()?.values) {
        return Err("slices and single events differ".into());
    }
    Ok(())
}

/// A stream, cut at each [`STEP_US`].
struct Slices {
    sensor: Sensor,
    events: Vec<Event>,
    /// Index of the first event of each slice, and their end.
    starts: Vec<usize>,
}

impl Slices {
    /// At least `count` slices.
    fn new(count: usize) -> Self {
        // 5.1 events a millisecond in the mean, and some more to be sure.
        let Recording { sensor, mut events, .. } = Recording::synthetic(count * 6 + 1000);
        events.iter_mut().for_each(|event| event.t_us = (event.t_us as f64 * SLOWER) as i64);
        let start = |at: usize| events.partition_point(|event| event.t_us < at as i64 * STEP_US);
        let starts = (0..=count).map(start).collect();
        Self { sensor, events, starts }
    }

    fn slice(&self, at: usize) -> &[Event] {
        &self.events[self.starts[at]..self.starts[at + 1]]
    }
}
