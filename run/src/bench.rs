//! Benchmarks: latency of events and frames, its phases, and the time of each stage.
//!
//! | benchmark | measures |
//! |---|---|
//! | [`EventBench`] | a network over events: latencies by phase, work, stages, deadlines |
//! | [`bench_frames`] | a frame network: latencies with skipping and without, deadlines |
//! | [`compare`] | a network over events against a frame network, over the same stream |
//! | [`sweep`](sweep()) | a network over events, as one quantity of stream or network grows |
//!
//! All events are read before the first pass. Every pass begins with a new engine.

mod compare;
mod deadline;
mod events;
mod frame_passes;
mod frames;
mod phases;
mod sweep;

use std::collections::BTreeMap;
use std::fmt;

use meissner_engine::{Event, EventCounters, LatePolicy, Options, RestartPolicy, Sensor};
use meissner_io::TimeRange;
use serde::Serialize;

use crate::approximations::Approximations;
use crate::error::Result;
use crate::losses::{InputLosses, LossWarning};
use crate::provenance::{Header, InputCard, ModelCard};
use crate::schedule::Every;
use crate::source::Source;
use crate::work_counts::dropped;
pub use compare::{CompareReport, Ratios, SideReport, SidesReport, compare};
pub use deadline::{DeadlineBin, DeadlineReport, Sustained};
pub use events::{
    EventBench, EventReport, LayerWork, MemoryReport, PhaseReport, PhasesReport, Progress, SlicesReport,
    StageReport, Work,
};
use frame_passes::PredictionTimes;
pub use frame_passes::{EventFrameModel, Field, FrameLatencies};
pub use frames::{FrameModeReport, FrameReport, PixelReport, bench_frames};
pub use sweep::{Curve, Point, Quantity, Slopes, SweepOptions, SweepReport, sweep};

/// Options of a benchmark.
#[derive(Clone, Debug, Default)]
pub struct BenchOptions {
    /// The part of the recording that the source gives, for the report; [`Part::range`] reads it.
    pub part: Part,
    /// Largest number of events to take from this part.
    pub limit: Option<u64>,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// Rule for restarts of the sensor's clock.
    pub restart: RestartPolicy,
    /// When predictions are read, or the time from frame to frame. The default is every event; for
    /// frames, the length of their windows, or 10 ms for a sliding window.
    pub every: Option<Every>,
    /// Approximations of a network over events.
    pub approximations: Approximations,
    /// Whether two threads share the work of a network over events, see [`Options::two_threads`].
    pub two_threads: bool,
    /// Number of counted passes; 0 means 1.
    pub repeat: u32,
    /// Largest number of events in the warm-up.
    pub warmup: u64,
    /// Minimum rate of a burst in events per second. The default is 5 times the mean rate.
    pub burst_rate: Option<u64>,
    /// Period of the deadline report. The default is 1 ms.
    pub period_us: Option<i64>,
    /// Number of events of a slice; 0 means 64.
    pub slice: usize,
    /// Whether engines record which rows they compute, for observers.
    pub record_rows: bool,
}

/// A part of a recording, in microseconds since its first event. It contains the events with
/// `first + from <= t < first + from + for`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// The start.
    pub from_us: Option<i64>,
    /// The length.
    pub for_us: Option<i64>,
}

impl Part {
    /// Whether this is not the whole recording.
    pub fn is_some(self) -> bool {
        self.from_us.is_some() || self.for_us.is_some()
    }

    /// The range of times to read; `None`: the whole recording.
    pub fn range(self) -> Option<TimeRange> {
        let end = |length: i64| self.from_us.unwrap_or(0).saturating_add(length);
        // Without a start, events before the first one's time belong to the part.
        let times = self.from_us.unwrap_or(i64::MIN)..self.for_us.map_or(i64::MAX, end);
        self.is_some().then(|| TimeRange::since_first(times))
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = |us: i64| us as f64 / 1e6;
        write!(f, "from {} s on", seconds(self.from_us.unwrap_or(0)))?;
        self.for_us.map_or(Ok(()), |length| write!(f, ", for {} s", seconds(length)))
    }
}

/// The events of a benchmark.
pub struct BenchInput {
    events: Vec<Event>,
    sensor: Sensor,
    source: Source,
    part: Part,
    header: Header,
    card: ModelCard,
}

impl BenchInput {
    /// The name of the source, and the sensor.
    pub fn about(&self) -> (&str, Sensor) {
        (&self.source.name, self.sensor)
    }

    /// Takes the events of `source` up to the limit, and logs the warnings of the header.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn take(
        mut source: Source,
        sensor: Sensor,
        card: &ModelCard,
        options: &BenchOptions,
    ) -> Result<Self> {
        let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
        let header = Header::new("bench", described, card.clone());
        header.warn();
        let limit = options.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX);
        let events = source.by_ref().take(limit).collect::<Result<_, _>>()?;
        Ok(Self { events, sensor, source, part: options.part, header, card: card.clone() })
    }

    /// The losses. `counters` count the events that reached the network.
    fn losses(&self, counters: EventCounters) -> InputLosses {
        self.source.losses(counters, self.sensor)
    }

    /// The report of this input over `passes` passes. `counters` count its events.
    fn report(&self, counters: &EventCounters, losses: &InputLosses, passes: u32) -> InputReport {
        InputReport {
            header: self.header.clone(),
            part: self.part,
            card: self.card.clone(),
            isa: Options::default().isa.name(),
            passes,
            events: counters.pushed,
            lines_refused: self.source.lines_refused(),
            accepted: counters.accepted,
            dropped: dropped(counters),
            warnings: losses.warn(&self.source.name),
        }
    }
}

/// The input of a benchmark.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct InputReport {
    pub header: Header,
    /// The measured part.
    #[serde(skip)]
    pub part: Part,
    #[serde(skip)]
    pub card: ModelCard,
    /// Instruction set of the kernels.
    pub isa: &'static str,
    pub passes: u32,
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    pub accepted: u64,
    /// The other events, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    pub warnings: Vec<LossWarning>,
}

impl FrameInputReport {
    /// The report of the frames of `field` at `moments`; `outside` counts events outside the field.
    fn new(
        input: &BenchInput,
        model: &EventFrameModel,
        field: Field,
        moments: &PredictionTimes,
        outside: u64,
    ) -> Self {
        Self {
            part: input.part.is_some().then(|| input.part.to_string()),
            frames_of: model.model.source.to_string(),
            field: field.to_string(),
            period_us: moments.period_us,
            outside_frames: outside,
            stream_s: moments.stream_s(),
            multiply_adds_per_frame: model.model.network.multiply_adds(),
        }
    }
}

/// The frames made of events.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct FrameInputReport {
    /// The part of the recording, if not all of it is measured.
    pub part: Option<String>,
    /// The preparation of the frames, with the keys of a description.
    pub frames_of: String,
    /// The part of the sensor that they cover.
    pub field: String,
    /// Time from frame to frame.
    pub period_us: i64,
    /// Accepted events that no frame covers.
    pub outside_frames: u64,
    /// Stream time from the first event to the last frame, in seconds.
    pub stream_s: f64,
    /// Multiply-adds of a frame without skipping.
    pub multiply_adds_per_frame: u64,
}

#[cfg(test)]
mod tests;
