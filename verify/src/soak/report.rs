//! Results of a soak, and the promises that it breaks.

use std::cmp::Ordering;
use std::ops::AddAssign;

use meissner_run::latency::{Latency, Quantiles};
use meissner_run::text::grouped;
use serde::{Deserialize, Serialize};

/// A value for each call of the engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Disturbances {
    pub silences: u64,
    /// Silences with an advance of the time.
    pub advances: u64,
    /// States that were written as bytes.
    pub bytes: u64,
    pub snapshots: u64,
    pub resets: u64,
    /// Returns after which the prediction had other bits.
    pub returns_that_differ: u64,
}

impl AddAssign for Disturbances {
    fn add_assign(&mut self, other: Self) {
        let Self { silences, advances, bytes, snapshots, resets, returns_that_differ } = other;
        self.silences += silences;
        self.advances += advances;
        self.bytes += bytes;
        self.snapshots += snapshots;
        self.resets += resets;
        self.returns_that_differ += returns_that_differ;
    }
}

/// A comparison with the batch, and measurements since the previous checkpoint.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Events since the start.
    pub events: u64,
    /// Events that entered the window.
    pub accepted: u64,
    /// Recordings that began after the first.
    pub rounds: u64,
    pub disturbances: Disturbances,
    pub t_us: Option<i64>,
    pub nodes: usize,
    /// Events that the batch computed.
    pub compared: usize,
    pub equal: bool,
    /// Bits of the prediction, hexadecimal.
    pub bits: Vec<String>,
    /// Latencies of the calls.
    pub latency_us: Calls<Option<Quantiles>>,
    /// Bytes that the process has allocated and not freed, if the caller knows them.
    pub live_bytes: Option<u64>,
    /// Resident memory of the process, where the platform reports it.
    pub resident_bytes: Option<u64>,
    /// Time since the start, without the time between two processes.
    pub seconds: f64,
}

/// Results of several checkpoints.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PartReport {
    /// Medians of the quantiles, and the largest maximum.
    pub latency_us: Calls<Option<Quantiles>>,
    /// Median of the resident memory.
    pub resident_bytes: Option<u64>,
}

impl PartReport {
    fn of(rows: &[Checkpoint]) -> Self {
        let latency = |of: fn(&Calls<Option<Quantiles>>) -> Option<Quantiles>| {
            let all: Vec<Quantiles> = rows.iter().filter_map(|row| of(&row.latency_us)).collect();
            let middle = |of: fn(&Quantiles) -> f64| median(all.iter().map(of), f64::total_cmp);
            let max = all.iter().map(|quantiles| quantiles.max).max_by(f64::total_cmp)?;
            Some(Quantiles {
                p50: middle(|quantiles| quantiles.p50)?,
                p90: middle(|quantiles| quantiles.p90)?,
                p99: middle(|quantiles| quantiles.p99)?,
                p999: middle(|quantiles| quantiles.p999)?,
                max,
            })
        };
        let latency_us = Calls { push: latency(|calls| calls.push), predict: latency(|calls| calls.predict) };
        let resident = rows.iter().filter_map(|row| row.resident_bytes);
        Self { latency_us, resident_bytes: median(resident, u64::cmp) }
    }
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
    /// Growth from `warm_bytes` to `end_bytes`.
    pub growth_percent: f64,
}

/// The result of a soak.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    pub recordings: Vec<String>,
    /// Recordings that began after the first.
    pub rounds: u64,
    pub isa: String,
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

impl Report {
    /// Counts, times and parts of these checkpoints.
    pub(crate) fn with_checkpoints(self, rows: Vec<Checkpoint>) -> Self {
        let part = rows.len().div_ceil(10);
        let (first, last) = (PartReport::of(&rows[..part]), PartReport::of(&rows[rows.len() - part..]));
        let mut disturbances = Disturbances::default();
        rows.iter().for_each(|row| disturbances += row.disturbances);
        Self {
            rounds: rows.iter().map(|row| row.rounds).sum(),
            events: rows.last().map_or(0, |row| row.events),
            accepted: rows.iter().map(|row| row.accepted).sum(),
            disturbances,
            ratio: ratios(&first, &last),
            first,
            last,
            seconds: rows.last().map_or(0.0, |row| row.seconds),
            checkpoints: rows,
            ..self
        }
    }
}

/// The upper median of `values`.
fn median<T: Copy>(values: impl Iterator<Item = T>, order: fn(&T, &T) -> Ordering) -> Option<T> {
    let mut values: Vec<T> = values.collect();
    values.sort_unstable_by(order);
    values.get(values.len() / 2).copied()
}

/// With fewer checkpoints, warm-up and end cannot be distinguished.
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

/// The last tenth against the largest value of the warm-up; `None` if the values are unknown or too
/// few.
fn memory(rows: &[Checkpoint]) -> Option<Memory> {
    if rows.len() < FEWEST {
        return None;
    }
    let (start, end) = (&rows[..warm_up(rows)], &rows[rows.len() - rows.len().div_ceil(10)..]);
    let warm_bytes = start.iter().filter_map(|row| row.live_bytes).max()?;
    let end_bytes = median(end.iter().filter_map(|row| row.live_bytes), u64::cmp)?;
    let growth_percent = 100.0 * (end_bytes as f64 / warm_bytes as f64 - 1.0);
    Some(Memory { warm_bytes, end_bytes, growth_percent })
}

/// Checkpoints of the warm-up: until the largest batch, but at least a fifth and at most half of
/// all.
fn warm_up(rows: &[Checkpoint]) -> usize {
    let most = rows.iter().map(|row| row.compared).max();
    let largest = rows.iter().position(|row| Some(row.compared) == most).map_or(0, |at| at + 1);
    largest.max(rows.len() / 5).min(rows.len() / 2)
}

fn ratios(first: &PartReport, last: &PartReport) -> Calls<Option<Ratio>> {
    let of = |first: Option<Quantiles>, last: Option<Quantiles>| {
        first.zip(last).map(|(first, last)| Ratio { p50: last.p50 / first.p50, p99: last.p99 / first.p99 })
    };
    let (first, last) = (&first.latency_us, &last.latency_us);
    Calls { push: of(first.push, last.push), predict: of(first.predict, last.predict) }
}
