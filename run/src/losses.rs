//! Unintended loss of input, and truncated recordings.
//!
//! Input: counts. Output: a warning for each reason that lost more than one percent of the input,
//! with the likely cause. Drops by a filter of the command or a queue are intended; drops by the
//! filters of the network are reported. For a live stream, losses are reported after the first
//! thousand events and then every second.

use std::fmt;
use std::time::{Duration, Instant};

use meissner_engine::{EventCounters, Sensor};
use meissner_io::Recording;
use serde::Serialize;

use crate::text::grouped;

/// Largest share of the input that may be lost without a warning.
const PERCENT: u64 = 1;
/// Number of refused lines that are reported individually, each with its reason.
pub const LINES_TOLD: u64 = 5;

/// The reason for a loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LossReason {
    /// Events outside the sensor.
    OutsideSensor,
    /// Events that are earlier than an event before them.
    Late,
    /// Events that are too far in time from the first event.
    TimeOutOfRange,
    /// Events that are far ahead of the events before and after them.
    Outlier,
    /// Events that the filters of the network drop.
    Filtered,
    /// Everything before a restart of the sensor's clock: the network was reset.
    Restart,
    /// Accepted events outside the part of the sensor that frames cover.
    OutsideCrop,
    /// Lines of a text that could not be read.
    LinesRefused,
}

impl LossReason {
    fn word(self) -> &'static str {
        match self {
            Self::OutsideSensor => "outside the sensor",
            Self::Late => "late",
            Self::TimeOutOfRange => "too far from the first event",
            Self::Outlier => "far ahead of the others",
            Self::Filtered => "dropped by the network's filters",
            Self::Restart => "before a restart of the clock",
            Self::OutsideCrop => "outside the frames",
            Self::LinesRefused => "lines that cannot be read",
        }
    }
}

/// Advice to the user of a program about a loss, such as an option of that program.
pub type Advice = fn(LossReason) -> Option<&'static str>;

/// A loss of input with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct LossWarning {
    pub reason: LossReason,
    /// Number of lost events or lines.
    pub count: u64,
    /// Total number of events or lines.
    pub of: u64,
    /// The loss as a sentence, with the likely cause.
    pub message: String,
}

/// Logs the losses of a stream, once for each reason.
#[derive(Debug)]
pub struct LossWatch {
    /// Time and result of the last check of losses; `None` for a recording.
    last: Option<(Instant, Option<InputLosses>)>,
    told: Vec<LossReason>,
}

/// Events of a live stream before its first check, if they come within a second.
const FIRST: u64 = 1000;
/// Time between two checks of a live stream.
const PERIOD: Duration = Duration::from_secs(1);

impl LossWatch {
    /// A watch over a stream, which is checked during the stream if it is `live`.
    pub fn new(live: bool) -> Self {
        Self { last: live.then(|| (Instant::now(), None)), told: Vec::new() }
    }

    /// Checks the losses of the input called `name` if a check is due `now`, after `taken` events.
    pub fn look(
        &mut self,
        taken: u64,
        now: impl FnOnce() -> Instant,
        name: &str,
        losses: impl FnOnce() -> InputLosses,
    ) {
        let Some((last, before)) = &mut self.last else { return };
        let now = now();
        let is_first = taken >= FIRST && before.is_none();
        if !is_first && now.saturating_duration_since(*last) < PERIOD {
            return;
        }
        let losses = losses();
        let since = before.map_or(losses, |before| losses.since(&before));
        (*last, *before) = (now, Some(losses));
        self.tell(name, &since.warnings());
    }

    /// Logs `warnings`: the likely cause of each loss once, and then its extent.
    fn tell(&mut self, name: &str, warnings: &[LossWarning]) {
        for LossWarning { reason, count, of, message } in warnings {
            if !self.told.contains(reason) {
                tracing::warn!("{name}: {message}");
                self.told.push(*reason);
            } else if let LossReason::Restart = reason {
                tracing::warn!("{name}: the clock has restarted again");
            } else {
                let (count, of) = (grouped(*count), grouped(*of));
                tracing::warn!("{name}: {count} more of {of} are lost: {}", reason.word());
            }
        }
    }

    /// Ends the watch over the stream `name`: logs new warnings, and returns all.
    pub fn end(&mut self, name: &str, losses: &InputLosses) -> Vec<LossWarning> {
        let warnings = losses.warnings();
        // A few refused lines have each been logged already.
        let is_known = |warning: &&LossWarning| {
            warning.reason == LossReason::LinesRefused && warning.count <= LINES_TOLD
                || self.told.contains(&warning.reason)
        };
        let new: Vec<_> = warnings.iter().filter(|warning| !is_known(warning)).cloned().collect();
        self.tell(name, &new);
        warnings
    }
}

/// The losses of an input.
#[derive(Clone, Copy, Debug)]
pub struct InputLosses {
    pub(crate) events: EventCounters,
    /// `None` if the input does not consist of events.
    pub(crate) sensor: Option<Sensor>,
    /// Accepted events that no frame covers.
    pub(crate) outside_crop: u64,
    pub(crate) lines_refused: u64,
    pub(crate) advice: Advice,
}

impl InputLosses {
    /// Losses of events from `sensor`; `events` counts those that reached the network.
    pub fn of_events(events: EventCounters, sensor: Sensor) -> Self {
        Self { events, sensor: Some(sensor), outside_crop: 0, lines_refused: 0, advice: |_| None }
    }

    /// Losses of a text; `taken` is the number of lines that were read.
    pub fn of_lines(taken: u64) -> Self {
        let events = EventCounters { pushed: taken, ..EventCounters::default() };
        Self { events, sensor: None, outside_crop: 0, lines_refused: 0, advice: |_| None }
    }

    /// Adds `advice` at the end of each message.
    #[must_use]
    pub fn with_advice(self, advice: Advice) -> Self {
        Self { advice, ..self }
    }

    /// The losses since `earlier`, of the same input.
    pub(crate) fn since(&self, earlier: &Self) -> Self {
        Self {
            events: self.events.since(earlier.events),
            outside_crop: self.outside_crop.saturating_sub(earlier.outside_crop),
            lines_refused: self.lines_refused.saturating_sub(earlier.lines_refused),
            ..*self
        }
    }

    /// Logs the warnings about the input called `name`, and returns them.
    pub fn warn(&self, name: &str) -> Vec<LossWarning> {
        LossWatch::new(false).end(name, self)
    }

    /// A warning for each reason that lost more than [`PERCENT`] percent of the input.
    pub(crate) fn warnings(&self) -> Vec<LossWarning> {
        let Self { events, outside_crop, lines_refused, .. } = *self;
        let sensor = self.sensor.map_or_else(String::new, |sensor| format!(" of {sensor} pixels"));
        let outside = format!(
            "events are outside the sensor{sensor} and are dropped: the size of the sensor may not be that of the recording"
        );
        let late = "events are earlier than one before them and are dropped: the columns of a text may be in another \
                    order than t,x,y,p (a header names them), the recording is not sorted by time, or the clock has been set \
                    back";
        let outlier = "events are far ahead of those before and after them and are dropped: their times are probably damaged";
        let filtered = "events are dropped by the filters that the network states: a pixel of the sensor may fire all the time";
        let range = "events are too far in time from the first one and are dropped: times may not be in microseconds, or \
                     the first one is wrong";
        let crop = "events are outside the part of the sensor that the network's frames show: the network may be made for \
                    another sensor";
        let lines = "lines are refused: the first are named above";
        let counts = [
            (LossReason::OutsideSensor, events.outside_sensor, events.pushed, outside.as_str()),
            (LossReason::Late, events.late, events.pushed, late),
            (LossReason::TimeOutOfRange, events.time_out_of_range, events.pushed, range),
            (LossReason::Outlier, events.outliers, events.pushed, outlier),
            (LossReason::Filtered, events.filtered, events.pushed, filtered),
            (LossReason::OutsideCrop, outside_crop, events.accepted, crop),
            (LossReason::LinesRefused, lines_refused, events.pushed + lines_refused, lines),
        ];
        let is_large = |count, of| u128::from(count) * 100 > u128::from(of) * u128::from(PERCENT);
        let counts = counts.into_iter().filter(|&(_, count, of, _)| is_large(count, of));
        let advice = |reason| (self.advice)(reason).map_or_else(String::new, |advice| format!(" ({advice})"));
        let restart = (events.restarts > 0).then(|| {
            let times = if events.restarts == 1 { String::new() } else { format!(" {} times", grouped(events.restarts)) };
            let advice = advice(LossReason::Restart);
            let message = format!(
                "the clock of the sensor has restarted{times}: the network began anew, without the events before{advice}"
            );
            LossWarning { reason: LossReason::Restart, count: events.restarts, of: events.pushed, message }
        });
        let lost = counts.map(|(reason, count, of, why)| {
            let percent = count as f64 / of as f64 * 100.0;
            let (lost, all, advice) = (grouped(count), grouped(of), advice(reason));
            let message = format!("{lost} of {all} ({percent:.1} %) {why}{advice}");
            LossWarning { reason, count, of, message }
        });
        restart.into_iter().chain(lost).collect()
    }
}

/// The part of a truncated recording that was kept, and the start of the rest.
#[derive(Clone, Debug, Serialize)]
pub struct Salvaged {
    events: usize,
    /// The part that is incomplete.
    what: &'static str,
    /// The start of the incomplete part: a byte of the file, or a line of a text.
    place: String,
    bytes_not_read: u64,
}

impl Salvaged {
    /// The part of `recording` that was kept; `None` for a complete recording.
    pub fn of(recording: &Recording) -> Option<Self> {
        let salvage = recording.salvaged?;
        let events = recording.events.len();
        let (what, place) = (salvage.what, salvage.place.to_string());
        Some(Self { events, what, place, bytes_not_read: salvage.bytes_not_read })
    }
}

impl fmt::Display for Salvaged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { events, what, place, bytes_not_read } = self;
        let (events, bytes) = (grouped(*events as u64), grouped(*bytes_not_read));
        write!(f, "{events} events kept; {what}, from {place} on, is not whole: {bytes} bytes not read")
    }
}
