//! A readout that may be stale: a prediction is reused until it is too old.
//!
//! Input: that of an engine. Output: the last prediction, or a new one beyond a bound of events or
//! time. Invariant: values have the bits of the engine's prediction at that time, and
//! [`Prediction::t_us`] is the time of the newest event that it covers. Events enter the graph at
//! once; changes propagate when a prediction is computed.

use crate::error::in_range;
use crate::{Engine, EngineError, Event, EventCounters, Network, Outcome, Prediction};

/// Largest age of a reused prediction: it is younger than every given bound. Without a bound, every
/// prediction is computed.
///
/// ```
/// let bound = meissner_engine::Staleness::new().with_events(300).with_us(20_000);
/// assert_eq!((bound.events, bound.us), (Some(300), Some(20_000)));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[must_use]
pub struct Staleness {
    /// Number of accepted events after which a prediction is recomputed; at least 1.
    pub events: Option<u64>,
    /// Microseconds of stream time after which a prediction is recomputed; at least 1.
    pub us: Option<i64>,
}

impl Staleness {
    /// No bound.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`Self::events`].
    pub fn with_events(self, events: impl Into<Option<u64>>) -> Self {
        Self { events: events.into(), ..self }
    }

    /// Sets [`Self::us`].
    pub fn with_us(self, us: impl Into<Option<i64>>) -> Self {
        Self { us: us.into(), ..self }
    }
}

/// An engine that reuses predictions up to an age.
#[derive(Clone, Debug)]
pub struct StaleReadout {
    engine: Engine,
    bound: Staleness,
    /// Accepted events since the last computed prediction.
    accepted: u64,
    /// The last computed prediction; `None` if there is none since the last reset.
    computed: Option<Computed>,
    values: Vec<f32>,
    rows: Vec<u64>,
    stale: u64,
}

#[derive(Clone, Copy, Debug)]
struct Computed {
    now_us: Option<i64>,
    t_us: Option<i64>,
    nodes: usize,
    unlike: Option<f32>,
}

impl StaleReadout {
    /// Wraps `engine` in a readout with the given bound.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a bound below 1, or longer than the longest span.
    pub fn new(engine: Engine, bound: Staleness) -> Result<Self, EngineError> {
        if let Some(events) = bound.events {
            in_range("stale events", i64::try_from(events).unwrap_or(i64::MAX), 1, i64::MAX)?;
        }
        if let Some(us) = bound.us {
            in_range("stale microseconds", us, 1, Network::MAX_SPAN_US)?;
        }
        let network = engine.network();
        let (values, rows) = (vec![0.0; network.outputs()], vec![0; network.layers().len()]);
        Ok(Self { engine, bound, accepted: 0, computed: None, values, rows, stale: 0 })
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Unwraps the engine.
    pub fn into_engine(self) -> Engine {
        self.engine
    }

    /// As [`Engine::event_counters`].
    pub fn event_counters(&self) -> &EventCounters {
        self.engine.event_counters()
    }

    /// Number of predictions that were reused.
    pub fn stale(&self) -> u64 {
        self.stale
    }

    /// As [`Engine::push`].
    pub fn push(&mut self, event: Event) -> Outcome {
        let before = *self.engine.event_counters();
        let outcome = self.engine.push(event);
        self.pushed(&before);
        outcome
    }

    /// As [`Engine::push_slice`].
    pub fn push_slice(&mut self, events: &[Event]) -> usize {
        self.push_all(events.iter().copied())
    }

    /// As [`Engine::push_all`].
    pub fn push_all(&mut self, events: impl IntoIterator<Item = Event>) -> usize {
        let before = *self.engine.event_counters();
        let accepted = self.engine.push_all(events);
        self.pushed(&before);
        accepted
    }

    /// Counts the events that were pushed since the counts `before`. A prediction from before a
    /// restart does not belong to the new clock.
    fn pushed(&mut self, before: &EventCounters) {
        let now = self.engine.event_counters();
        self.accepted += now.accepted - before.accepted;
        if now.restarts > before.restarts {
            self.computed = None;
        }
    }

    /// As [`Engine::advance`].
    pub fn advance(&mut self, t_us: i64) {
        let before = *self.engine.event_counters();
        self.engine.advance(t_us);
        self.pushed(&before);
    }

    /// As [`Engine::reset`]; the last prediction is forgotten.
    pub fn reset(&mut self) {
        self.engine.reset();
        self.computed = None;
    }

    /// The last prediction if younger than every bound, else a new one. `nodes`, `t_us`
    /// and `unlike` are those of its computation; `rows` counts its rows, 0 if reused.
    ///
    /// # Errors
    /// As [`Engine::predict`]; the next call computes again.
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let computed = match self.computed.filter(|computed| self.stands(computed)) {
            Some(computed) => {
                self.rows.fill(0);
                self.stale += 1;
                computed
            }
            None => self.compute()?,
        };
        let Computed { t_us, nodes, unlike, .. } = computed;
        Ok(Prediction { values: &self.values, t_us, nodes, rows: &self.rows, unlike })
    }

    fn stands(&self, computed: &Computed) -> bool {
        // The clock may have started since then.
        let age = computed.now_us.zip(self.engine.now_us()).map(|(then, now)| now.abs_diff(then));
        let young = |us: i64| age.is_some_and(|age| age < us.unsigned_abs());
        self.bound != Staleness::default()
            && self.bound.events.is_none_or(|events| self.accepted < events)
            && self.bound.us.is_none_or(young)
    }

    fn compute(&mut self) -> Result<Computed, EngineError> {
        self.computed = None;
        let now_us = self.engine.now_us();
        let Prediction { values, t_us, nodes, rows, unlike } = self.engine.predict()?;
        self.values.clear();
        self.values.extend_from_slice(values);
        self.rows.clear();
        self.rows.extend_from_slice(rows);
        self.accepted = 0;
        Ok(*self.computed.insert(Computed { now_us, t_us, nodes, unlike }))
    }
}
