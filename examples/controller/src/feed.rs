//! The sensor's thread: events from a socket, or from a recording at real speed, into the queue.
//!
//! Enters: datagrams of records, of which an empty one is the end; or events with the time of the first. Leaves: events in the queue, and
//! counts. Nothing is allocated after the start.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use meissner::Event;
use meissner::io::{RECORD_BYTES, event_of};
use meissner::live::{Input, LiveError};
use thiserror::Error;

use crate::realtime::{now, sleep_until};

/// Largest datagram.
const DATAGRAM: usize = 1 << 16;
/// Shortest sleep between two batches of a recording.
const NAP: Duration = Duration::from_micros(100);
/// How often a silent socket is left to look for the end.
const PATIENCE: Duration = Duration::from_millis(20);

/// Where events come from.
#[derive(Debug)]
pub enum Source {
    /// A recording, in order of time.
    Recording(Vec<Event>),
    /// A socket.
    Socket(UdpSocket),
}

/// What was fed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fed {
    /// Events.
    pub events: u64,
    /// Datagrams that hold no records.
    pub refused: u64,
    /// Longest time from when an event of a recording was due until it was in the queue.
    pub late: Duration,
}

/// Why a feed ended early.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FeedError {
    /// The socket failed.
    #[error("the socket of the events failed")]
    Socket(#[from] io::Error),
    /// The engine's thread ended.
    #[error(transparent)]
    Live(#[from] LiveError),
}

/// The thread that feeds.
#[derive(Debug)]
pub struct Feed {
    thread: JoinHandle<Result<Fed, FeedError>>,
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    ended: AtomicBool,
    /// How late the events were since it was last read, in nanoseconds.
    late_ns: AtomicU64,
}

impl Feed {
    /// Starts the thread. A recording begins at `start` of [`now`].
    ///
    /// # Errors
    /// The thread cannot be started, or the socket has no timeouts.
    pub fn start(source: Source, mut input: Input, start: Duration) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        if let Source::Socket(socket) = &source {
            socket.set_read_timeout(Some(PATIENCE))?;
        }
        let feed = move || {
            let fed = match source {
                Source::Recording(events) => play(&events, &mut input, start, &theirs),
                Source::Socket(socket) => listen(&socket, &mut input, &theirs.ended),
            };
            theirs.ended.store(true, Ordering::Release);
            fed
        };
        Ok(Self { thread: thread::Builder::new().name("feed".to_owned()).spawn(feed)?, shared })
    }

    /// Whether the events have ended.
    pub fn has_ended(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire)
    }

    /// Longest time from when an event was due until it was in the queue, since the call before. What a socket brings is never late.
    pub fn late(&self) -> Duration {
        Duration::from_nanos(self.shared.late_ns.swap(0, Ordering::Relaxed))
    }

    /// Asks the thread to end, and waits for it.
    ///
    /// # Errors
    /// Why it ended early.
    ///
    /// # Panics
    /// If the thread panicked.
    pub fn end(self) -> Result<Fed, FeedError> {
        self.shared.ended.store(true, Ordering::Release);
        self.thread.join().expect("the feed does not panic")
    }
}

fn play(events: &[Event], input: &mut Input, start: Duration, shared: &Shared) -> Result<Fed, FeedError> {
    let mut fed = Fed::default();
    let Some(first) = events.first() else { return Ok(fed) };
    let us_of = |event: &Event| event.t_us.saturating_sub(first.t_us).max(0);
    let due_at = |event: &Event| start + Duration::from_micros(us_of(event).unsigned_abs());
    let mut rest = events;
    while let Some(next) = rest.first().filter(|_| !shared.ended.load(Ordering::Relaxed)) {
        sleep_until(due_at(next).max(now() + NAP));
        let passed = now().saturating_sub(start);
        let passed_us = i64::try_from(passed.as_micros()).unwrap_or(i64::MAX);
        // An event whose time steps back comes with the one before it.
        let (due, later) = rest.split_at(rest.iter().take_while(|event| us_of(event) <= passed_us).count());
        input.push_slice(due)?;
        // Without events too, the window goes on. Events of the same microsecond may still follow.
        input.advance(first.t_us.saturating_add(passed_us));
        if let Some(event) = due.first() {
            let late = now().saturating_sub(due_at(event));
            shared.late_ns.fetch_max(late.as_nanos() as u64, Ordering::Relaxed);
            fed.late = fed.late.max(late);
        }
        fed.events += due.len() as u64;
        rest = later;
    }
    Ok(fed)
}

fn listen(socket: &UdpSocket, input: &mut Input, ended: &AtomicBool) -> Result<Fed, FeedError> {
    let mut fed = Fed::default();
    let mut bytes = vec![0; DATAGRAM];
    let mut events = Vec::with_capacity(DATAGRAM / RECORD_BYTES);
    while !ended.load(Ordering::Relaxed) {
        let length = match socket.recv(&mut bytes) {
            Ok(0) => break,
            Ok(length) => length,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
            Err(error) => return Err(error.into()),
        };
        let (records, rest) = bytes[..length].as_chunks::<RECORD_BYTES>();
        events.clear();
        events.extend(records.iter().map_while(|&record| event_of(record)));
        if events.len() < records.len() || !rest.is_empty() {
            fed.refused += 1;
        }
        input.push_slice(&events)?;
        fed.events += events.len() as u64;
    }
    Ok(fed)
}
