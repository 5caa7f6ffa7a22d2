//! The thread that owns the engine: its loop, the start of its predictions, its core and its
//! priority.
//!
//! Input: batches of events, requests. Output: answers. Invariant: a request is answered as soon as
//! all events that it must cover have been inserted, or as late as its deadline allows.

use std::time::Duration;

use crate::Predictor;
use crate::intake::Item;
use crate::shared::{Losses, Shared};
use crate::sync::Instant;

/// Records the end of the worker when dropped, however it ends.
struct End<'a, T: Item>(&'a Shared<T>);

impl<T: Item> Drop for End<'_, T> {
    fn drop(&mut self) {
        self.0.end();
    }
}

/// Inserts events, at most `most` at a time, and predicts until asked to end; returns `predictor`.
/// With `gives_way`, the thread has the lowest priority while its queue is congested.
pub(crate) fn run<P: Predictor<Input: Item>>(
    mut predictor: P,
    shared: &Shared<P::Input>,
    most: usize,
    gives_way: bool,
) -> P {
    let _end = End(shared);
    let mut pace = Pace::default();
    let mut batch = Vec::with_capacity(most);
    let mut covered_us = None;
    let mut lowered = None;
    // Error of a refused input; the next request gets it.
    let mut refused = None;
    let before = predictor.event_counters();
    let mut given = 0;
    while let Some(task) = shared.next(most, &mut batch, predictor.event_counters()) {
        if gives_way && task.congested != lowered.is_some() {
            lowered = if task.congested {
                lower_priority()
            } else {
                lowered.filter(|&before| !restore_priority(before))
            };
        }
        let begun = Instant::now();
        covered_us = batch.last().map(Item::t_us).or(covered_us);
        let mut now = begun;
        if !batch.is_empty() {
            given += batch.len() as u64;
            refused = refused.or(predictor.push_slice(&batch).err());
            batch.clear();
            now = Instant::now();
            pace.pushed(now - begun);
            tracing::trace!(task.covered, spent = ?now - begun, "pushed");
        }
        if let Some(ahead) = task.ahead {
            if let Some(t_us) = ahead.advance_us {
                predictor.advance(t_us);
            }
            // The next request gets the error, or the same prediction again.
            let _ = predictor.predict();
            pace.predicted(now.elapsed());
        }
        let Some(request) = task.request else { continue };
        let complete = task.covered >= request.target;
        if !complete && !pace.is_time(request.due, now) {
            continue;
        }
        // Advancing the clock earlier would make waiting events late.
        if let Some(t_us) = request.advance_us.filter(|_| complete) {
            predictor.advance(t_us);
        }
        let events = predictor.event_counters();
        let outcome = refused.take().map_or_else(|| predictor.predict(), Err);
        pace.predicted(now.elapsed());
        tracing::trace!(request.number, complete, spent = ?now.elapsed(), "predicted");
        shared.publish(request.number, events, |answer| match outcome {
            Ok(prediction) => {
                answer.copy(prediction);
                answer.error = None;
                (answer.covered, answer.covered_us) = (task.covered, covered_us);
                answer.losses = Losses {
                    // Events that the network's filters drop are not losses: the prediction is
                    // meant to be without them.
                    dropped: (events.pushed - before.pushed)
                        - (events.accepted - before.accepted)
                        - (events.filtered - before.filtered),
                    held: given.saturating_sub(events.pushed - before.pushed),
                    restarts: events.restarts - before.restarts,
                };
                answer.begun = now;
            }
            Err(error) => answer.error = Some(error),
        });
    }
    predictor
}

/// Decides from recent durations when to start a prediction that cannot cover all events.
///
/// It starts twice the recent duration of a batch and a prediction before its deadline. While
/// events wait, predictions take at most half of the time: otherwise they would starve the events.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    /// Longest recent duration; it decays by an eighth with each new one.
    batch: Duration,
    prediction: Duration,
    /// Duration of the last prediction, and of the batches since then.
    last: Duration,
    since: Duration,
}

/// The longer of `taken` and seven eighths of `before`.
fn lately(before: Duration, taken: Duration) -> Duration {
    taken.max(before * 7 / 8)
}

impl Pace {
    /// Records the duration of a batch.
    pub(crate) fn pushed(&mut self, taken: Duration) {
        self.batch = lately(self.batch, taken);
        self.since += taken;
    }

    /// Records the duration of a prediction.
    pub(crate) fn predicted(&mut self, taken: Duration) {
        self.prediction = lately(self.prediction, taken);
        self.last = taken;
        self.since = Duration::ZERO;
    }

    /// Whether a prediction must be started `now` to be ready when `due`; never without a deadline.
    pub(crate) fn is_time(&self, due: Option<Instant>, now: Instant) -> bool {
        let begin = 2 * (self.batch + self.prediction);
        due.is_some_and(|due| due.saturating_duration_since(now) <= begin) && self.since >= self.last
    }
}

/// The cores that this process may use, ascending; empty if the system does not say.
pub fn cores() -> Vec<usize> {
    core_affinity::get_core_ids().unwrap_or_default().into_iter().map(|core| core.id).collect()
}

/// Pins the calling thread to `core`; returns whether it is pinned.
pub(crate) fn pin(core: usize) -> bool {
    cores().contains(&core) && core_affinity::set_for_current(core_affinity::CoreId { id: core })
}

/// Lowest priority. On Linux each thread has a niceness (sched(7)), which only some processes may
/// lower again.
#[cfg(target_os = "linux")]
const LOWEST: i32 = 19;

/// Gives the calling thread the lowest priority; returns its former niceness, `None` if refused.
#[cfg(target_os = "linux")]
pub(crate) fn lower_priority() -> Option<i32> {
    use rustix::process::{getpriority_process, setpriority_process};
    let before = getpriority_process(None).ok()?;
    setpriority_process(None, LOWEST).ok()?;
    Some(before)
}

/// Gives the calling thread the niceness `before` again; returns whether the system allows it.
#[cfg(target_os = "linux")]
pub(crate) fn restore_priority(before: i32) -> bool {
    rustix::process::setpriority_process(None, before).is_ok()
}

/// Systems whose threads share one priority.
#[cfg(not(target_os = "linux"))]
pub(crate) fn lower_priority() -> Option<i32> {
    None
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn restore_priority(_: i32) -> bool {
    false
}

/// Whether a thread may restore a lowered priority. A separate thread tries it and then ends.
pub(crate) fn can_restore_priority() -> bool {
    std::thread::spawn(|| lower_priority().is_some_and(restore_priority)).join().unwrap_or(false)
}
