//! The thread that owns the engine.
//!
//! Input: batches of events, requests. Output: answers. Invariant: a request is answered as soon as all events that it
//! must cover have been inserted, or else as late as its deadline allows, with the events inserted by then.

use std::time::Instant;

use crate::Predictor;
use crate::intake::Item;
use crate::pace::Pace;
use crate::priority;
use crate::shared::{Losses, Shared};

/// Records the end of the worker when dropped, however it ends.
struct End<'a, T: Item>(&'a Shared<T>);

impl<T: Item> Drop for End<'_, T> {
    fn drop(&mut self) {
        self.0.end();
    }
}

/// Inserts events, at most `most` at a time, and computes predictions until asked to end; returns `predictor`. With `gives_way`, the thread has
/// the lowest priority while its queue is congested.
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
    // Why an input was refused; the next request gets it.
    let mut refused = None;
    let before = predictor.event_counters();
    let mut given = 0;
    while let Some(task) = shared.next(most, &mut batch, predictor.event_counters()) {
        if gives_way && task.congested != lowered.is_some() {
            lowered = if task.congested {
                priority::lower()
            } else {
                lowered.filter(|&before| !priority::restore(before))
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
            // Whoever asks gets the error, or the same prediction again.
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
                    dropped: (events.pushed - before.pushed) - (events.accepted - before.accepted),
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
