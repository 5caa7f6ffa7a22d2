//! What a play amounts to, in the names of the JSON summary.

use std::collections::BTreeMap;

use serde::Serialize;

use super::tally::Reports;
use crate::run::json::Values;
use meissner_pipeline::approximations::ApproximationReport;
use meissner_pipeline::latency::Quantiles;
use meissner_pipeline::lost::Warning;

/// The whole play.
#[derive(Serialize)]
pub(super) struct Summary<'a> {
    /// Events taken from the recording.
    pub(super) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(super) lines_refused: u64,
    /// What the engine lost without anybody having asked for it, where that is much.
    pub(super) warnings: Vec<Warning>,
    pub(super) offered: u64,
    pub(super) delivered: u64,
    /// By the engine.
    pub(super) accepted: u64,
    /// By the queue and by the engine, by reason.
    pub(super) dropped: BTreeMap<&'static str, u64>,
    pub(super) queue: Queue,
    pub(super) reports: Reports,
    /// Times in microseconds.
    pub(super) latency_us: Latencies,
    pub(super) reader_lag_max_us: f64,
    pub(super) drain_us: f64,
    /// The prediction behind the last event.
    #[serde(rename = "final")]
    pub(super) last: Last<'a>,
    pub(super) verified: Option<Verified>,
    pub(super) peak_resident_bytes: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) approximations: Option<ApproximationReport>,
}

/// How long reports took; none where there was none.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Latencies {
    pub(super) waited: Option<Quantiles>,
    pub(super) age: Option<Quantiles>,
    /// Stream time.
    pub(super) behind: Option<Quantiles>,
}

/// The queue.
#[derive(Serialize)]
pub(super) struct Queue {
    pub(super) capacity: u32,
    pub(super) overload: &'static str,
    pub(super) high_water: u64,
    pub(super) blocked_us: f64,
}

/// A prediction.
#[derive(Serialize)]
pub(super) struct Last<'a> {
    pub(super) t_us: Option<i64>,
    pub(super) value: Values<'a>,
    pub(super) nodes: usize,
}

/// The last prediction against a batch.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Verified {
    /// Events that the batch went over.
    pub(super) events: usize,
    pub(super) equal: bool,
    pub(super) batch_us: f64,
}
