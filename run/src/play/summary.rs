//! Measurements of an input during its play, and after it.

use std::collections::BTreeMap;
use std::time::Duration;

use meissner_live::TimedAnswer;
use serde::Serialize;

use crate::answer::exact_digits;
use crate::approximations::ApproximationReport;
use crate::latency::{Latencies, Latency, microseconds};
use crate::losses::LossWarning;
use crate::run::ReportState;
use crate::training::Training;

/// The summary of a play.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PlaySummary {
    /// Events taken from the recording.
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    pub warnings: Vec<LossWarning>,
    /// Events offered to the queue.
    pub offered: u64,
    /// Events delivered to the engine.
    pub delivered: u64,
    /// Events accepted by the engine.
    pub accepted: u64,
    /// Events dropped by the queue and by the engine, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Restarts of the sensor's clock, each of which reset the engine.
    pub restarts: u64,
    pub queue: QueueReport,
    pub reports: ReportCounts,
    /// Reports with a value outside the range of the training, if the weights state it.
    pub outside_training: Option<u64>,
    /// Reports of windows unlike those of the training, if the weights contain statistics of these.
    pub unlike_training: Option<u64>,
    /// Times of reports: since the request, since the start of the prediction, stream time that is
    /// not covered; and of events, from the offer to the report that covers them.
    pub latency_us: Latencies,
    /// Longest time from the due time of an event until it was offered.
    pub reader_lag_max_us: f64,
    /// Time from the end of the recording until all waiting events were covered.
    pub drain_us: f64,
    #[serde(rename = "final")]
    pub last: LastPrediction,
    /// The comparison with a prediction from scratch, if one was made.
    pub verified: Option<Verified>,
    /// Bytes that the engine and its queue hold from their start on, weights excluded.
    pub bytes: u64,
    /// Peak resident memory of the process; `None` if the platform does not report it.
    pub peak_resident_bytes: Option<u64>,
    /// The approximations; `None` if results are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approximations: Option<ApproximationReport>,
}

/// Counts of reports.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ReportCounts {
    pub due: u64,
    pub made: u64,
    /// Reports that covered all events that had entered the queue; the engine lost none.
    pub fresh: u64,
    /// Reports that covered only the events that the engine had taken, or for which the engine lost
    /// some.
    pub behind: u64,
    /// Reports with the prediction of an earlier report.
    pub old: u64,
    /// Reports that returned after the deadline.
    pub past_deadline: u64,
    /// Longest time after the deadline.
    pub past_deadline_max_us: f64,
    /// Longest time from the due time of a report until it was requested.
    pub asked_late_max_us: f64,
}

/// The queue between the reader and the engine.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct QueueReport {
    /// Capacity in events.
    pub capacity: u64,
    pub overload: &'static str,
    /// Largest number of events that waited.
    pub high_water: u64,
    /// Time that the reader waited for room.
    pub blocked_us: f64,
}

/// The prediction after the last event.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct LastPrediction {
    /// Time of the newest event that it covers; `None` before the first.
    pub t_us: Option<i64>,
    #[serde(serialize_with = "exact_digits")]
    pub value: Vec<f32>,
    /// Events in the window.
    pub nodes: usize,
}

/// The last prediction compared with one from scratch.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Verified {
    /// Number of events in the prediction from scratch.
    pub events: usize,
    /// Whether all bits are equal.
    pub equal: bool,
    /// Time of the prediction from scratch.
    pub batch_us: f64,
}

#[derive(Debug)]
pub(super) struct Tally {
    pub(super) reports: ReportCounts,
    pub(super) training: Training,
    waited: Latency,
    age: Latency,
    behind: Latency,
    event: Latency,
}

impl Tally {
    /// A summary without reports yet; `due` is the number of due reports.
    pub(super) fn new(due: u64, training: Training) -> Self {
        let [waited, age, behind, event] = std::array::from_fn(|_| Latency::new());
        Self {
            reports: ReportCounts { due, ..ReportCounts::default() },
            training,
            waited,
            age,
            behind,
            event,
        }
    }

    /// Counts a report with this `deadline`. It was requested `late` after it was due.
    pub(super) fn count(&mut self, timely: &TimedAnswer<'_>, deadline: Duration, late: Duration) {
        let reports = &mut self.reports;
        reports.made += 1;
        self.training.update(timely.values, timely.unlike);
        match state(timely) {
            ReportState::Fresh => reports.fresh += 1,
            ReportState::Behind => reports.behind += 1,
            ReportState::Old => reports.old += 1,
        }
        let past = timely.waited.saturating_sub(deadline);
        reports.past_deadline += u64::from(!past.is_zero());
        reports.past_deadline_max_us = reports.past_deadline_max_us.max(microseconds(past));
        reports.asked_late_max_us = reports.asked_late_max_us.max(microseconds(late));
        self.waited.record(timely.waited);
        self.age.record(timely.age);
        self.behind.record(Duration::from_micros(timely.behind_us));
        self.covered(timely);
    }

    /// Records the latency of the events that `timely` is the first to cover.
    pub(super) fn covered(&mut self, timely: &TimedAnswer<'_>) {
        if let Some(latency) = timely.latency {
            self.event.record(latency);
        }
    }

    pub(super) fn latencies(&self) -> Latencies {
        let Self { waited, age, behind, event, .. } = self;
        Latencies::of([("waited", waited), ("age", age), ("behind", behind), ("event", event)])
    }
}

/// How current the prediction of `timely` is.
pub(super) fn state(timely: &TimedAnswer<'_>) -> ReportState {
    match timely {
        TimedAnswer { fresh: true, .. } => ReportState::Fresh,
        TimedAnswer { own: true, .. } => ReportState::Behind,
        _ => ReportState::Old,
    }
}
