//! The trait that all engines implement.

use crate::frames::FrameEngine;
use crate::{BatchEngine, Engine, EngineError, Event, EventCounters, Outcome, Prediction, StaleReadout};

/// Common methods of all engines, for code that runs on any of them.
///
/// A pair of engines is a predictor too: both take every input, and the first one predicts. A pair
/// records the inputs of an engine, so that its prediction can be compared with that of a
/// [`BatchEngine`] afterwards.
pub trait Predictor {
    /// One input: an [`Event`], or the values of a frame.
    type Input;
    /// Inserts an input, as [`Engine::push`].
    ///
    /// # Errors
    /// The engine refuses the input, for example a frame of another size. Its state is then
    /// unchanged.
    fn push(&mut self, input: &Self::Input) -> Result<Outcome, EngineError>;
    /// Inserts `inputs` in order; the same as single pushes, and faster if the engine has a faster
    /// way.
    ///
    /// # Errors
    /// The first error of a push; the inputs after it are still inserted.
    fn push_slice(&mut self, inputs: &[Self::Input]) -> Result<(), EngineError> {
        let mut refused = Ok(());
        for input in inputs {
            refused = refused.and(self.push(input).map(drop));
        }
        refused
    }
    /// Advances the clock, as [`Engine::advance`]. An engine without a clock ignores it.
    fn advance(&mut self, t_us: i64);
    /// Computes the prediction for all accepted inputs, as [`Engine::predict`].
    ///
    /// # Errors
    /// As [`Engine::predict`].
    fn predict(&mut self) -> Result<Prediction<'_>, EngineError>;
    /// Removes all inputs, as [`Engine::reset`].
    fn reset(&mut self);
    /// Counts of the inputs so far, as [`Engine::event_counters`].
    fn event_counters(&self) -> EventCounters;
}

/// Implements [`Predictor`] through inherent methods of the same names.
macro_rules! over_events {
    ($($engine:ty),*) => {$(
        impl Predictor for $engine {
            type Input = Event;

            fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
                Ok(self.push(*event))
            }

            fn push_slice(&mut self, events: &[Event]) -> Result<(), EngineError> {
                self.push_slice(events);
                Ok(())
            }

            fn advance(&mut self, t_us: i64) {
                self.advance(t_us);
            }

            fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
                self.predict()
            }

            fn reset(&mut self) {
                self.reset();
            }

            fn event_counters(&self) -> EventCounters {
                *self.event_counters()
            }
        }
    )*};
}

over_events!(Engine, StaleReadout, BatchEngine);

/// Frames without times. In a [`Prediction`], `nodes` is the number of frames since the last reset.
impl Predictor for FrameEngine {
    type Input = Vec<f32>;

    fn push(&mut self, frame: &Vec<f32>) -> Result<Outcome, EngineError> {
        self.push(frame).map(|()| Outcome::Accepted)
    }

    fn advance(&mut self, _: i64) {}

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let prediction = self.predict()?;
        let nodes = usize::try_from(prediction.frames).unwrap_or(usize::MAX);
        Ok(Prediction { values: prediction.values, t_us: None, nodes, rows: &[], unlike: prediction.unlike })
    }

    fn reset(&mut self) {
        self.reset();
    }

    fn event_counters(&self) -> EventCounters {
        let frames = self.counters().frames;
        EventCounters { pushed: frames, accepted: frames, ..EventCounters::default() }
    }
}

impl<P: Predictor, O: Predictor<Input = P::Input>> Predictor for (P, O) {
    type Input = P::Input;

    fn push(&mut self, input: &P::Input) -> Result<Outcome, EngineError> {
        self.1.push(input)?;
        self.0.push(input)
    }

    fn push_slice(&mut self, inputs: &[P::Input]) -> Result<(), EngineError> {
        self.1.push_slice(inputs).and(self.0.push_slice(inputs))
    }

    fn advance(&mut self, t_us: i64) {
        self.1.advance(t_us);
        self.0.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.0.predict()
    }

    fn reset(&mut self) {
        self.1.reset();
        self.0.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.0.event_counters()
    }
}
