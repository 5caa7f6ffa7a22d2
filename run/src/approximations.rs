//! Approximations, and the report of their effects.
//!
//! Filters drop events, fewer neighbours change the network, the tolerance is an option of the
//! engine, a stale readout repeats its last prediction. Without any, results are exact.

use std::sync::Arc;

use meissner_engine::filters::{
    BackgroundActivity, Chain, EventFilter, Filter, FilterCounters, RateLimit, Refractory, Stride,
};
use meissner_engine::{Counters, Engine, EngineError, Network, Options, Sensor, StaleReadout, Staleness};
use serde::Serialize;

/// Approximations that make results cheaper and less exact. `Default` has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Approximations {
    /// A recomputed row or pixel keeps its values if no channel changes by more than this.
    pub tolerance: Option<f32>,
    /// Largest number of neighbours that a node reads.
    pub neighbours: Option<u8>,
    /// Background-activity filter: support time in microseconds.
    pub activity_filter_us: Option<i64>,
    /// Refractory filter: time in microseconds.
    pub refractory_us: Option<i64>,
    /// Rate limit in events per second.
    pub rate_limit: Option<u64>,
    /// Every `stride`-th event enters.
    pub stride: Option<u32>,
    /// A prediction is recomputed after this many accepted events.
    pub stale_events: Option<u64>,
    /// A prediction is recomputed after this much stream time, in microseconds.
    pub stale_us: Option<i64>,
}

impl Approximations {
    /// Whether there are no approximations, so that results are exact.
    pub fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    /// `network` with at most [`Self::neighbours`] neighbours.
    ///
    /// # Errors
    /// The number of neighbours is not possible.
    pub fn adapt(&self, network: Network) -> Result<Network, EngineError> {
        match self.neighbours {
            Some(neighbours) => network.with_neighbours(neighbours.into()),
            None => Ok(network),
        }
    }

    /// The filters before the engine.
    ///
    /// # Errors
    /// A filter refuses its setting.
    pub fn chain(&self, sensor: Sensor) -> Result<Chain, EngineError> {
        let mut filters = Vec::new();
        if let Some(us) = self.activity_filter_us {
            filters.push(Filter::BackgroundActivity(BackgroundActivity::new(sensor, us)?));
        }
        if let Some(us) = self.refractory_us {
            filters.push(Filter::Refractory(Refractory::new(sensor, us)?));
        }
        if let Some(rate) = self.rate_limit {
            filters.push(Filter::RateLimit(RateLimit::new(rate)?));
        }
        if let Some(n) = self.stride {
            filters.push(Filter::Stride(Stride::new(n)?));
        }
        Ok(Chain::new(filters))
    }

    /// An engine for a `network` that was [adapted](Self::adapt), with tolerance and staleness.
    ///
    /// # Errors
    /// The engine refuses the sensor, an option or an approximation.
    pub fn readout(
        &self,
        network: Arc<Network>,
        sensor: Sensor,
        options: Options,
    ) -> Result<StaleReadout, EngineError> {
        let options = options.with_tolerance(self.tolerance.unwrap_or(0.0));
        StaleReadout::new(Engine::with_options(network, sensor, options)?, self.staleness())
    }

    pub(crate) fn is_stale(&self) -> bool {
        self.staleness() != Staleness::default()
    }

    fn staleness(&self) -> Staleness {
        Staleness::new().with_events(self.stale_events).with_us(self.stale_us)
    }

    /// The report of a run with these approximations; `None` if results are exact.
    pub fn report(&self, chain: &Chain, counters: &Counters, stale: u64) -> Option<ApproximationReport> {
        let of_filter = |filter: &Filter| {
            let FilterCounters { passed, dropped } = filter.counters();
            FilteredEvents { name: filter.name(), passed, dropped }
        };
        let within = || counters.layers.iter().map(|layer| layer.within_tolerance).sum();
        (!self.is_exact()).then(|| ApproximationReport {
            filters: chain.filters().iter().map(of_filter).collect(),
            neighbours: self.neighbours,
            tolerance: self.tolerance,
            rows_within_tolerance: self.tolerance.map(|_| within()),
            stale_events: self.stale_events,
            stale_us: self.stale_us,
            stale_predictions: self.is_stale().then_some(stale),
        })
    }
}

/// The approximations of a run. Approximations that were not requested are missing.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ApproximationReport {
    /// Filters, in the order in which events pass them.
    pub filters: Vec<FilteredEvents>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neighbours: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f32>,
    /// Recomputed rows that kept their stored values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows_within_tolerance: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_events: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_us: Option<i64>,
    /// Predictions that were repeated instead of computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_predictions: Option<u64>,
}

/// Events that a filter passed and dropped.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct FilteredEvents {
    pub name: &'static str,
    pub passed: u64,
    pub dropped: u64,
}
