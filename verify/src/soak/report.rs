//! Results of a soak, and the promises that it breaks.

use meissner_run::latency::{Latency, Quantiles};
use meissner_run::text::grouped;
use serde::Serialize;

/// A value for each call of the engine.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Calls<T> {
    /// `Engine::push`.
    pub push: T,
    /// `Engine::predict`.
    pub predict: T,
}

impl Calls<Latency> {
    pub(crate) fn quantiles(&self) -> Calls<Option<Quantiles>> {
        Calls { push: self.push.quantiles(), predict: self.predict.quantiles() }
    }
}

/// Disturbances of each kind, and returns to a state after which the prediction differed.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Disturbances {
    pub silences: u64,
    /// Silences in which time was moved on.
    pub advances: u64,
    /// States as bytes.
    pub bytes: u64,
    pub snapshots: u64,
    pub resets: u64,
    /// Returns to a state after which the prediction had other bits.
    pub returns_that_differ: u64,
}

/// A comparison with the batch, and measurements since the checkpoint before.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, Serialize)]
pub struct Checkpoint {
    pub events: u64,
    pub t_us: Option<i64>,
    pub nodes: usize,
    /// Events that the batch went over.
    pub compared: usize,
    pub equal: bool,
    /// Bits of the prediction, hexadecimal.
    pub bits: Vec<String>,
    /// Latencies of the calls.
    pub latency_us: Calls<Option<Quantiles>>,
    /// What the process has allocated and not freed, where the caller knows it.
    pub live_bytes: Option<u64>,
    /// Resident memory of the process, where the platform reports it.
    pub resident_bytes: Option<u64>,
    /// Time since the start.
    pub seconds: f64,
}

/// Several checkpoints together.
#[derive(Debug, Default)]
pub(crate) struct Part {
    latencies: Calls<Latency>,
    resident: Vec<u64>,
}

impl Part {
    pub(crate) fn add(&mut self, row: &Checkpoint, latencies: &Calls<Latency>) {
        self.latencies.push.add(&latencies.push);
        self.latencies.predict.add(&latencies.predict);
        self.resident.extend(row.resident_bytes);
    }

    pub(crate) fn report(self) -> PartReport {
        PartReport { latency_us: self.latencies.quantiles(), resident_bytes: median(self.resident) }
    }
}

/// Results of several checkpoints.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PartReport {
    pub latency_us: Calls<Option<Quantiles>>,
    /// Median of the resident memory.
    pub resident_bytes: Option<u64>,
}

/// Quantiles of the end as multiples of those of the start.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    pub p50: f64,
    pub p99: f64,
}

/// Live memory after warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Memory {
    /// Largest value in the warm-up.
    pub warm_bytes: u64,
    /// Median over the last tenth.
    pub end_bytes: u64,
    /// Growth from the first to the second.
    pub growth_percent: f64,
}

/// The result of a soak.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    pub recordings: Vec<String>,
    /// Recordings that began after the first.
    pub rounds: u64,
    pub isa: &'static str,
    pub seed: u64,
    /// Events from one prediction to the next.
    pub every: u64,
    pub events: u64,
    /// Events that entered the window.
    pub accepted: u64,
    pub disturbances: Disturbances,
    /// The first tenth of the checkpoints.
    pub first: PartReport,
    /// The last tenth.
    pub last: PartReport,
    /// Latencies of the last tenth as multiples of those of the first.
    pub ratio: Calls<Option<Ratio>>,
    /// Memory after warm-up; `None` if it is not judged.
    pub memory: Option<Memory>,
    /// Largest resident memory of the process.
    pub peak_resident_bytes: Option<u64>,
    pub seconds: f64,
    /// A sentence for each broken promise.
    pub broken: Vec<String>,
    pub checkpoints: Vec<Checkpoint>,
}

/// The middle of `values`, the upper one of two.
fn median(mut values: Vec<u64>) -> Option<u64> {
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}

/// With fewer checkpoints, warm-up and end cannot be told apart.
const FEWEST: usize = 20;

/// `report` with ratios, memory after warm-up (which may grow by `memory_growth` percent), and a
/// sentence for each broken promise.
pub(crate) fn judged(report: Report, memory_growth: u32) -> Report {
    let memory = memory(&report.checkpoints);
    let mut broken: Vec<String> = report.checkpoints.iter().filter_map(differs).collect();
    if report.disturbances.returns_that_differ > 0 {
        let count = grouped(report.disturbances.returns_that_differ);
        broken.push(format!(
            "expected the same prediction after the return to a state, found other bits {count} times"
        ));
    }
    if let Some(memory) = memory.filter(|memory| memory.growth_percent > f64::from(memory_growth)) {
        broken.push(format!(
            "expected live memory to grow by at most {memory_growth} % after warm-up, found {:.1} %: {} to {} bytes",
            memory.growth_percent,
            grouped(memory.warm_bytes),
            grouped(memory.end_bytes)
        ));
    }
    Report { memory, broken, ..report }
}

fn differs(row: &Checkpoint) -> Option<String> {
    (!row.equal).then(|| {
        let (events, compared) = (grouped(row.events), grouped(row.compared as u64));
        format!("expected the bits of the batch over {compared} events after event {events}, found others")
    })
}

/// The last tenth against the largest value of the warm-up; none if unknown or too few.
fn memory(rows: &[Checkpoint]) -> Option<Memory> {
    if rows.len() < FEWEST {
        return None;
    }
    let live = |rows: &[Checkpoint]| rows.iter().filter_map(|row| row.live_bytes).collect::<Vec<_>>();
    let warm_bytes = live(&rows[..warm_up(rows)]).into_iter().max()?;
    let end_bytes = median(live(&rows[rows.len() - rows.len().div_ceil(10)..]))?;
    let growth_percent = 100.0 * (end_bytes as f64 / warm_bytes as f64 - 1.0);
    Some(Memory { warm_bytes, end_bytes, growth_percent })
}

/// Checkpoints of the warm-up: until the largest batch, but a fifth at least and half at most.
fn warm_up(rows: &[Checkpoint]) -> usize {
    let most = rows.iter().map(|row| row.compared).max();
    let largest = rows.iter().position(|row| Some(row.compared) == most).map_or(0, |at| at + 1);
    largest.max(rows.len() / 5).min(rows.len() / 2)
}

pub(crate) fn ratios(first: &PartReport, last: &PartReport) -> Calls<Option<Ratio>> {
    let of = |first: Option<Quantiles>, last: Option<Quantiles>| {
        first.zip(last).map(|(first, last)| Ratio { p50: last.p50 / first.p50, p99: last.p99 / first.p99 })
    };
    let (first, last) = (&first.latency_us, &last.latency_us);
    Calls { push: of(first.push, last.push), predict: of(first.predict, last.predict) }
}
