//! The trait that all engines implement.

use crate::{BatchEngine, Engine, EngineError, Event, EventCounters, Outcome, Prediction, StaleReadout};

/// Common methods of all engines, for code that runs on any of them.
pub trait Predictor {
    /// One input: an [`Event`], or a frame with its time.
    type Input;
    /// Inserts an input, as [`Engine::push`].
    fn push(&mut self, input: Self::Input) -> Outcome;
    /// Inserts all of `inputs` in order and leaves the list empty; the same as single pushes, and faster where the engine has a faster way.
    fn push_from(&mut self, inputs: &mut Vec<Self::Input>) {
        for input in inputs.drain(..) {
            self.push(input);
        }
    }
    /// Advances the clock, as [`Engine::advance`].
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
macro_rules! predictor {
    ($($engine:ty),*) => {$(
        impl Predictor for $engine {
            type Input = Event;

            fn push(&mut self, event: Event) -> Outcome {
                self.push(event)
            }

            fn push_from(&mut self, events: &mut Vec<Event>) {
                self.push_slice(events);
                events.clear();
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

predictor!(Engine, StaleReadout, BatchEngine);
