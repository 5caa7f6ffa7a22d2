//! The controller: 1 kHz, events from UDP or a recording, predictions by a deadline, targets for a wrist.
//!
//! ```text
//! cargo run --release -p meissner-controller --bin controller -- udp://127.0.0.1:5000
//! cargo run --release -p meissner-controller --bin controller -- RECORDING
//! cargo run --release -p meissner-controller --bin controller -- --study examples/controller/levelling.svg
//! ```
use std::alloc::System;
use std::error::Error;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use meissner::live::{Live, QueueOptions};
use meissner::{Description, Engine, Network, Sensor, Weights, io};
use meissner_controller::control::{Alone, Remote, Rhythm, Robot, run};
use meissner_controller::feed::{Feed, Source};
use meissner_controller::fingertip::{Fingertip, SENSOR, presses};
use meissner_controller::metered::{Meter, Metered};
use meissner_controller::realtime::{lock_memory, now, priority, raise, sleep_until};
use meissner_controller::study::{CASES, level, picture};
use meissner_controller::surface::Surface;
use meissner_controller::timing::Timing;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

/// Counts the allocations of all threads.
#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Events that the engine takes before it looks at the deadline again. It begins a prediction two batches early, so that short ones leave more
/// of the time to events.
const BATCH: usize = 8;

const NETWORK: &str = "tactigraph-past";

/// Seed of the camera's noise in the study.
const SEED: u64 = 1;

/// Taps of the study: the whole course of the plane.
const TAPS: usize = 24;

/// Time for all threads to start before the first cycle.
const START: Duration = Duration::from_millis(100);

/// A loop at a fixed rate that levels a fingertip by predictions of its contact angle.
#[derive(Debug, Parser)]
struct Arguments {
    /// A recording, which is played at real speed; or `udp://HOST:PORT`, where records of 16 bytes arrive.
    #[arg(required_unless_present = "study")]
    source: Option<String>,
    /// In place of a loop in real time, levels a fingertip in simulated time with exact predictions, with stale ones and with dropped
    /// events, and writes a picture of the errors.
    #[arg(long, value_name = "SVG", conflicts_with = "source")]
    study: Option<PathBuf>,
    /// Where the fingertip takes targets; used with `udp://` only.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5001")]
    fingertip: String,
    /// Time between two cycles, in microseconds.
    #[arg(long, value_name = "US", default_value_t = 1000)]
    period: u64,
    /// From when a cycle is due until its prediction must be at hand, in microseconds.
    #[arg(long, value_name = "US", default_value_t = 900)]
    deadline: u64,
    /// Most events that wait for the engine; the oldest make room.
    #[arg(long, value_name = "EVENTS", default_value_t = 1 << 16)]
    queue: usize,
    /// Cycles before the end, at most; without this, the end of the events is the end.
    #[arg(long)]
    cycles: Option<u64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let description = Description::shipped(NETWORK).ok_or("no such network")?;
    let weights = Weights::shipped(NETWORK).ok_or("no weights")?;
    let network = description.network(&weights)?;
    match (&arguments.source, &arguments.study) {
        (Some(source), _) => control(source, &arguments, network),
        (None, Some(svg)) => study(svg, network),
        (None, None) => Err("expected a source".into()),
    }
}

/// Runs the loop.
fn control(source: &str, arguments: &Arguments, network: Network) -> Result<(), Box<dyn Error>> {
    let (source, sensor) = open(source)?;
    let engine = Engine::new(network, sensor)?;
    report("locked memory", lock_memory());
    let meter = Meter::default();
    let options = QueueOptions::new().with_capacity(arguments.queue).with_batch(BATCH);
    // A thread starts with the priority of the one that starts it.
    report("priority of the engine's thread", raise(priority::ENGINE));
    let (input, mut live) = Live::spawn(Metered::new(engine, meter.clone()), options)?;
    report("priority of the feed", raise(priority::FEED));
    let ready = now() + START;
    let start = ready + START;
    let is_recording = matches!(source, Source::Recording(_));
    let feed = Feed::start(source, input, start)?;
    report("priority of the loop", raise(priority::LOOP));

    let rhythm = Rhythm {
        start,
        period: Duration::from_micros(arguments.period),
        deadline: Duration::from_micros(arguments.deadline),
        most: arguments.cycles.unwrap_or(u64::MAX),
    };
    let mut timing = Timing::default();
    let mut robot: Box<dyn Robot> = if is_recording {
        Box::new(Alone::default())
    } else {
        Box::new(Remote::connect(&arguments.fingertip)?)
    };
    sleep_until(ready);
    let allocations = Region::new(ALLOCATOR);
    run(&mut live, &meter, &feed, &mut *robot, rhythm, &mut timing)?;
    let change = allocations.change();

    let fed = feed.end()?;
    let covered = live.predict(Duration::MAX)?.nodes;
    let queue = live.counters();
    let engine = live.close()?;
    let counters = engine.engine().counters();
    print!("{timing}");
    println!("{} allocations in the loop, in any thread", change.allocations + change.reallocations);
    println!(
        "{} events: {} dropped by the queue, {} accepted by the engine, {covered} in the window at the end; {} datagrams refused",
        fed.events,
        queue.dropped(),
        counters.events.accepted,
        fed.refused
    );
    if is_recording {
        println!("events were offered at most {:.1} us late", fed.late.as_secs_f64() * 1e6);
    }
    Ok(())
}

/// Levels a fingertip in simulated time, and draws the errors into the file `svg`.
fn study(svg: &Path, network: Network) -> Result<(), Box<dyn Error>> {
    let network = Arc::new(network);
    eprintln!("computing the presses of the dome");
    let table = presses();
    let mut levelled = Vec::new();
    println!("angle at each contact in degrees");
    for case in CASES {
        let engine = Engine::new(Arc::clone(&network), SENSOR)?;
        let run = level(engine, Fingertip::new(Arc::clone(&table), Surface::Course, SEED)?, case, TAPS)?;
        let angles: Vec<_> = run.at_contact.iter().map(|angle| format!("{angle:.2}")).collect();
        println!("{}  {}", case.name, angles.join(" "));
        println!(
            "       mean without jumps {:.2}; at most {} events waited during a hold; {} were dropped",
            run.mean(),
            run.waiting,
            run.dropped
        );
        levelled.push(run);
    }
    Ok(std::fs::write(svg, picture(&levelled))?)
}

/// The events of `source`, and their sensor.
fn open(source: &str) -> Result<(Source, Sensor), Box<dyn Error>> {
    if let Some(address) = source.strip_prefix("udp://") {
        return Ok((Source::Socket(UdpSocket::bind(address)?), SENSOR));
    }
    let recording = io::read(Path::new(source))?;
    Ok((Source::Recording(recording.events), recording.sensor.unwrap_or(SENSOR)))
}

/// Says whether the operating system granted a request.
fn report(what: &str, granted: Result<(), String>) {
    match granted {
        Ok(()) => println!("{what}: granted"),
        Err(reason) => println!("{what}: refused ({reason})"),
    }
}
