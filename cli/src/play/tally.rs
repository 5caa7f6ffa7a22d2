//! What becomes of reports.

use std::time::Duration;

use meissner_live::Timely;
use serde::Serialize;

use meissner_pipeline::latency::{Latency, microseconds};

/// How a report came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum State {
    /// It covers all that had entered the queue.
    Fresh,
    /// It covers what the engine had taken shortly before the deadline.
    Behind,
    /// It is the prediction of an earlier report.
    Old,
}

impl State {
    pub(super) fn of(timely: &Timely<'_>) -> Self {
        match timely {
            Timely { fresh: true, .. } => Self::Fresh,
            Timely { own: true, .. } => Self::Behind,
            _ => Self::Old,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Fresh => "fresh",
            Self::Behind => "behind",
            Self::Old => "old",
        }
    }
}

/// Counts of reports.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Reports {
    pub(super) due: u64,
    pub(super) made: u64,
    pub(super) fresh: u64,
    pub(super) behind: u64,
    pub(super) old: u64,
    /// Returned after the deadline, by as much as this at most.
    pub(super) past_deadline: u64,
    pub(super) past_deadline_max_us: f64,
    /// Longest time from when one was due until it was asked for.
    pub(super) asked_late_max_us: f64,
}

/// Counts and times of reports.
pub(super) struct Tally {
    pub(super) reports: Reports,
    pub(super) waited: Latency,
    pub(super) age: Latency,
    pub(super) behind: Latency,
    deadline: Duration,
}

impl Tally {
    /// Of `due` reports with this deadline, none has been made.
    pub(super) fn new(due: u64, deadline: Duration) -> Self {
        let reports = Reports { due, ..Reports::default() };
        Self { reports, waited: Latency::new(), age: Latency::new(), behind: Latency::new(), deadline }
    }

    /// A report has been made, asked for `late` after it was due.
    pub(super) fn count(&mut self, timely: &Timely<'_>, late: Duration) {
        let reports = &mut self.reports;
        reports.made += 1;
        match State::of(timely) {
            State::Fresh => reports.fresh += 1,
            State::Behind => reports.behind += 1,
            State::Old => reports.old += 1,
        }
        let past = timely.waited.saturating_sub(self.deadline);
        reports.past_deadline += u64::from(!past.is_zero());
        reports.past_deadline_max_us = reports.past_deadline_max_us.max(microseconds(past));
        reports.asked_late_max_us = reports.asked_late_max_us.max(microseconds(late));
        self.waited.record(timely.waited);
        self.age.record(timely.age);
        self.behind.record(Duration::from_micros(timely.behind_us));
    }
}
