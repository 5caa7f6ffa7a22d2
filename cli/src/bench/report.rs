//! All results, in the names of the JSON report.

use std::collections::BTreeMap;

use meissner_engine::{Engine, Stage};
use serde::Serialize;

use super::pass::{Latencies, Measured};
use super::phases::{Phase, Phases, WINDOW_US};
use super::sum;
use crate::skips::{Skips, dropped};
use meissner_pipeline::approximations::ApproximationReport;
use meissner_pipeline::filtered::FilteredEngine;
use meissner_pipeline::latency::{Latency, Quantiles, microseconds};
use meissner_pipeline::lost::Warning;
use meissner_pipeline::model::Model;
use meissner_pipeline::provenance::Header;

/// The whole benchmark. Counts are of one pass, except those of distributions.
#[derive(Debug, Default, Serialize)]
pub(super) struct Report {
    /// What ran on what.
    pub(super) header: Header,
    #[serde(skip)]
    pub(super) recording: String,
    #[serde(skip)]
    pub(super) network: String,
    /// Instruction set of the kernels.
    pub(super) isa: &'static str,
    /// Latency passes that count.
    pub(super) passes: u32,
    pub(super) warmup_events: u64,
    /// What a measurement of nothing takes; it is contained in every push and prediction.
    pub(super) clock_us: f64,
    pub(super) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(super) lines_refused: u64,
    pub(super) accepted: u64,
    pub(super) dropped: BTreeMap<&'static str, u64>,
    /// What was lost without anybody having asked for it, where that is much.
    pub(super) warnings: Vec<Warning>,
    pub(super) predictions: u64,
    /// Most events in the window after any push.
    pub(super) nodes_max: usize,
    pub(super) latency_us: LatencyReport,
    /// Events over the time in pushes and predictions.
    pub(super) events_per_s: Option<f64>,
    pub(super) phases: PhasesReport,
    pub(super) skips: Skips,
    /// What was approximated, in one pass; none where everything was exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) approximations: Option<ApproximationReport>,
    pub(super) work: Work,
    /// Where the time of a separate pass went; empty where no time was spent.
    pub(super) stages: Vec<StageReport>,
    pub(super) memory: Memory,
    pub(super) deadline: DeadlineReport,
}

/// Durations in microseconds.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Distribution {
    pub(super) count: u64,
    pub(super) mean: f64,
    #[serde(flatten)]
    pub(super) quantiles: Quantiles,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct LatencyReport {
    pub(super) push: Option<Distribution>,
    pub(super) predict: Option<Distribution>,
    /// What each event brought about.
    pub(super) push_predict: Option<Distribution>,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct PhasesReport {
    /// Stream time before an event that decides on its phase.
    pub(super) window_us: i64,
    pub(super) mean_rate_events_per_s: Option<f64>,
    pub(super) burst_rate_events_per_s: Option<f64>,
    pub(super) idle: PhaseReport,
    pub(super) burst: PhaseReport,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct PhaseReport {
    pub(super) events: u64,
    /// Rows computed over all layers; none without events.
    pub(super) rows_per_event: Option<f64>,
    pub(super) latency_us: LatencyReport,
}

/// Rows and multiply-adds.
#[derive(Debug, Default, Serialize)]
pub(super) struct Work {
    pub(super) rows_per_event: f64,
    pub(super) multiply_adds_per_event: f64,
    /// Multiply-adds over the time of the stages of the layers, in the pass that measured stages.
    pub(super) multiply_adds_per_s: Option<f64>,
    pub(super) layers: Vec<LayerWork>,
}

#[derive(Debug, Serialize)]
pub(super) struct LayerWork {
    pub(super) name: String,
    pub(super) rows_per_event: f64,
    /// At full neighbourhoods.
    pub(super) multiply_adds_per_row: u64,
    pub(super) multiply_adds_per_event: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct StageReport {
    pub(super) name: &'static str,
    pub(super) us_per_event: f64,
    /// Of the time of all stages.
    pub(super) share: f64,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct Memory {
    /// State that the engine takes when it is made, about.
    pub(super) state_bytes: u64,
    /// Most that the process had resident after the latency passes, with the recording; none where the platform does
    /// not say.
    pub(super) peak_resident_bytes: Option<u64>,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct DeadlineReport {
    pub(super) period_us: i64,
    pub(super) periods: u64,
    /// Periods with neither events nor a window; they are not in `work_us` and `bins`.
    pub(super) periods_without_work: u64,
    pub(super) missed: u64,
    /// Work beyond the period, at most; 0 where none was missed.
    pub(super) excess_max_us: f64,
    /// Work beyond the period, in the mean of the missed ones.
    pub(super) excess_mean_us: Option<f64>,
    /// Longest time from a period's end to its prediction, where missed periods delay those after them.
    pub(super) lag_max_us: f64,
    /// Work over the length of all periods.
    pub(super) load: Option<f64>,
    pub(super) work_us: Option<Distribution>,
    /// Highest rate up to which `pooled_p999_us` is below the period, in this bin and in all below it; none where the
    /// lowest bin does not hold.
    pub(super) sustained: Option<Sustained>,
    /// Whether that is the highest rate of the recording.
    pub(super) sustained_is_all_seen: bool,
    /// Periods by the number of events that entered or left, whichever is larger.
    pub(super) bins: Vec<DeadlineBin>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Sustained {
    pub(super) events_per_period: u64,
    pub(super) events_per_s: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct DeadlineBin {
    pub(super) events_least: u64,
    pub(super) events_most: u64,
    /// Most events that entered or left in a period of this bin.
    pub(super) events_seen: u64,
    pub(super) periods: u64,
    pub(super) missed: u64,
    pub(super) work_us: Distribution,
    /// p99.9 of the work of this bin, with as many bins below it as it takes for 1,000 periods.
    pub(super) pooled_p999_us: f64,
}

impl Report {
    /// What the passes measured; the rest is left for the caller to fill in.
    pub(super) fn measured(
        model: &Model,
        front: &FilteredEngine,
        staged: &Engine,
        measured: &Measured,
        phases: &Phases,
        passes: u32,
        peak_resident_bytes: Option<u64>,
    ) -> Self {
        let (engine, counters) = (front.engine(), front.counters());
        let layers = model.network.layers();
        let [push, predict, push_predict] = whole(measured);
        let seconds = push_predict.total().as_secs_f64();
        let skips = Skips::new(&counters, &layers);
        let events = counters.events.pushed;
        let work = Work::new(&skips, &model.multiply_adds, events, staged);
        Self {
            events,
            accepted: counters.events.accepted,
            dropped: dropped(&counters),
            predictions: counters.predictions.read,
            nodes_max: measured.nodes_max,
            latency_us: LatencyReport::of(&push, &predict, &push_predict),
            events_per_s: (seconds > 0.0).then(|| push.count() as f64 / seconds),
            phases: PhasesReport {
                window_us: WINDOW_US,
                mean_rate_events_per_s: phases.mean_rate,
                burst_rate_events_per_s: phases.burst_rate,
                idle: PhaseReport::new(phases.count(Phase::Idle), &measured.idle, passes),
                burst: PhaseReport::new(phases.count(Phase::Burst), &measured.burst, passes),
            },
            skips,
            work,
            stages: stages(staged, events),
            memory: Memory {
                state_bytes: u64::try_from(engine.state_bytes()).unwrap_or(u64::MAX),
                peak_resident_bytes,
            },
            ..Self::default()
        }
    }
}

/// Push, predict and push + predict over all phases.
pub(super) fn whole(measured: &Measured) -> [Latency; 3] {
    let of: [fn(&Latencies) -> &Latency; 3] = [|l| &l.push, |l| &l.predict, |l| &l.push_predict];
    of.map(|of| sum(measured.phases().map(of)))
}

impl Distribution {
    /// None where nothing was recorded.
    pub(super) fn of(latency: &Latency) -> Option<Self> {
        let (count, quantiles) = (latency.count(), latency.quantiles()?);
        Some(Self { count, mean: microseconds(latency.total()) / count as f64, quantiles })
    }
}

impl LatencyReport {
    fn of(push: &Latency, predict: &Latency, push_predict: &Latency) -> Self {
        let [push, predict, push_predict] = [push, predict, push_predict].map(Distribution::of);
        Self { push, predict, push_predict }
    }
}

impl PhaseReport {
    fn new(events: u64, latencies: &Latencies, passes: u32) -> Self {
        let measured = events as f64 * f64::from(passes);
        Self {
            events,
            rows_per_event: (events > 0).then(|| latencies.rows as f64 / measured),
            latency_us: LatencyReport::of(&latencies.push, &latencies.predict, &latencies.push_predict),
        }
    }
}

impl Work {
    fn new(skips: &Skips, multiply_adds: &[u64], events: u64, staged: &Engine) -> Self {
        let per_event = |count: f64| if events > 0 { count / events as f64 } else { 0.0 };
        let layers: Vec<LayerWork> = skips
            .layers
            .iter()
            .zip(multiply_adds)
            .map(|(layer, &of_row)| LayerWork {
                name: layer.name.clone(),
                rows_per_event: per_event(layer.recomputed as f64),
                multiply_adds_per_row: of_row,
                multiply_adds_per_event: per_event(layer.recomputed as f64 * of_row as f64),
            })
            .collect();
        let multiply_adds_per_event = layers.iter().map(|layer| layer.multiply_adds_per_event).sum();
        let is_of_layers = |stage| matches!(stage, Stage::EventLayers | Stage::PooledLayers);
        let times = staged.stage_times();
        let seconds: f64 =
            times.iter().filter(|(stage, _)| is_of_layers(*stage)).map(|(_, time)| time.as_secs_f64()).sum();
        Self {
            rows_per_event: layers.iter().map(|layer| layer.rows_per_event).sum(),
            multiply_adds_per_event,
            multiply_adds_per_s: (seconds > 0.0).then(|| multiply_adds_per_event * events as f64 / seconds),
            layers,
        }
    }
}

/// The time of each stage.
fn stages(engine: &Engine, events: u64) -> Vec<StageReport> {
    let times = engine.stage_times().map(|(stage, time)| (stage, microseconds(time)));
    let total: f64 = times.iter().map(|(_, us)| us).sum();
    if total == 0.0 {
        return Vec::new();
    }
    let report = |(stage, us): (Stage, f64)| StageReport {
        name: stage.name(),
        us_per_event: us / events as f64,
        share: us / total,
    };
    times.into_iter().map(report).collect()
}
