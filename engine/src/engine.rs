//! The engine: events in, predictions out.

mod inspection;
mod snapshot;

use std::convert::Infallible;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use crate::admission::Admission;
use crate::counters::{Counters, EventCounters, LayerLog, Log, Outcome, Stage};
use crate::error::option;
use crate::filters::FilterRule;
use crate::memory::Memory;
use crate::network::{Network, Normalisation};
use crate::options::Options;
use crate::pooled::Shape;
use crate::restart::{ClockWatch, Decision};
use crate::snapshot::SnapshotOf;
use crate::step::StageState;
#[cfg(doc)]
use crate::unlikeness::TrainingWindows;
use crate::unlikeness::WindowStatistics;
use crate::window::Window;
use crate::{EngineError, Event, Sensor};

/// A prediction and its cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction<'a> {
    /// Outputs of the last dense layer.
    pub values: &'a [f32],
    /// Time of the newest event that the prediction covers; `None` before the first event.
    pub t_us: Option<i64>,
    /// Events in the window.
    pub nodes: usize,
    /// Rows computed per layer since the previous prediction, in the order of [`Network::layers`].
    pub rows: &'a [u64],
    /// How unlike the window is to those of the training: above 1, fewer than 1 of 1,000 windows of
    /// the training were ([`TrainingWindows::unlikeness`]); the same for frames. `None` if the
    /// network has no statistics of its training.
    pub unlike: Option<f32>,
}

/// The state of an [`Engine`] at one moment; see [`Engine::snapshot`].
pub type Snapshot = SnapshotOf<Engine>;

/// Keeps the event graph of a sliding window and every activation over it; recomputes the rows that
/// a change affects. Predictions equal those of [`crate::Batch`] bit for bit, unless
/// [`Options::tolerance`] allows an approximation.
///
/// ```
/// # use std::sync::Arc;
/// # use meissner_engine::{Engine, EngineError, Event, Network, Sensor};
/// fn watch(network: Arc<Network>, events: &[Event]) -> Result<Vec<f32>, EngineError> {
///     let mut engine = Engine::new(network, Sensor::new(240, 180))?;
///     engine.push_slice(events);
///     Ok(engine.predict()?.values.to_vec())
/// }
/// ```
#[derive(Clone)]
pub struct Engine {
    network: Arc<Network>,
    sensor: Sensor,
    options: Options,
    watch: ClockWatch,
    admission: Admission,
    step: StageState,
    bytes: u128,
    log: Log,
    newest_us: Option<i64>,
    rows: Vec<u64>,
    recomputed: Vec<u64>,
    /// Whether a prediction was read since the last row was computed.
    reported: bool,
}

impl Engine {
    /// An engine with the default [`Options`].
    ///
    /// # Errors
    /// As [`Engine::with_options`].
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor) -> Result<Self, EngineError> {
        Self::with_options(network, sensor, Options::default())
    }

    /// An engine for `network` over the events of `sensor`. All memory is allocated here. (Errors,
    /// snapshots and methods that return a `Vec` allocate too.)
    ///
    /// # Errors
    /// [`EngineError::NotIncremental`] for per-graph normalisation, [`EngineError::Sensor`] for a
    /// sensor without pixels, [`EngineError::Option`] for a tolerance below 0 or not finite, and
    /// for more pixels than a filter of the network takes, [`EngineError::Memory`] if the state
    /// would exceed the limit.
    pub fn with_options(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        options: Options,
    ) -> Result<Self, EngineError> {
        let network = network.into();
        if network.parts().normalisation == Normalisation::PerGraph {
            return Err(EngineError::NotIncremental(network.name().to_owned()));
        }
        if sensor.width == 0 || sensor.height == 0 {
            return Err(EngineError::Sensor(sensor));
        }
        if !(options.tolerance.is_finite() && options.tolerance >= 0.0) {
            return Err(option("tolerance", "a finite number of at least 0", options.tolerance));
        }
        let layers = network.layers().len();
        let needed = Memory::needed(|memory| {
            StageState::new(Arc::clone(&network), sensor, &options, memory);
            logs(&network, sensor, options.record_rows, memory);
            network.filters().iter().for_each(|_| memory.add(FilterRule::bytes(sensor)));
        });
        let of_layers = layers * (size_of::<LayerLog>() + 2 * size_of::<u64>());
        let bytes = needed.saturating_add(of_layers as u128);
        if bytes > options.memory_limit || bytes == u128::MAX {
            return Err(EngineError::Memory {
                network: network.name().to_owned(),
                sensor,
                capacity: network.parts().capacity,
                bytes,
                limit: options.memory_limit,
            });
        }
        let logs = logs(&network, sensor, options.record_rows, &mut Memory::default());
        Ok(Self {
            step: StageState::new(Arc::clone(&network), sensor, &options, &mut Memory::default()),
            bytes,
            watch: ClockWatch::new(options.restart, sensor, network.parts().span_us),
            admission: Admission::new(sensor, options.late).with_filters(network.filters())?,
            log: Log { layers: logs, ..Log::default() },
            newest_us: None,
            rows: vec![0; layers],
            recomputed: vec![0; layers],
            reported: false,
            network,
            sensor,
            options,
        })
    }

    /// The network.
    pub fn network(&self) -> &Arc<Network> {
        &self.network
    }

    /// The sensor.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// Largest change that does not propagate; 0 if the engine is exact.
    pub fn tolerance(&self) -> f32 {
        self.options.tolerance
    }

    /// Inserts an event. The engine drops and counts events outside the sensor, late events (unless
    /// clamped), events whose distance from the epoch does not fit 64 bits, and events that the
    /// [filters of the network](Network::filters) drop. Events of equal time keep their order of
    /// arrival. Events older than the span expire first; if the window is full, the oldest is
    /// evicted.
    ///
    /// An event far ahead of the clock, or behind it by more than the span, is
    /// [held](Outcome::Held): later events decide whether the clock has restarted, which resets the
    /// engine ([`RestartPolicy`](crate::RestartPolicy)).
    ///
    /// Cost: O(k) rows with k neighbours for `frozen`; otherwise the graph, and rows when read.
    pub fn push(&mut self, event: Event) -> Outcome {
        let outcome = self.take(event);
        self.step.compute_arrivals(&mut self.log);
        outcome
    }

    /// Inserts events as by [`Self::push`] one by one, bit for bit; returns the number accepted.
    ///
    /// Faster than single pushes for `frozen`: rows of up to 64 events are computed layer by layer,
    /// before a node that they read leaves.
    pub fn push_slice(&mut self, events: &[Event]) -> usize {
        self.push_all(events.iter().copied())
    }

    /// As [`Self::push_slice`], for events that are not in one slice.
    pub fn push_all(&mut self, events: impl IntoIterator<Item = Event>) -> usize {
        let before = self.admission.counters().accepted;
        for event in events {
            self.take(event);
        }
        self.step.compute_arrivals(&mut self.log);
        (self.admission.counters().accepted - before) as usize
    }

    /// Inserts an event unless its time does not agree with the clock. Its row may wait.
    #[inline]
    fn take(&mut self, event: Event) -> Outcome {
        match self.watch.decide(event, self.admission.now_us()) {
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

    /// Inserts an event. Its row may wait.
    fn enter(&mut self, event: Event) -> Outcome {
        let node = match self.admission.admit_node(event) {
            Ok(node) => node,
            Err(reason) => return Outcome::Dropped(reason),
        };
        self.begin();
        self.expire();
        if self.step.window.is_full() {
            self.step.leave(1, &mut self.log);
            self.admission.counters_mut().evicted += 1;
        }
        self.step.enter(node, &mut self.log);
        self.newest_us = self.admission.now_us();
        Outcome::Accepted
    }

    /// The time at which `event` would enter; `None` if it would be dropped. An event that would be
    /// [held](Outcome::Held) is treated as one that is not.
    pub fn arrival_us(&self, event: Event) -> Option<i64> {
        self.admission.arrival_us(event)
    }

    /// Advances the clock to `t_us` (events' time); events older than the span expire. Earlier
    /// times, times before the first event, and times whose distance from the epoch does not fit 64
    /// bits change nothing.
    pub fn advance(&mut self, t_us: i64) {
        let decision = self.watch.advance(t_us, self.admission.now_us());
        if !decision.taken.events().is_empty() {
            self.carry_out(&decision);
            self.step.compute_arrivals(&mut self.log);
        }
        self.admission.advance(t_us);
        self.expire();
    }

    fn expire(&mut self) {
        let oldest_kept = self.admission.now() - self.network.parts().span_us;
        let leaving = self.step.window.earlier_than(oldest_kept);
        if leaving > 0 {
            self.step.leave(leaving, &mut self.log);
            self.admission.counters_mut().expired += u64::from(leaving);
        }
    }

    /// The prediction for the current window. Recomputes the rows that changed since the last one.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`] if a layer computed NaN; the engine predicts again once those
    /// rows have left.
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.begin();
        self.reported = true;
        self.step.compute_changes(self.admission.now(), &mut self.log);
        self.count_rows();
        let (t_us, nodes, unlike) = (self.newest_us, self.step.window.len(), self.unlikeness());
        let values = self.step.prediction()?;
        Ok(Prediction { values, t_us, nodes, rows: &self.rows, unlike })
    }

    /// As [`Prediction::unlike`], for the current window. Computes no row.
    pub fn unlikeness(&self) -> Option<f32> {
        self.network.unlikeness(self.sensor, || self.window_statistics())
    }

    /// Sums over the events of the window as it is now. O(1) for a network with statistics of the
    /// [windows of its training](Network::training_windows), else O(window).
    pub fn window_statistics(&self) -> WindowStatistics {
        self.step.statistics(self.admission.now()).unwrap_or_else(|| {
            WindowStatistics::of(&self.events(), self.sensor, self.admission.now_us().unwrap_or(0))
        })
    }

    /// Starts a new record of computed rows if a prediction was read.
    fn begin(&mut self) {
        if self.reported {
            self.log.layers.iter_mut().filter_map(|log| log.rows.as_mut()).for_each(|rows| rows.clear());
            self.reported = false;
        }
    }

    /// Collects the rows computed since the last prediction, and counts those that were kept.
    fn count_rows(&mut self) {
        let mut layers = self.log.layers.iter_mut().zip(&mut self.rows).zip(&mut self.recomputed);
        for level in 0..self.network.levels() {
            for ((LayerLog { counters: layer, .. }, rows), before) in
                layers.by_ref().take(self.network.layers_of(level))
            {
                *rows = layer.recomputed - *before;
                *before = layer.recomputed;
                layer.kept += (self.step.nodes(level) as u64).saturating_sub(*rows);
            }
        }
    }

    /// Removes all events; the next event sets a new epoch. Counters are kept.
    pub fn reset(&mut self) {
        let decision = self.watch.end(self.admission.now_us());
        self.carry_out(&decision);
        self.forget();
    }

    /// Removes all events except held ones.
    fn forget(&mut self) {
        self.step.clear();
        self.admission.reset();
        self.newest_us = None;
    }

    /// Counts of events; as in [`Self::counters`], without copying the others.
    pub fn event_counters(&self) -> &EventCounters {
        self.admission.counters()
    }

    /// Events that are held because their times do not agree with the clock.
    pub fn held(&self) -> &[Event] {
        self.watch.held()
    }

    /// Counts of computed, kept and dropped work.
    pub fn counters(&self) -> Counters {
        Counters {
            events: *self.admission.counters(),
            layers: self.log.layers.iter().map(|log| log.counters).collect(),
            predictions: self.log.predictions,
        }
    }

    /// Time spent in each stage; zeros unless [`Options::stage_times`] is set.
    pub fn stage_times(&self) -> [(Stage, Duration); Stage::ALL.len()] {
        self.step.stopwatch.times()
    }

    /// Bytes of state, all allocated in `new`; without the network's parameters.
    pub fn state_bytes(&self) -> u128 {
        self.bytes
    }

    /// Number of events in the window.
    pub fn nodes(&self) -> usize {
        self.step.window.len()
    }

    /// Time of the newest event or a later `advance`; `None` before the first event.
    pub fn now_us(&self) -> Option<i64> {
        self.admission.now_us()
    }

    /// Time of the first accepted event since the last reset. All other times count from it.
    pub fn epoch_us(&self) -> Option<i64> {
        self.admission.epoch_us()
    }
}

/// The logs of the layers of `network`; with `record`, each has room for every row of its level.
fn logs(network: &Network, sensor: Sensor, record: bool, memory: &mut Memory) -> Vec<LayerLog> {
    let events = Window::slots_for(network.parts().capacity);
    let pooled = Shape::all(network, sensor).0;
    let slots = [events].into_iter().chain(pooled.iter().map(Shape::slots));
    let of_levels = slots.enumerate().flat_map(|(level, slots)| vec![slots; network.layers_of(level)]);
    let log = |slots| LayerLog { rows: record.then(|| memory.room(slots)), ..LayerLog::default() };
    // Allocates exactly the counted room.
    let mut logs = Vec::with_capacity(network.layers().len());
    logs.extend(of_levels.map(log));
    logs
}

impl fmt::Debug for Engine {
    /// Shows the configuration, not the state.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine")
            .field("network", &self.network.name())
            .field("sensor", &self.sensor)
            .field("options", &self.options)
            .field("nodes", &self.nodes())
            .field("now_us", &self.now_us())
            .finish_non_exhaustive()
    }
}
