//! The events of a recording when they are due, and those of a live stream as they arrive.

use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::Event;
use meissner_run::clock::Clock;
use meissner_run::{RunError, interrupt};

/// Maximum number of events of a live stream that wait here; more wait in the operating system's
/// buffers.
const WAITING: usize = 1 << 16;

/// Options for sending events.
#[derive(Clone, Copy, Debug)]
pub struct FeedOptions {
    /// Whether the events arrive from outside, instead of from a recording.
    pub is_live: bool,
    /// Seconds of a recording per second; 0 sends it as fast as possible.
    pub speed: f64,
    /// Shortest time between two packets: events within this time are sent together.
    pub every: Duration,
    /// Longest time from one call to the next, also while there are no events.
    pub max_wait: Duration,
    /// Greatest number of events of a packet.
    pub max_events: usize,
}

/// Sends each of `events` when it is due, until their end, or until `ended`. `send` gets the events
/// of a packet and the time at which the first was due; it is also called without events. An event
/// whose time steps back is sent with the event before it.
///
/// # Errors
/// An event cannot be read, or an error of `send`.
pub fn feed<E: From<RunError>>(
    events: impl Iterator<Item = Result<Event, RunError>> + Send + 'static,
    options: FeedOptions,
    ended: impl FnMut() -> bool,
    send: impl FnMut(&[Event], Instant) -> Result<(), E>,
) -> Result<(), E> {
    if options.is_live {
        arriving(events, options, ended, send)
    } else {
        recorded(events, options, ended, send)
    }
}

fn recorded<E: From<RunError>>(
    events: impl Iterator<Item = Result<Event, RunError>>,
    options: FeedOptions,
    mut ended: impl FnMut() -> bool,
    mut send: impl FnMut(&[Event], Instant) -> Result<(), E>,
) -> Result<(), E> {
    let FeedOptions { speed, every, max_wait, max_events, .. } = options;
    let mut events = events.peekable();
    let start = Instant::now();
    let first_us = events.peek().and_then(|first| first.as_ref().ok()).map_or(0, |first| first.t_us);
    let clock = Clock::new(start, first_us, speed);
    let at = |event: &Event| if speed > 0.0 { clock.at(event.t_us) } else { start };
    let mut packet = Vec::with_capacity(max_events);
    while !ended() {
        let now = Instant::now();
        while packet.len() < max_events
            && let Some(next) = events.next_if(|next| next.as_ref().is_ok_and(|event| at(event) <= now))
        {
            packet.push(next?);
        }
        send(&packet, packet.first().map_or(now, at))?;
        let is_full = packet.len() == max_events;
        packet.clear();
        let next = match events.peek() {
            None => break,
            Some(Ok(event)) => at(event),
            Some(Err(_)) => {
                events.next().transpose()?;
                continue;
            }
        };
        // Due events that did not fit into the packet do not wait.
        if !(is_full && next <= now) {
            let wait = next.max(now + every).saturating_duration_since(Instant::now());
            interrupt::sleep(wait.min(max_wait));
        }
    }
    Ok(())
}

fn arriving<E: From<RunError>>(
    events: impl Iterator<Item = Result<Event, RunError>> + Send + 'static,
    FeedOptions { every, max_wait, max_events, .. }: FeedOptions,
    mut ended: impl FnMut() -> bool,
    mut send: impl FnMut(&[Event], Instant) -> Result<(), E>,
) -> Result<(), E> {
    let (sender, receiver) = sync_channel(WAITING);
    // A separate thread waits for the stream. The stream waits for the caller, or loses datagrams.
    thread::spawn(move || {
        for event in events {
            // The receiver has ended.
            if sender.send(event).is_err() {
                return;
            }
        }
    });
    let mut packet = Vec::with_capacity(max_events);
    let mut has_ended = false;
    while !has_ended && !ended() {
        match receiver.recv_timeout(max_wait) {
            Ok(first) => packet.push(first?),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => has_ended = true,
        }
        let due = Instant::now();
        let mut fault = None;
        while packet.len() < max_events
            && fault.is_none()
            && let Ok(next) = receiver.try_recv()
        {
            match next {
                Ok(event) => packet.push(event),
                Err(error) => fault = Some(error),
            }
        }
        let is_full = packet.len() == max_events;
        send(&packet, due)?;
        packet.clear();
        if let Some(error) = fault {
            return Err(error.into());
        }
        if !is_full {
            interrupt::sleep(every);
        }
    }
    Ok(())
}
