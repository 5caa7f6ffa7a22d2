//! Counts and times of the reports of an input.

use std::time::Duration;

use meissner_live::TimedAnswer;

use super::ReportCounts;
use crate::latency::{Latencies, Latency, microseconds};
use crate::run::ReportState;
use crate::training::Training;

/// Counts and times of reports.
#[derive(Debug)]
pub(super) struct Tally {
    pub(super) reports: ReportCounts,
    /// Values outside the range of the training.
    pub(super) training: Training,
    waited: Latency,
    age: Latency,
    behind: Latency,
    event: Latency,
}

impl Tally {
    /// No report of `due` ones.
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
        self.training.update(timely.values);
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

    /// Records how long the events took that `timely` is the first to cover.
    pub(super) fn covered(&mut self, timely: &TimedAnswer<'_>) {
        if let Some(latency) = timely.latency {
            self.event.record(latency);
        }
    }

    /// The quantiles of all times.
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
