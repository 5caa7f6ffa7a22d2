//! The latency of one hop: from before a slice is written until another process has received it.

use std::process::Stdio;
use std::time::Duration;

use meissner_engine::{Event, Sensor};
use meissner_pipeline::interrupt;
use meissner_pipeline::latency::Latency;
use serde::Serialize;

use crate::Error;
use crate::channel::{BUFFER, Channel, Receiver};
use crate::clock::{between, now_ns};
use crate::driver::{Driver, Published, events_of};
use crate::losses::{Losses, Watch};
use crate::wire::{EventRecord, SLICE, SliceHeader};

/// How to measure.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Events of a slice.
    pub events: usize,
    /// Slices.
    pub slices: u64,
    /// Time from slice to slice; zero for as fast as possible.
    pub period: Duration,
}

/// What was received.
#[derive(Debug, Serialize)]
pub struct Hop {
    /// Latencies in microseconds.
    pub hop_us: Latency,
    /// What is missing.
    pub lost: Losses,
}

/// Publishes slices under this name, when another process receives them.
///
/// # Errors
/// The settings are out of range, or nothing can be published.
pub fn send(name: &str, options: Options) -> Result<Published, Error> {
    let Options { events, slices, period } = options;
    if !(1..=SLICE).contains(&events) {
        let (expected, found) = (format!("1 to {SLICE}"), events.to_string());
        return Err(Error::Setting { what: "events of a slice", expected, found });
    }
    let mut driver = Driver::new(name, Sensor::new(240, 180))?;
    while driver.subscribers() == 0 && !interrupt::requested() {
        interrupt::sleep(Duration::from_millis(1));
    }
    let slice: Vec<Event> = (0..events).map(|i| Event::new(i as i64, (i % 240) as u16, 90, true)).collect();
    let start = now_ns();
    for number in 0..slices {
        let due_ns = start.saturating_add(period.as_nanos() as u64 * number);
        let wait = between(now_ns(), due_ns);
        if !wait.is_zero() {
            interrupt::sleep(wait);
        }
        if interrupt::requested() {
            break;
        }
        driver.publish(&slice, due_ns)?;
    }
    driver.end()
}

/// Receives slices under this name until their end. With `spin` it asks without a pause, and never sleeps.
///
/// # Errors
/// The service cannot be opened, or breaks.
pub fn receive(name: &str, spin: bool) -> Result<Hop, Error> {
    let events: Receiver<EventRecord, SliceHeader> = Channel::open(&events_of(name))?.receiver(BUFFER)?;
    let (mut hop_us, mut watch) = (Latency::new(), Watch::default());
    while !interrupt::requested() {
        if !spin {
            events.wait(Duration::from_millis(100))?;
        }
        while let Some(slice) = events.take()? {
            let (now, header) = (now_ns(), slice.user_header());
            // Refused slices would be lost ones of this measurement; its own driver sends none.
            let _ = watch.see(header, slice.payload().len());
            if header.end == 1 {
                return Ok(Hop { hop_us, lost: watch.losses });
            }
            hop_us.record(between(header.published_ns, now));
        }
    }
    Ok(Hop { hop_us, lost: watch.losses })
}

/// Measures between this process and another start of this program, whose result it returns as JSON.
///
/// # Errors
/// As [`send`], or the other process fails.
pub fn measure(name: &str, options: Options, spin: bool) -> Result<serde_json::Value, Error> {
    let program = std::env::current_exe().map_err(Error::Process)?;
    let mut receiver = std::process::Command::new(program);
    receiver.args(["hop", "--name", name, "--receive"]).stdout(Stdio::piped());
    if spin {
        receiver.arg("--spin");
    }
    let receiver = receiver.spawn().map_err(Error::Process)?;
    send(name, options)?;
    let output = receiver.wait_with_output().map_err(Error::Process)?;
    serde_json::from_slice(&output.stdout).map_err(|error| Error::Process(error.into()))
}
