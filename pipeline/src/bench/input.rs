//! The events of a benchmark: the measured part of a recording, and the fields of a report about the input.

use std::collections::BTreeMap;
use std::fmt;

use meissner_engine::{Event, EventCounters, LatePolicy, Options, Sensor};
use serde::Serialize;

use super::frame_passes::{EventFrameModel, Field};
use super::moments::Moments;
use crate::approximations::Approximations;
use crate::error::PipelineError;
use crate::losses::{InputLosses, LossWarning};
use crate::provenance::{Header, InputCard, ModelCard};
use crate::schedule::Every;
use crate::skips::dropped;
use crate::source::Source;

/// Options of a benchmark.
#[derive(Clone, Debug, Default)]
pub struct BenchOptions {
    /// The measured part of the recording.
    pub part: Part,
    /// Largest number of events to take from this part.
    pub limit: Option<u64>,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// When predictions are read, or the time from frame to frame. The default is every event; for frames, the length
    /// of their windows, or 10 ms for a sliding window.
    pub every: Option<Every>,
    /// Approximations of a network over events.
    pub approximations: Approximations,
    /// Number of counted passes; 0 means 1.
    pub repeat: u32,
    /// Largest number of events in the warm-up.
    pub warmup: u64,
    /// Minimum rate of a burst in events per second. The default is 5 times the mean rate.
    pub burst_rate: Option<u64>,
    /// Period of the deadline report. The default is 1 ms.
    pub period_us: Option<i64>,
}

/// A part of a recording, in microseconds since its first event. It has the events with
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

    /// The events of this part, at most `limit`.
    fn take(
        self,
        events: impl Iterator<Item = Result<Event, PipelineError>>,
        limit: usize,
    ) -> Result<Vec<Event>, PipelineError> {
        let mut first_us = None;
        let inside = |event: &Result<Event, PipelineError>| {
            let Ok(event) = event else { return true };
            self.holds(*first_us.get_or_insert(event.t_us), event.t_us)
        };
        events.filter(inside).take(limit).collect()
    }

    fn holds(self, first_us: i64, t_us: i64) -> bool {
        // In i128, because times may be anywhere in the range of an i64.
        let begin = i128::from(first_us) + i128::from(self.from_us.unwrap_or(0));
        let t_us = i128::from(t_us);
        (self.from_us.is_none() || t_us >= begin)
            && self.for_us.is_none_or(|length| t_us < begin + i128::from(length))
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
    pub(super) events: Vec<Event>,
    pub(super) sensor: Sensor,
    source: Source,
    part: Part,
    header: Header,
    card: ModelCard,
}

impl BenchInput {
    /// Takes the part of `source` that `options` select, for a benchmark of the network of `card`. Logs the warnings of
    /// the network's header.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn take(
        mut source: Source,
        sensor: Sensor,
        card: &ModelCard,
        options: &BenchOptions,
    ) -> Result<Self, PipelineError> {
        let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
        let header = Header::new("bench", described, card.clone());
        header.warn();
        let limit = options.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX);
        let events = options.part.take(source.by_ref(), limit)?;
        Ok(Self { events, sensor, source, part: options.part, header, card: card.clone() })
    }

    /// The losses. `counters` count the events that reached the network.
    pub(super) fn losses(&self, counters: EventCounters) -> InputLosses {
        self.source.losses(counters, self.sensor)
    }

    /// The report of this input over `passes` passes. `counters` count its events.
    pub(super) fn report(&self, counters: &EventCounters, losses: &InputLosses, passes: u32) -> InputReport {
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
pub struct InputReport {
    /// Network, weights and input.
    pub header: Header,
    /// The measured part.
    #[serde(skip)]
    pub part: Part,
    /// The network.
    #[serde(skip)]
    pub card: ModelCard,
    /// Instruction set of the kernels.
    pub isa: &'static str,
    /// Number of counted passes.
    pub passes: u32,
    /// Events taken.
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    /// Accepted events.
    pub accepted: u64,
    /// The other events, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Unintended losses of input.
    pub warnings: Vec<LossWarning>,
}

impl FrameInputReport {
    /// The report of the frames that `model` makes of `field` at `moments`. `outside` counts the events outside
    /// `field`.
    pub(super) fn new(
        input: &BenchInput,
        model: &EventFrameModel,
        field: Field,
        moments: &Moments,
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
mod tests {
    use super::Part;
    use meissner_engine::Event;

    fn times(part: Part, times: &[i64]) -> Vec<i64> {
        let events = times.iter().map(|&t| Ok(Event::new(t, 0, 0, true)));
        part.take(events, usize::MAX).expect("no event is an error").iter().map(|event| event.t_us).collect()
    }

    #[test]
    fn a_part_begins_at_its_start_and_ends_before_its_end() {
        let all = [100, 1099, 1100, 1101, 1599, 1600];
        assert_eq!(times(Part::default(), &all), all);
        assert_eq!(times(Part { from_us: Some(1000), for_us: None }, &all), all[2..]);
        assert_eq!(times(Part { from_us: None, for_us: Some(1000) }, &all), all[..2]);
        assert_eq!(times(Part { from_us: Some(1000), for_us: Some(500) }, &all), all[2..5]);
        assert_eq!(times(Part { from_us: Some(1), for_us: Some(1) }, &[i64::MAX, i64::MIN]), [0; 0]);
    }

    #[test]
    fn a_whole_recording_holds_events_before_its_first_one() {
        assert_eq!(times(Part::default(), &[5, 3]), [5, 3]);
    }
}
