//! Recordings through a network.
//!
//! Enters: a network and recordings. Leaves: of each recording the [`Outcome`], in the order of the recordings. Every
//! recording begins with a reset, and every thread has an engine of its own, so that neither the number of threads nor
//! the order in which they take recordings reaches a bit.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use meissner_engine::{BatchEngine, Engine, EngineError, Event, Network, Search};
use meissner_models::metrics::largest;
use meissner_models::systems::digits::SENSOR;
use rayon::ThreadPool;

use crate::args::Mode;

/// When predictions are read, and of which events.
#[derive(Clone, Copy)]
pub(super) struct Settings {
    pub(super) mode: Mode,
    /// Microseconds from one prediction to the next.
    pub(super) every_us: i64,
    /// Every `stride`-th event is taken.
    pub(super) stride: usize,
}

/// What a network says of a recording.
#[derive(Debug, PartialEq)]
pub(super) struct Outcome {
    /// The class at each time at which a prediction is read before the end, then the class at the end.
    pub(super) answers: Vec<usize>,
    /// The outputs at the end.
    pub(super) logits: Vec<f32>,
    /// Time of the newest event, from the first one on.
    pub(super) end_us: i64,
}

/// The outcomes of `recordings`, each a list of events of which there is at least one.
pub(super) fn outcomes(
    pool: &ThreadPool,
    network: Network,
    settings: Settings,
    recordings: &[&[Event]],
) -> Result<Vec<Outcome>, EngineError> {
    let machine = Machine::new(settings.mode, network)?;
    let next = AtomicUsize::new(0);
    let work = |_: rayon::BroadcastContext<'_>| {
        let mut machine = machine.clone();
        let mut done = Vec::new();
        while let Some((place, events)) = take(&next, recordings) {
            done.push((place, machine.outcome(events, settings)));
        }
        done
    };
    let mut done: Vec<_> = pool.broadcast(work).into_iter().flatten().collect();
    done.sort_by_key(|(place, _)| *place);
    // The first error in the order of the recordings, not of time.
    done.into_iter().map(|(_, outcome)| outcome).collect()
}

/// The next recording that no thread has taken.
fn take<'a>(next: &AtomicUsize, recordings: &[&'a [Event]]) -> Option<(usize, &'a [Event])> {
    let place = next.fetch_add(1, Ordering::Relaxed);
    recordings.get(place).map(|&events| (place, events))
}

/// Takes events and predicts. The gate is the same for both: late events are dropped.
#[derive(Clone)]
enum Machine {
    /// What an event changes.
    Incremental(Box<Engine>),
    /// Every row, at every prediction.
    Batch(Box<BatchEngine>),
}

impl Machine {
    fn new(mode: Mode, network: Network) -> Result<Self, EngineError> {
        let network = Arc::new(network);
        Ok(match mode {
            Mode::Incremental => Self::Incremental(Box::new(Engine::new(network, SENSOR)?)),
            Mode::Batch => {
                Self::Batch(Box::new(BatchEngine::new(network, SENSOR)?.with_search(Search::Grid)))
            }
        })
    }

    fn reset(&mut self) {
        match self {
            Self::Incremental(engine) => engine.reset(),
            Self::Batch(engine) => engine.reset(),
        }
    }

    fn push(&mut self, event: Event) {
        match self {
            Self::Incremental(engine) => engine.push(event),
            Self::Batch(engine) => engine.push(event),
        };
    }

    fn advance(&mut self, t_us: i64) {
        match self {
            Self::Incremental(engine) => engine.advance(t_us),
            Self::Batch(engine) => engine.advance(t_us),
        }
    }

    fn predict(&mut self) -> Result<Vec<f32>, EngineError> {
        let prediction = match self {
            Self::Incremental(engine) => engine.predict(),
            Self::Batch(engine) => engine.predict(),
        };
        Ok(prediction?.values.to_vec())
    }

    fn outcome(&mut self, events: &[Event], settings: Settings) -> Result<Outcome, EngineError> {
        self.reset();
        let epoch_us = events.first().map_or(0, |event| event.t_us);
        let (mut due_us, mut end_us) = (settings.every_us, 0);
        let mut answers = Vec::new();
        for &event in events.iter().step_by(settings.stride) {
            let t_us = event.t_us - epoch_us;
            // An event at the due time belongs to its window.
            while due_us < t_us {
                self.advance(epoch_us + due_us);
                answers.push(class(&self.predict()?));
                due_us += settings.every_us;
            }
            self.push(event);
            end_us = end_us.max(t_us);
        }
        let logits = self.predict()?;
        answers.push(class(&logits));
        Ok(Outcome { answers, logits, end_us })
    }
}

fn class(values: &[f32]) -> usize {
    largest(values).expect("the engine refuses predictions that are not numbers")
}
