//! The handle for the controller's thread.

use std::any::Any;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use meissner_engine::EventCounters;

use crate::intake::{Intake, Item};
use crate::shared::{Answer, Losses, Request, Shared};
use crate::sync::{Instant, JoinHandle, thread};
use crate::{Input, LiveError, Overload, Predictor, QueueCounters, QueueOptions, worker};

/// An engine that runs in its own thread, and its newest prediction.
///
/// Dropping it ends the worker after the current batch or prediction; waiting events are discarded.
#[derive(Debug)]
pub struct Live<P: Predictor<Input: Item>> {
    pub(crate) shared: Arc<Shared<P::Input>>,
    /// `None` after it was joined.
    worker: Option<JoinHandle<P>>,
    /// Panic message, if the worker ended by itself.
    panic: String,
    values: Vec<f32>,
    /// Time at which the first event that no fresh prediction covers was offered.
    uncovered: Option<Instant>,
    /// Losses that earlier predictions have reported: those of the engine, and events that the
    /// queue dropped.
    told: (Losses, u64),
}

/// A prediction that is available by the deadline, with its age.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedAnswer<'a> {
    /// Outputs of the last dense layer.
    pub values: &'a [f32],
    /// Time of the newest event that it covers, as [`meissner_engine::Prediction::t_us`].
    pub t_us: Option<i64>,
    /// Events in the window; for a frame engine, frames since the last reset.
    pub nodes: usize,
    /// How much its window differs from those of the training, as
    /// [`meissner_engine::Prediction::unlike`].
    pub unlike: Option<f32>,
    /// Whether it covers every event that had entered the queue before the call, except dropped
    /// ones: none waits ([`Self::behind_events`]), the engine lost none ([`Self::lost_events`]).
    pub fresh: bool,
    /// Whether it was computed for this call; otherwise it is the newest finished one.
    pub own: bool,
    /// Events or frames that had entered the queue at the time of the call and are not covered.
    pub behind_events: u64,
    /// Events or frames that the engine received but this prediction does not cover: dropped since
    /// the previous prediction (late, outside the sensor, far ahead), or held until a restart of
    /// the clock is decided.
    pub lost_events: u64,
    /// Events or frames that the rule of the queue dropped since the previous prediction.
    pub dropped_events: u64,
    /// Restarts of the sensor's clock since the previous prediction; each reset the engine.
    pub restarts: u64,
    /// Stream time in microseconds from the last covered event (or the first of all) to the last
    /// one that had entered at the time of the call.
    pub behind_us: u64,
    /// Time since its computation started.
    pub age: Duration,
    /// Time since the call.
    pub waited: Duration,
    /// Time since the first event was offered that no earlier fresh prediction covers. `None` if
    /// this one is not fresh, or nothing was offered since the last fresh one.
    pub latency: Option<Duration>,
}

/// A requested prediction, which may still be computed.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    request: Request,
    /// Times of the first and of the newest event that had entered.
    stamps_us: Option<(i64, i64)>,
    at: Instant,
}

impl<P: Predictor<Input: Item> + Send + 'static> Live<P> {
    /// Starts a worker that owns `predictor` and reads from a queue. The first prediction is
    /// computed here, so that one always exists.
    ///
    /// # Errors
    /// [`LiveError::Option`] for options out of range, [`LiveError::Engine`] if the first
    /// prediction fails, [`LiveError::Thread`] and [`LiveError::Core`] if the thread does not start
    /// or is not pinned.
    pub fn spawn(predictor: P, options: QueueOptions) -> Result<(Input<P::Input>, Self), LiveError> {
        Self::spawn_beside(predictor, options, false)
    }

    /// With `gives_way`, the worker has the lowest priority while its queue is congested.
    pub(crate) fn spawn_beside(
        mut predictor: P,
        options: QueueOptions,
        gives_way: bool,
    ) -> Result<(Input<P::Input>, Self), LiveError> {
        options.check()?;
        let mut answer = Answer::new(Instant::now());
        answer.copy(predictor.predict()?);
        let values = answer.values.clone();
        let QueueOptions { capacity, mut overload, batch, core, ahead } = options;
        let filters = match &mut overload {
            Overload::Filter(chain) => Some(std::mem::take(chain)),
            _ => None,
        };
        let shared = Arc::new(Shared::new(Intake::new(capacity, overload), answer, ahead));
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new().name("meissner-live".to_owned());
        let (pinned, is_pinned) = mpsc::sync_channel(1);
        let work = move || {
            // If the receiver is gone, no thread waits for it any more.
            let _ = pinned.send(core.is_none_or(worker::pin));
            worker::run(predictor, &theirs, batch, gives_way)
        };
        let told = (Losses::default(), 0);
        let worker = Some(thread.spawn(work).map_err(LiveError::Thread)?);
        let live = Self { shared, worker, panic: String::new(), values, uncovered: None, told };
        if let Some(core) = core.filter(|_| is_pinned.recv() != Ok(true)) {
            return Err(LiveError::Core { core, cores: worker::cores() });
        }
        Ok((Input::new(Arc::clone(&live.shared), filters), live))
    }
}

impl<P: Predictor<Input: Item>> Live<P> {
    /// The prediction for all events that have entered by now or, at the deadline, the newest
    /// finished one, with its age.
    ///
    /// The worker takes waiting events in order, and fewer if it would miss the deadline. Returns
    /// within `deadline`, apart from the system's scheduling; [`Duration::MAX`] waits for all
    /// events.
    ///
    /// # Errors
    /// [`LiveError::Engine`] if the newest computation failed, [`LiveError::Panicked`] if the
    /// worker has ended.
    pub fn predict(&mut self, deadline: Duration) -> Result<TimedAnswer<'_>, LiveError> {
        let asked = self.ask(deadline);
        self.wait(&asked, deadline)?;
        self.timely(&asked)
    }

    /// Requests a prediction without waiting; replaces an earlier request. [`Self::wait`] and
    /// [`Self::timely`] are the rest of [`Self::predict`].
    pub fn ask(&mut self, deadline: Duration) -> Asked {
        let at = Instant::now();
        let (request, state) = self.shared.ask(at.checked_add(deadline));
        self.uncovered = self.uncovered.or(request.offered);
        Asked { request, stamps_us: state.intake.stamps_us(), at }
    }

    /// Waits at most `most` for the requested prediction. Returns whether it is there, or its
    /// deadline has passed.
    ///
    /// # Errors
    /// [`LiveError::Panicked`] if the worker has ended.
    pub fn wait(&mut self, asked: &Asked, most: Duration) -> Result<bool, LiveError> {
        let until = Instant::now().checked_add(most);
        let due = [asked.request.due, until].into_iter().flatten().min();
        let state = self.shared.answered(&Request { due, ..asked.request }, self.shared.lock());
        let (is_there, has_ended) = (state.answer.request == asked.request.number, state.has_ended());
        drop(state);
        if has_ended {
            return Err(self.panicked());
        }
        Ok(is_there || asked.request.due.is_some_and(|due| due <= Instant::now()))
    }

    /// The newest finished prediction, with its age, in answer to a request.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn timely(&mut self, asked: &Asked) -> Result<TimedAnswer<'_>, LiveError> {
        let Asked { request, stamps_us, at } = asked;
        let state = self.shared.lock();
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
        let (losses, dropped) = (answer.losses, state.intake.counters().dropped());
        let (told, dropped_before) = std::mem::replace(&mut self.told, (losses, dropped));
        let lost_events = losses.dropped - told.dropped + losses.held;
        let fresh = own && behind_events == 0 && lost_events == 0;
        if !fresh {
            tracing::debug!(request.number, own, behind_events, behind_us, lost_events, "not fresh");
        }
        Ok(TimedAnswer {
            t_us: answer.t_us,
            nodes: answer.nodes,
            unlike: answer.unlike,
            fresh,
            own,
            behind_events,
            lost_events,
            dropped_events: dropped - dropped_before,
            restarts: losses.restarts - told.restarts,
            behind_us: behind_us.unsigned_abs(),
            age: answer.begun.elapsed(),
            waited: at.elapsed(),
            latency: self.uncovered.take_if(|_| fresh).map(|offered| offered.elapsed()),
            values: &self.values,
        })
    }

    /// The engine's counts of events, as of the newest prediction or of a later batch.
    pub fn event_counters(&self) -> EventCounters {
        self.shared.lock().events
    }

    /// Counts of offered events.
    pub fn counters(&self) -> QueueCounters {
        *self.shared.lock().intake.counters()
    }

    /// Ends the worker after the current batch or prediction and returns its engine; waiting events
    /// are discarded.
    ///
    /// # Errors
    /// [`LiveError::Panicked`] if the worker had already ended.
    pub fn close(mut self) -> Result<P, LiveError> {
        self.shared.stop();
        match self.worker.take().map(JoinHandle::join) {
            Some(Ok(predictor)) => Ok(predictor),
            Some(Err(cause)) => Err(LiveError::Panicked { message: message(&*cause) }),
            None => Err(LiveError::Panicked { message: self.panic.clone() }),
        }
    }

    /// The error of a worker that ended unexpectedly.
    fn panicked(&mut self) -> LiveError {
        if let Some(Err(cause)) = self.worker.take().map(JoinHandle::join) {
            self.panic = message(&*cause);
        }
        LiveError::Panicked { message: self.panic.clone() }
    }
}

/// Message of a panic.
fn message(cause: &(dyn Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(|&text| text.to_owned());
    text.or_else(|| cause.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without a message".to_owned())
}

impl<P: Predictor<Input: Item>> Drop for Live<P> {
    fn drop(&mut self) {
        self.shared.stop();
        // The panic was already reported by the thread's panic hook.
        drop(self.worker.take().map(JoinHandle::join));
    }
}
