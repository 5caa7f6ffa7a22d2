//! What the worker needs of an engine.

use meissner_engine::{Engine, EngineError, Event, Outcome, Prediction, StaleReadout};

/// The engine's verbs: what takes events and predicts.
pub trait Predictor {
    /// Takes an event, as [`Engine::push`].
    fn push(&mut self, event: Event) -> Outcome;
    /// Moves time on, as [`Engine::advance`].
    fn advance(&mut self, t_us: i64);
    /// The prediction for what was taken, as [`Engine::predict`].
    ///
    /// # Errors
    /// As [`Engine::predict`].
    fn predict(&mut self) -> Result<Prediction<'_>, EngineError>;
}

impl Predictor for Engine {
    fn push(&mut self, event: Event) -> Outcome {
        self.push(event)
    }

    fn advance(&mut self, t_us: i64) {
        self.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predict()
    }
}

impl Predictor for StaleReadout {
    fn push(&mut self, event: Event) -> Outcome {
        self.push(event)
    }

    fn advance(&mut self, t_us: i64) {
        self.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predict()
    }
}
