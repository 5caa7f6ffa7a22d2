//! Events of a source into a driver: a recording when its events are due, a live stream as it arrives.

use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use meissner_engine::Event;
use meissner_pipeline::source::Source;
use meissner_pipeline::{PipelineError, interrupt};

use crate::Error;
use crate::clock::{between, now_ns};
use crate::driver::Driver;
use crate::wire::SLICE;

/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(50);
/// Events that wait between the thread that reads a live stream and the one that publishes.
const WAITING: usize = 1 << 16;

/// Publishes the events of `source` until its end, or until the program is asked to end. A recording passes `speed` times as fast as it was
/// recorded; an event whose time steps back is due with the one before it.
///
/// # Errors
/// The source cannot be read on, or nothing can be published.
pub fn feed(source: Source, speed: f64, driver: &mut Driver) -> Result<(), Error> {
    if source.is_live() { arriving(source, driver) } else { recorded(source, speed, driver) }
}

fn recorded(source: Source, speed: f64, driver: &mut Driver) -> Result<(), Error> {
    let mut events = source.peekable();
    let Some(Ok(&Event { t_us: first_us, .. })) = events.peek().map(Result::as_ref) else {
        return events.next().map_or(Ok(()), |error| Err(error.map(drop).expect_err("it is one").into()));
    };
    let start = now_ns();
    let due_ns = |event: &Event| {
        let us = (i128::from(event.t_us) - i128::from(first_us)).max(0) as f64;
        // A cast saturates: what is too far away never comes.
        start.saturating_add((us * 1e3 / speed) as u64)
    };
    let mut slice = Vec::with_capacity(SLICE);
    while !interrupt::requested() {
        let now = now_ns();
        while slice.len() < SLICE
            && let Some(next) = events.next_if(|next| next.as_ref().is_ok_and(|event| due_ns(event) <= now))
        {
            slice.push(next?);
        }
        if let Some(first) = slice.first() {
            driver.publish(&slice, due_ns(first))?;
            slice.clear();
        }
        match events.peek() {
            None => return Ok(()),
            Some(Ok(event)) => match between(now_ns(), due_ns(event)) {
                Duration::ZERO => {}
                wait => interrupt::sleep(wait.min(NAP)),
            },
            Some(Err(_)) => drop(events.next().transpose()?),
        }
    }
    Ok(())
}

fn arriving(source: Source, driver: &mut Driver) -> Result<(), Error> {
    let (sender, receiver) = sync_channel(WAITING);
    // A thread of its own waits for the stream. Where the driver is slower, the stream waits, or loses datagrams.
    let read = move || {
        for event in source {
            if sender.send(event).is_err() {
                return;
            }
        }
    };
    let thread = thread::Builder::new().name("meissner-source".to_owned());
    thread.spawn(read).map_err(Error::Process)?;
    let mut slice = Vec::with_capacity(SLICE);
    while !interrupt::requested() {
        match receiver.recv_timeout(NAP) {
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Ok(first) => slice.push(first?),
        }
        let due_ns = now_ns();
        let read = fill(&mut slice, &receiver);
        driver.publish(&slice, due_ns)?;
        slice.clear();
        read?;
    }
    Ok(())
}

/// Adds what waits, up to a whole slice.
fn fill(slice: &mut Vec<Event>, waiting: &Receiver<Result<Event, PipelineError>>) -> Result<(), Error> {
    while slice.len() < SLICE
        && let Ok(next) = waiting.try_recv()
    {
        slice.push(next?);
    }
    Ok(())
}
