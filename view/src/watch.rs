//! A session in a thread, with a server and perhaps live events.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::server::Server;
use crate::session::Session;
use crate::subject::{Item, Subject};

/// Time between two frames.
const FRAME: Duration = Duration::from_millis(33);
/// The part of this time for the engine.
const BUDGET_US: f64 = 22_000.0;

/// Microseconds since the first call.
pub fn clock() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1e6
}

/// Live items between the thread that reads them and the session.
#[derive(Debug)]
pub struct Waiting<I>(Mutex<(Vec<I>, u64)>);

impl<I: Item + Send + 'static> Waiting<I> {
    /// Reads `items` to their end in a separate thread. Items without room in the session are lost
    /// and counted; the reader never waits for the session.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn read<E: std::fmt::Display>(
        items: impl Iterator<Item = Result<I, E>> + Send + 'static,
    ) -> std::io::Result<Arc<Self>> {
        let waiting = Arc::new(Self(Mutex::default()));
        let to = Arc::clone(&waiting);
        thread::Builder::new().name("view: events".to_owned()).spawn(move || {
            for item in items {
                match item {
                    Ok(item) => to.take(item),
                    Err(error) => return tracing::warn!("{error}"),
                }
            }
        })?;
        Ok(waiting)
    }

    fn take(&self, item: I) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // At most half of the items that a history keeps.
        if state.0.len() < item.kept() / 2 { state.0.push(item) } else { state.1 += 1 }
    }

    /// The waiting items, and the number of lost ones so far.
    fn all(&self) -> (Vec<I>, u64) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut state.0), state.1)
    }
}

/// Runs `session` for the pages of `server` until `ends`. Without a page, a recording waits; live
/// items are taken nevertheless.
pub fn watch<S: Subject>(
    mut session: Session<S>,
    server: &Server,
    live: Option<&Waiting<S::Item>>,
    ends: impl Fn() -> bool,
) where
    S::Item: Send + 'static,
{
    let hub = server.hub();
    let mut facts = None;
    while !ends() {
        let begun = Instant::now();
        if let Some(live) = live {
            let (items, lost) = live.all();
            session.set_queue(items.len() as u64, lost);
            session.push(items);
        }
        while let Some(command) = hub.command() {
            // The next frame reports it to the page.
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
