//! What came of a soak. The help of `--json` describes it.

use std::time::Duration;

use serde::Serialize;

use super::subject::{Checked, Timed};
use meissner_pipeline::latency::{Latency, Quantiles};
use meissner_pipeline::lost::Warning;
use meissner_pipeline::provenance::{Header, ModelCard};

/// Something for both calls.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Calls<T> {
    pub(super) push: T,
    pub(super) predict: T,
}

impl Calls<Latency> {
    pub(super) fn new() -> Self {
        Self { push: Latency::new(), predict: Latency::new() }
    }

    fn quantiles(&self) -> Calls<Option<Quantiles>> {
        Calls { push: self.push.quantiles(), predict: self.predict.quantiles() }
    }
}

/// How often what was done, and what went wrong with it.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Disturbances {
    pub(super) silences: u64,
    pub(super) advances: u64,
    pub(super) bytes: u64,
    pub(super) snapshots: u64,
    pub(super) resets: u64,
    pub(super) returns_that_differ: u64,
}

/// One comparison with the batch, and what was measured since the last.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Checkpoint {
    pub(super) events: u64,
    pub(super) t_us: Option<i64>,
    pub(super) nodes: usize,
    pub(super) compared: usize,
    pub(super) equal: bool,
    pub(super) bits: Vec<String>,
    pub(super) latency_us: Calls<Option<Quantiles>>,
    pub(super) resident_bytes: Option<u64>,
    pub(super) seconds: f64,
}

impl Checkpoint {
    pub(super) fn new(
        events: u64,
        checked: &Checked,
        timed: &Timed,
        resident_bytes: Option<u64>,
        elapsed: Duration,
    ) -> Self {
        Self {
            events,
            t_us: checked.t_us,
            nodes: checked.nodes,
            compared: checked.compared,
            equal: checked.equal,
            bits: checked.bits.iter().map(|bits| format!("{bits:08x}")).collect(),
            latency_us: timed.quantiles(),
            resident_bytes,
            seconds: elapsed.as_secs_f64(),
        }
    }
}

/// Several checkpoints together.
#[derive(Debug)]
pub(super) struct Part {
    timed: Timed,
    resident: Vec<u64>,
}

impl Part {
    pub(super) fn new() -> Self {
        Self { timed: Timed::new(), resident: Vec::new() }
    }

    pub(super) fn add(&mut self, row: &Checkpoint, timed: &Timed) {
        self.timed.push.add(&timed.push);
        self.timed.predict.add(&timed.predict);
        self.resident.extend(row.resident_bytes);
    }

    pub(super) fn report(self) -> PartReport {
        PartReport { latency_us: self.timed.quantiles(), resident_bytes: median(self.resident) }
    }
}

/// What is said about several checkpoints.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct PartReport {
    pub(super) latency_us: Calls<Option<Quantiles>>,
    pub(super) resident_bytes: Option<u64>,
}

/// Quantiles of the end as multiples of those of the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Ratio {
    pub(super) p50: f64,
    pub(super) p99: f64,
}

/// Resident memory after warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Memory {
    pub(super) warm_bytes: u64,
    pub(super) end_bytes: u64,
    pub(super) growth_percent: f64,
}

/// The result of a soak.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    /// What ran on what.
    pub(super) header: Header,
    pub(super) recordings: Vec<String>,
    pub(super) rounds: u64,
    #[serde(skip)]
    pub(super) card: ModelCard,
    #[serde(skip)]
    pub(super) sensor: [u16; 2],
    pub(super) isa: &'static str,
    pub(super) seed: u64,
    pub(super) every: u64,
    pub(super) events: u64,
    pub(super) accepted: u64,
    pub(super) warnings: Vec<Warning>,
    pub(super) disturbances: Disturbances,
    pub(super) first: PartReport,
    pub(super) last: PartReport,
    pub(super) ratio: Option<Calls<Option<Ratio>>>,
    pub(super) memory: Option<Memory>,
    pub(super) peak_resident_bytes: Option<u64>,
    pub(super) seconds: f64,
    pub(super) broken: Vec<String>,
    pub(super) checkpoints: Vec<Checkpoint>,
}

/// The middle of `values`, the upper one of two.
pub(super) fn median(mut values: Vec<u64>) -> Option<u64> {
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}
