//! What a run amounts to: counts and latencies, in the names of the JSON summary.

use std::collections::BTreeMap;

use meissner_engine::{Counters, EventCounters};
use serde::Serialize;

use crate::skips::{Skips, dropped};
use meissner_pipeline::approximations::ApproximationReport;
use meissner_pipeline::latency::{Latency, Quantiles};
use meissner_pipeline::lost::Warning;
use meissner_pipeline::salvage::Salvaged;

/// The whole run.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// Events taken from the recording.
    pub(crate) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(crate) lines_refused: u64,
    /// Of the events, those that entered the window.
    pub(crate) accepted: u64,
    /// The others, by reason.
    pub(crate) dropped: BTreeMap<&'static str, u64>,
    /// Predictions read.
    pub(crate) predictions: u64,
    /// Most events in the window after any push.
    pub(crate) nodes_max: usize,
    /// Times in microseconds.
    pub(crate) latency_us: Latencies,
    /// Events taken, per second spent in pushes and predictions.
    pub(crate) events_per_s: Option<f64>,
    /// What was done and what was not needed.
    pub(crate) skips: Skips,
    /// What was lost without anybody having asked for it, where that is much.
    pub(crate) warnings: Vec<Warning>,
    /// What became of the events that no filter dropped.
    #[serde(skip)]
    pub(crate) gate: EventCounters,
    /// What was approximated; none where everything was exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) approximations: Option<ApproximationReport>,
    /// What was left out of the recording; none where it is whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) salvaged: Option<Salvaged>,
}

/// How long calls took; none where there was none.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Latencies {
    pub(crate) push: Option<Quantiles>,
    /// With moving time on to a prediction that is due between events.
    pub(crate) predict: Option<Quantiles>,
}

impl Summary {
    pub(crate) fn new(
        counters: &Counters,
        layers: &[&str],
        nodes_max: usize,
        push: &Latency,
        predict: &Latency,
    ) -> Self {
        let seconds = (push.total() + predict.total()).as_secs_f64();
        let events = counters.events.pushed;
        Self {
            events,
            lines_refused: 0,
            accepted: counters.events.accepted,
            dropped: dropped(counters),
            predictions: counters.predictions.read,
            nodes_max,
            latency_us: Latencies { push: push.quantiles(), predict: predict.quantiles() },
            events_per_s: (events > 0 && seconds > 0.0).then(|| events as f64 / seconds),
            skips: Skips::new(counters, layers),
            warnings: Vec::new(),
            gate: counters.events,
            approximations: None,
            salvaged: None,
        }
    }
}
