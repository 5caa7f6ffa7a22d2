//! The loop of all runs over the events of a recording or a live stream.

use std::time::Instant;

use meissner_engine::{Event, Sensor};

use super::prediction::Observer;
use super::state::Saver;
use super::summary::{Ended, Ending, Summary};
use crate::error::RunError;
use crate::interrupt;
use crate::losses::{InputLosses, LossWarning, LossWatch};
use crate::source::Source;

/// A network with its source of events, before the run.
pub struct StreamRun<S> {
    pub(super) source: Source,
    pub(super) sensor: Sensor,
    pub(super) limit: u64,
    pub(super) saver: Option<Saver>,
    pub(super) steps: S,
}

/// The steps of one kind of network.
pub trait Steps {
    /// Takes an event, and shows the predictions that become due.
    ///
    /// # Errors
    /// The engine fails, or the observer cannot show a prediction.
    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<(), RunError>;

    /// Events taken so far.
    fn taken(&self) -> u64;

    /// The newest time; `None` before the first event.
    fn now_us(&self) -> Option<i64>;

    /// The state after the newest event; `None` if this network cannot be resumed.
    fn state(&mut self) -> Option<Vec<u8>>;

    /// Decides about events that wait for others: there will be none.
    ///
    /// # Errors
    /// As [`Self::take`].
    fn settle(&mut self, observer: &mut dyn Observer) -> Result<(), RunError>;

    /// Shows the predictions that are due at the end. With `resumes`, results that are due only
    /// because the input ends are left to the resumed run.
    ///
    /// # Errors
    /// As [`Self::take`].
    fn finish(&mut self, resumes: bool, observer: &mut dyn Observer) -> Result<(), RunError>;

    /// The losses so far.
    fn losses(&self, source: &Source, sensor: Sensor) -> InputLosses;

    /// The summary of the run.
    fn summary(self, source: Source, warnings: Vec<LossWarning>) -> Summary;
}

impl<S: Steps> StreamRun<S> {
    /// The source.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The number of events that the run will take, if it is known.
    pub fn total(&self) -> Option<u64> {
        self.source.remaining().map(|remaining| remaining.min(self.limit))
    }

    /// Takes all events, or the events up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        // A second signal does not come between the first one and the state.
        let held = self.saver.is_some().then(interrupt::hold);
        let mut watch = LossWatch::new(self.source.is_live());
        let mut result = Ok(());
        while result.is_ok() && self.steps.taken() < self.limit && !interrupt::requested() {
            let Some(event) = self.source.next() else { break };
            result = event.and_then(|event| self.take(event, observer));
            let Self { source, sensor, steps, .. } = &self;
            observer.progress(steps.taken());
            watch.look(steps.taken(), Instant::now, &source.name, || steps.losses(source, *sensor));
        }
        let mut ending = Ending(result);
        if ending.predicts() {
            ending.then(self.steps.settle(observer));
        }
        if ending.saves() {
            ending.then(self.save());
        }
        drop(held);
        if ending.predicts() {
            ending.then(self.steps.finish(self.saver.is_some(), observer));
        }
        let Self { source, sensor, steps, .. } = self;
        let warnings = watch.end(&source.name, &steps.losses(&source, sensor));
        Ended { summary: steps.summary(source, warnings), result: ending.0 }
    }

    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<(), RunError> {
        self.steps.take(event, observer)?;
        let due = self.saver.as_mut().zip(self.steps.now_us()).is_some_and(|(saver, now)| saver.is_due(now));
        if due { self.save() } else { Ok(()) }
    }

    /// Writes the state, if requested.
    fn save(&mut self) -> Result<(), RunError> {
        let Some(saver) = &self.saver else { return Ok(()) };
        self.steps.state().map_or(Ok(()), |state| saver.write(&state))
    }
}
