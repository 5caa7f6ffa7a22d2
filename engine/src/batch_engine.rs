//! A [`Batch`] with the methods of the engine: every prediction recomputes every row.
//!
//! Input: events and clock advances, admitted as by an engine. Output: the prediction of a batch
//! over the accepted events. Invariant: a prediction depends only on the remembered events.
//!
//! A row of a `frozen` network depends on events that have left: block b reads neighbours in block
//! b - 1, at most one capacity of events older. Over B blocks, only the events of the last B + 1
//! capacities count. Without `frozen`, the last capacity is enough.

use std::convert::Infallible;
use std::fmt;
use std::sync::Arc;

use meissner_kernels::Isa;

use crate::admission::{Admission, LatePolicy};
use crate::batch::{Batch, Search, Stream, Trace};
use crate::counters::{Counters, EventCounters, LayerCounters, Outcome};
use crate::engine::Prediction;
use crate::network::Network;
use crate::restart::{ClockWatch, Decision, RestartPolicy};
use crate::unlikeness::WindowStatistics;
use crate::{EngineError, Event, Sensor};

/// Computes every prediction from scratch; otherwise behaves as an exact [`Engine`](crate::Engine),
/// with equal bits.
///
/// ```
/// # use std::sync::Arc;
/// # use meissner_engine::{BatchEngine, EngineError, Event, Network, Search, Sensor};
/// fn check(
///     network: Arc<Network>,
///     events: &[Event],
///     incremental: &[f32],
/// ) -> Result<(), EngineError> {
///     let mut batch = BatchEngine::new(network, Sensor::new(240, 180))?.with_search(Search::Grid);
///     batch.push_slice(events);
///     assert_eq!(batch.predict()?.values, incremental);
///     Ok(())
/// }
/// ```
#[derive(Clone)]
pub struct BatchEngine {
    batch: Batch,
    watch: ClockWatch,
    admission: Admission,
    /// Accepted events, of which at least the last [`Self::most_events`] are kept.
    events: Vec<Event>,
    most_events: usize,
    /// Number of events in the window: the last ones of `events`.
    nodes: usize,
    newest_us: Option<i64>,
    values: Vec<f32>,
    rows: Vec<u64>,
    counters: Counters,
}

impl BatchEngine {
    /// An engine that drops late events and searches exhaustively. For a `frozen` network it
    /// remembers all events since the last reset.
    ///
    /// # Errors
    /// [`EngineError::Sensor`] for a sensor without pixels, [`EngineError::Option`] for more pixels
    /// than a filter of the network takes.
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor) -> Result<Self, EngineError> {
        let network = network.into();
        let (parts, layers) = (network.parts(), network.layers().len());
        Ok(Self {
            most_events: if parts.graph.is_frozen() { usize::MAX } else { parts.capacity },
            watch: ClockWatch::new(RestartPolicy::default(), sensor, parts.span_us),
            admission: Admission::new(sensor, LatePolicy::default()).with_filters(network.filters())?,
            batch: Batch::new(network, sensor)?,
            events: Vec::new(),
            nodes: 0,
            newest_us: None,
            values: Vec::new(),
            rows: vec![0; layers],
            counters: Counters { layers: vec![LayerCounters::default(); layers], ..Counters::default() },
        })
    }

    /// The same with another policy for late events; before the first event only.
    #[must_use]
    pub fn with_late(self, late: LatePolicy) -> Self {
        Self { admission: self.admission.with_late(late), ..self }
    }

    /// The same with another policy for restarts; before the first event only.
    #[must_use]
    pub fn with_restart(self, restart: RestartPolicy) -> Self {
        Self { watch: ClockWatch::new(restart, self.batch.sensor(), self.network().parts().span_us), ..self }
    }

    /// The same with a different search, as [`Batch::with_search`].
    #[must_use]
    pub fn with_search(self, search: Search) -> Self {
        Self { batch: self.batch.with_search(search), ..self }
    }

    /// The same with a different instruction set, as [`Batch::with_isa`].
    #[must_use]
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { batch: self.batch.with_isa(isa), ..self }
    }

    /// The same with bounded memory: events that no prediction depends on are forgotten. Keeps at
    /// most twice [`Self::most_events`], 16 bytes each.
    #[must_use]
    pub fn with_bounded_memory(self) -> Self {
        let parts = self.batch.network().parts();
        // A pooled level reads the window's edges, chosen among the events of one more window. Each
        // block adds one window, because its rows read rows that are older by a window.
        let windows = if parts.graph.is_frozen() { parts.events.blocks.len().max(1) + 1 } else { 1 };
        Self { most_events: parts.capacity.saturating_mul(windows), ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<Network> {
        self.batch.network()
    }

    /// The batch.
    pub fn batch(&self) -> &Batch {
        &self.batch
    }

    /// Inserts an event, as [`Engine::push`](crate::Engine::push).
    pub fn push(&mut self, event: Event) -> Outcome {
        match self.watch.decide(event, self.now_us()) {
            None => self.enter(event),
            Some(decision) => self.carry_out(&decision),
        }
    }

    /// Carries out a decision; returns the outcome of the newest event.
    fn carry_out(&mut self, decision: &Decision) -> Outcome {
        self.admission.count(decision);
        if decision.restarts {
            self.forget();
        }
        let Ok(outcome) = decision.enter(|event| Ok::<_, Infallible>(self.enter(event)));
        outcome
    }

    fn enter(&mut self, event: Event) -> Outcome {
        let event = match self.admission.admit(event) {
            Ok(event) => event,
            Err(reason) => return Outcome::Dropped(reason),
        };
        self.expire();
        if self.nodes == self.network().parts().capacity {
            self.nodes -= 1;
            self.admission.counters_mut().evicted += 1;
        }
        if self.events.len() >= self.most_events.saturating_mul(2) {
            self.events.drain(..self.events.len() - self.most_events);
        }
        self.events.push(event);
        self.nodes += 1;
        self.newest_us = Some(event.t_us);
        Outcome::Accepted
    }

    /// As [`Engine::arrival_us`](crate::Engine::arrival_us).
    pub fn arrival_us(&self, event: Event) -> Option<i64> {
        self.admission.arrival_us(event)
    }

    /// Inserts events in order; returns the number of accepted events.
    pub fn push_slice(&mut self, events: &[Event]) -> usize {
        let before = self.event_counters().accepted;
        for &event in events {
            self.push(event);
        }
        (self.event_counters().accepted - before) as usize
    }

    /// Advances the clock to `t_us`, as [`Engine::advance`](crate::Engine::advance).
    pub fn advance(&mut self, t_us: i64) {
        let decision = self.watch.advance(t_us, self.now_us());
        self.carry_out(&decision);
        self.admission.advance(t_us);
        self.expire();
    }

    fn expire(&mut self) {
        let span_us = self.network().parts().span_us;
        let oldest_kept = self.now_us().map_or(i64::MIN, |now| now.saturating_sub(span_us));
        let window = &self.events[self.events.len() - self.nodes..];
        let expired = window.iter().take_while(|event| event.t_us < oldest_kept).count();
        self.nodes -= expired;
        self.admission.counters_mut().expired += expired as u64;
    }

    /// Computes the prediction for the current window. Cost: that of [`Batch::forward`].
    ///
    /// # Errors
    /// As [`Batch::forward`].
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let trace = self.trace()?;
        let network = self.batch.network();
        let mut layers = self.counters.layers.iter_mut().zip(&mut self.rows);
        for (level, trace) in trace.levels.iter().enumerate() {
            let computed = trace.features[0].rows() as u64;
            for (layer, rows) in layers.by_ref().take(network.layers_of(level)) {
                *rows = computed;
                layer.recomputed += computed;
            }
        }
        self.counters.predictions.read += 1;
        self.counters.predictions.cells_recomputed += trace.readout.rows() as u64;
        self.values = trace.prediction;
        let unlike = self.unlikeness();
        let (values, t_us, nodes, rows) = (&self.values, self.newest_us, self.nodes, &self.rows);
        Ok(Prediction { values, t_us, nodes, rows, unlike })
    }

    /// As [`Engine::unlikeness`](crate::Engine::unlikeness), from all events of the window.
    pub fn unlikeness(&self) -> Option<f32> {
        self.network().unlikeness(self.batch.sensor(), || self.window_statistics())
    }

    /// Sums over the events of the window as it is now. O(window).
    pub fn window_statistics(&self) -> WindowStatistics {
        let window = &self.events[self.events.len() - self.nodes..];
        WindowStatistics::of(window, self.batch.sensor(), self.now_us().unwrap_or(0))
    }

    /// Computes the activations of all layers, as [`Self::predict`] does, and returns them.
    ///
    /// # Errors
    /// As [`Batch::forward`].
    pub fn trace(&self) -> Result<Trace, EngineError> {
        self.batch.forward(self.stream())
    }

    /// The stream that the batch computes.
    pub fn stream(&self) -> Stream<'_> {
        let time = |t_us: Option<i64>| t_us.unwrap_or(0);
        Stream {
            events: self.events(),
            epoch_us: time(self.admission.epoch_us()),
            now_us: time(self.now_us()),
        }
    }

    /// Removes all events, as [`Engine::reset`](crate::Engine::reset). Counters are kept.
    pub fn reset(&mut self) {
        let decision = self.watch.end(self.now_us());
        self.carry_out(&decision);
        self.forget();
    }

    fn forget(&mut self) {
        self.admission.reset();
        self.events.clear();
        (self.nodes, self.newest_us) = (0, None);
    }

    /// Remembered events, from the oldest: those in the window, and earlier ones.
    pub fn events(&self) -> &[Event] {
        &self.events[self.events.len().saturating_sub(self.most_events)..]
    }

    /// Number of events that the next prediction can depend on.
    pub fn most_events(&self) -> usize {
        self.most_events
    }

    /// Number of events in the window.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Time of the newest event or a later `advance`; `None` before the first event.
    pub fn now_us(&self) -> Option<i64> {
        self.admission.now_us()
    }

    /// Counts of events.
    pub fn event_counters(&self) -> &EventCounters {
        self.admission.counters()
    }

    /// Counts of the work done. Every row counts as recomputed.
    pub fn counters(&self) -> Counters {
        Counters { events: *self.admission.counters(), ..self.counters.clone() }
    }
}

impl fmt::Debug for BatchEngine {
    /// Shows the configuration, not the state.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BatchEngine")
            .field("network", &self.network().name())
            .field("nodes", &self.nodes)
            .field("now_us", &self.now_us())
            .finish_non_exhaustive()
    }
}
