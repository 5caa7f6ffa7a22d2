//! A session in a thread, with a server and perhaps live events.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::Event;

use crate::server::Server;
use crate::session::Session;

/// Time between two frames.
const FRAME: Duration = Duration::from_millis(33);
/// The part of it that the engine may take.
const BUDGET_US: f64 = 22_000.0;
/// Live events that wait for the session; more are lost and counted.
const MAX_WAITING: usize = 1 << 20;

/// Microseconds since the first call.
pub fn clock() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1e6
}

/// Live events between the thread that reads them and the session.
#[derive(Debug, Default)]
pub struct Waiting(Mutex<(Vec<Event>, u64)>);

impl Waiting {
    /// Reads `events` to their end in a thread of its own. What the session has no room for is lost
    /// and counted; the reader never waits for the session.
    ///
    /// # Errors
    /// There is no thread.
    pub fn read<E: std::fmt::Display>(
        events: impl Iterator<Item = Result<Event, E>> + Send + 'static,
    ) -> std::io::Result<Arc<Self>> {
        let waiting = Arc::new(Self::default());
        let to = Arc::clone(&waiting);
        thread::Builder::new().name("view: events".to_owned()).spawn(move || {
            for event in events {
                match event {
                    Ok(event) => to.take(event),
                    Err(error) => return tracing::warn!("{error}"),
                }
            }
        })?;
        Ok(waiting)
    }

    fn take(&self, event: Event) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if state.0.len() < MAX_WAITING { state.0.push(event) } else { state.1 += 1 }
    }

    /// What waits, and how many were lost so far.
    fn all(&self) -> (Vec<Event>, u64) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut state.0), state.1)
    }
}

/// Runs `session` for the pages of `server` until `ends`. Without a page, a recording waits; live
/// events are taken nevertheless.
pub fn watch(mut session: Session, server: &Server, live: Option<&Waiting>, ends: impl Fn() -> bool) {
    let hub = server.hub();
    let mut facts = None;
    while !ends() {
        let begun = Instant::now();
        if let Some(live) = live {
            let (events, lost) = live.all();
            session.set_queue(events.len() as u64, lost);
            session.push(&events);
        }
        while let Some(command) = hub.command() {
            // The next frame tells the page.
            if let Err(error) = session.command(&command) {
                tracing::debug!("a command of the page: {error}");
            }
        }
        if facts != Some(session.facts_version()) {
            facts = Some(session.facts_version());
            hub.set_facts(session.facts());
        }
        let is_watched = hub.clients().1 > 0;
        if (is_watched || live.is_some()) && session.go_on(BUDGET_US) && hub.wants_frame() {
            hub.publish(session.show());
        }
        let left = FRAME.saturating_sub(begun.elapsed());
        if let Some(command) = hub.command_within(left) {
            let _ = session.command(&command);
        }
    }
}
