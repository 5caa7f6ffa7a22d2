//! The exchange between clients and the thread that makes frames.
//!
//! Invariant: only the newest frame waits. A client that is slower than the frames misses only
//! those in between; facts that it has not seen come first.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of waiting commands; further ones are dropped.
const MAX_COMMANDS: usize = 256;
/// Maximum number of pages at a time.
const MAX_CLIENTS: usize = 16;

/// Bytes that are sent to several clients.
type Shared = Arc<Vec<u8>>;

/// The newest frame, and the commands of all clients.
#[derive(Debug)]
pub struct Hub {
    state: Mutex<State>,
    arrived: Condvar,
    /// Whether a client waits for a frame.
    wanted: AtomicBool,
    commands: SyncSender<String>,
    received: Mutex<Receiver<String>>,
}

#[derive(Debug, Default)]
struct State {
    facts: Option<(u64, Shared)>,
    frame: Option<(u64, Shared)>,
    clients: usize,
    /// Number of clients so far.
    opened: u64,
    closed: bool,
}

/// The state that was sent to a client.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen {
    facts: u64,
    frame: u64,
}

/// A place among the clients; a drop frees it.
pub(super) struct Place<'a>(&'a Hub);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.lock().clients -= 1;
    }
}

impl Hub {
    pub(super) fn new() -> Self {
        let (commands, received) = sync_channel(MAX_COMMANDS);
        Self {
            state: Mutex::default(),
            arrived: Condvar::new(),
            wanted: AtomicBool::new(false),
            commands,
            received: Mutex::new(received),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change of the state is complete.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a client waits for a frame. One load: an engine may ask after every event.
    #[inline]
    pub fn wants_frame(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }

    /// Number of clients now, and of all so far.
    pub fn clients(&self) -> (usize, u64) {
        let state = self.lock();
        (state.clients, state.opened)
    }

    /// Replaces the facts, which every client gets before its next frame.
    pub fn set_facts(&self, facts: Vec<u8>) {
        let mut state = self.lock();
        let version = state.facts.as_ref().map_or(0, |(version, _)| *version) + 1;
        state.facts = Some((version, Arc::new(facts)));
        drop(state);
        self.arrived.notify_all();
    }

    /// Gives a frame to all clients that wait for one.
    pub fn publish(&self, frame: Vec<u8>) {
        let mut state = self.lock();
        let number = state.frame.as_ref().map_or(0, |(number, _)| *number) + 1;
        state.frame = Some((number, Arc::new(frame)));
        self.wanted.store(false, Ordering::Relaxed);
        drop(state);
        self.arrived.notify_all();
    }

    /// The next command of any client, if there is one.
    pub fn command(&self) -> Option<String> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner).try_recv().ok()
    }

    /// Waits for a command for at most `time`.
    pub fn command_within(&self, time: Duration) -> Option<String> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(time).ok()
    }

    /// Takes a command, if there is room.
    pub(super) fn take(&self, command: String) {
        // A client that sends more than can be carried out loses the rest.
        let _ = self.commands.try_send(command);
    }

    /// A place for a client; `None` if there are too many.
    pub(super) fn enter(&self) -> Option<Place<'_>> {
        let mut state = self.lock();
        if state.clients >= MAX_CLIENTS {
            return None;
        }
        state.clients += 1;
        state.opened += 1;
        Some(Place(self))
    }

    /// Waits for data that a client has not `seen`, for at most `time`: facts, then the frame.
    pub(super) fn next(&self, seen: &mut Seen, time: Duration) -> Vec<Shared> {
        let mut state = self.lock();
        let is_news = |state: &State| {
            state.frame.as_ref().is_some_and(|(number, _)| *number > seen.frame)
                || state.facts.as_ref().is_some_and(|(version, _)| *version > seen.facts)
        };
        if !is_news(&state) && !state.closed {
            self.wanted.store(true, Ordering::Relaxed);
            let waited = self.arrived.wait_timeout(state, time);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let mut news = Vec::new();
        let seen = [(&mut seen.facts, &state.facts), (&mut seen.frame, &state.frame)];
        for (seen, newest) in seen {
            if let Some((number, bytes)) = newest
                && *number > *seen
            {
                *seen = *number;
                news.push(Arc::clone(bytes));
            }
        }
        news
    }

    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.arrived.notify_all();
    }

    pub(super) fn is_closed(&self) -> bool {
        self.lock().closed
    }
}
