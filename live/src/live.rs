//! The side of the controller.

use std::any::Any;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::intake::{Intake, Item, Rule};
use crate::shared::{Answer, Shared};
use crate::{Input, LiveError, Overload, Predictor, QueueCounters, QueueOptions, worker};

/// An engine at work in a thread of its own, and the newest prediction of it.
///
/// Dropping it ends the worker after the batch or the prediction at hand; events that wait are not taken any more.
#[derive(Debug)]
pub struct Live<P: Predictor<Input: Item>> {
    shared: Arc<Shared<P::Input>>,
    /// None once it has been joined.
    worker: Option<JoinHandle<P>>,
    /// Why it ended by itself.
    panic: String,
    values: Vec<f32>,
}

/// A prediction that is there in time, and how old it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timely<'a> {
    /// The last dense layer's outputs.
    pub values: &'a [f32],
    /// Time of the newest event that it covers, as [`meissner_engine::Prediction::t_us`].
    pub t_us: Option<i64>,
    /// Events in the window; of a frame engine, frames since the last reset.
    pub nodes: usize,
    /// Whether it covers all that had entered the queue when it was asked for, but for what was dropped to make room.
    pub fresh: bool,
    /// Whether it was computed for this call; else it is the newest one that had been finished by the deadline.
    pub own: bool,
    /// Events, or frames, that had entered the queue when it was asked for and are not covered.
    pub behind_events: u64,
    /// Stream time from the last event that it covers, or the first one of all where it covers none, to the last one
    /// that had entered the queue when it was asked for, in microseconds.
    pub behind_us: u64,
    /// Time since it was begun.
    pub age: Duration,
    /// Time since it was asked for.
    pub waited: Duration,
}

impl<P: Predictor<Input: Item> + Send + 'static> Live<P> {
    /// Starts a worker that owns `predictor`, behind a queue. The first prediction, before any event, is computed here,
    /// so that there always is one.
    ///
    /// # Errors
    /// [`LiveError::Option`] for options out of range, [`LiveError::Engine`] where the first prediction fails,
    /// [`LiveError::Thread`] where the thread cannot be started.
    pub fn spawn(mut predictor: P, options: QueueOptions) -> Result<(Input<P::Input>, Self), LiveError> {
        options.check()?;
        let mut answer = Answer::new(Instant::now());
        answer.copy(predictor.predict()?);
        let values = answer.values.clone();
        let QueueOptions { capacity, overload, batch } = options;
        let intake = Intake::new(capacity, Rule::from(&overload));
        let shared = Arc::new(Shared::new(intake, capacity, answer));
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new().name("meissner-live".to_owned());
        let worker =
            thread.spawn(move || worker::run(predictor, &theirs, batch)).map_err(LiveError::Thread)?;
        let filters = match overload {
            Overload::Filter(chain) => Some(chain),
            _ => None,
        };
        let input = Input::new(Arc::clone(&shared), filters);
        Ok((input, Self { shared, worker: Some(worker), panic: String::new(), values }))
    }
}

impl<P: Predictor<Input: Item>> Live<P> {
    /// The prediction for what has entered the queue until now, or at the deadline the newest one that is finished,
    /// with its age.
    ///
    /// The worker takes what waits in order. Where it sees that it will not be done in time, it predicts for what it
    /// has; so a prediction that is not fresh is behind by about what waits. Returns no later than `deadline` from now,
    /// apart from the operating system's scheduling; [`Duration::MAX`] waits for all that has entered.
    ///
    /// # Errors
    /// [`LiveError::Engine`] where the newest computation failed: it is no prediction, and an older one is not passed
    /// off as its result. [`LiveError::Panicked`] where the worker has ended.
    pub fn predict(&mut self, deadline: Duration) -> Result<Timely<'_>, LiveError> {
        let asked = Instant::now();
        let (request, state) = self.shared.ask(asked.checked_add(deadline));
        let stamps_us = state.intake.stamps_us();
        let state = self.shared.answered(&request, state);
        if state.has_ended() {
            drop(state);
            return Err(self.panicked());
        }
        let answer = &state.answer;
        if let Some(error) = &answer.error {
            return Err(error.clone().into());
        }
        self.values.clear();
        self.values.extend_from_slice(&answer.values);
        let behind_events = request.target.saturating_sub(answer.covered);
        let behind_us = stamps_us
            .map_or(0, |(first, newest)| newest.saturating_sub(answer.covered_us.unwrap_or(first)).max(0));
        let own = answer.request == request.number;
        Ok(Timely {
            t_us: answer.t_us,
            nodes: answer.nodes,
            fresh: own && behind_events == 0,
            own,
            behind_events,
            behind_us: behind_us.unsigned_abs(),
            age: answer.begun.elapsed(),
            waited: asked.elapsed(),
            values: &self.values,
        })
    }

    /// What has become of offered events.
    pub fn counters(&self) -> QueueCounters {
        *self.shared.lock().intake.counters()
    }

    /// Ends the worker after the batch or the prediction at hand and gives its engine back; events that wait are not
    /// taken any more. To have them taken, ask for a prediction first.
    ///
    /// # Errors
    /// [`LiveError::Panicked`] where the worker had ended before.
    pub fn close(mut self) -> Result<P, LiveError> {
        self.shared.stop();
        match self.worker.take().map(JoinHandle::join) {
            Some(Ok(predictor)) => Ok(predictor),
            Some(Err(cause)) => Err(LiveError::Panicked { message: message(&*cause) }),
            None => Err(LiveError::Panicked { message: self.panic.clone() }),
        }
    }

    /// Why the worker has ended although nobody told it to.
    fn panicked(&mut self) -> LiveError {
        if let Some(Err(cause)) = self.worker.take().map(JoinHandle::join) {
            self.panic = message(&*cause);
        }
        LiveError::Panicked { message: self.panic.clone() }
    }
}

/// What a panic said.
fn message(cause: &(dyn Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(|&text| text.to_owned());
    text.or_else(|| cause.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without a message".to_owned())
}

impl<P: Predictor<Input: Item>> Drop for Live<P> {
    fn drop(&mut self) {
        self.shared.stop();
        // A panic has been reported where the thread's panics are.
        drop(self.worker.take().map(JoinHandle::join));
    }
}
