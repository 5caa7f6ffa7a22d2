//! Deadlines: whether the work of each period is done within a period.
//!
//! Stream time is divided into periods from the first accepted event on; an event at the end
//! belongs to the period. The work of a period, measured as a whole, is to push its events, to
//! advance the clock to its end, and to predict.
//!
//! The cost of a period depends on the events that leave the window as much as on the events that
//! enter: in the silence after a burst no event enters and all events leave. The rate of a period
//! is therefore the larger of the two numbers. In a steady stream they are equal.
//!
//! Lag: from the end of a period to its prediction. Work begins at that end, or when earlier work
//! is done: a missed deadline delays later periods.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::latency::{Latency, microseconds};

/// Least number of periods whose p99.9 is not the slowest one. A smaller bin is judged together
/// with the bins below it, so that one interruption by the system does not determine a rate.
const POOLED_PERIODS: u64 = 1000;

/// Whether the work of each period was done within a period.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DeadlineReport {
    pub period_us: i64,
    /// Periods from the first to the last event.
    pub periods: u64,
    /// Periods with neither events nor a window; they are not in `work_us` and `bins`.
    pub periods_without_work: u64,
    /// Periods whose work took longer than the period.
    pub missed: u64,
    /// Largest excess of work over the period; 0 if no deadline was missed.
    pub excess_max_us: f64,
    /// Mean excess of work over the period, over the missed periods.
    pub excess_mean_us: Option<f64>,
    /// Longest time from the end of a period to its prediction. Missed periods delay later ones.
    pub lag_max_us: f64,
    /// Total work divided by the length of all periods.
    pub load: Option<f64>,
    /// Its inverse: if it is at least 1, the network keeps up with the recording on average.
    pub real_time: Option<f64>,
    /// Work of a period.
    pub work_us: Latency,
    /// Highest rate up to which `pooled_p999_us` is below the period, in all lower bins too.
    pub sustained: Option<Sustained>,
    /// Whether the sustained rate is the highest rate of the recording.
    pub sustained_is_all_seen: bool,
    /// Periods grouped by the number of events that entered or left, whichever is larger.
    pub bins: Vec<DeadlineBin>,
}

/// The highest sustained rate.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Sustained {
    /// Largest number of events in a period.
    pub events_per_period: u64,
    /// The same in events per second.
    pub events_per_s: f64,
}

/// A bin: periods with similar numbers of events.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DeadlineBin {
    /// Lower limit of the number of events of a period in this bin.
    pub events_least: u64,
    /// Upper limit of the number of events of a period in this bin.
    pub events_most: u64,
    /// Largest number of events that entered or left in a period of this bin.
    pub events_seen: u64,
    pub periods: u64,
    /// Of these, periods whose work took longer than the period.
    pub missed: u64,
    pub work_us: Latency,
    /// p99.9 of the work, together with as many lower bins as are needed for 1,000 periods.
    pub pooled_p999_us: f64,
}

pub(super) struct Deadline {
    report: DeadlineReport,
    /// Ends of the first and of the latest period, on the clock of the events.
    ends_us: Option<(i64, i64)>,
    /// Total excess of work over the period.
    excess: Duration,
    bins: BTreeMap<u64, DeadlineBin>,
    /// Time at which the work so far is done, in nanoseconds since the end of the first period.
    done_ns: i128,
    lag_max_ns: i128,
}

impl Deadline {
    pub(super) fn new(period_us: i64) -> Self {
        let report = DeadlineReport { period_us, ..DeadlineReport::default() };
        let (excess, bins) = (Duration::ZERO, BTreeMap::new());
        Self { report, ends_us: None, excess, bins, done_ns: 0, lag_max_ns: 0 }
    }

    /// Records the period that ends at `end_us`, in which `events` events entered or left.
    pub(super) fn record(&mut self, events: u64, end_us: i64, work: Duration) {
        let report = &mut self.report;
        let (events_least, events_most) = bin(events);
        let new = || DeadlineBin { events_least, events_most, ..DeadlineBin::default() };
        let bin = self.bins.entry(events_least).or_insert_with(new);
        bin.events_seen = bin.events_seen.max(events);
        bin.periods += 1;
        bin.work_us.record(work);
        report.work_us.record(work);
        let period = Duration::from_micros(report.period_us.unsigned_abs());
        if let Some(excess) = work.checked_sub(period).filter(|excess| !excess.is_zero()) {
            bin.missed += 1;
            report.missed += 1;
            report.excess_max_us = report.excess_max_us.max(microseconds(excess));
            self.excess += excess;
        }
        let (first_us, _) = self.ends_us.unwrap_or((end_us, end_us));
        self.ends_us = Some((first_us, end_us));
        // In i128: the difference of two times can exceed an i64.
        let end_ns = (i128::from(end_us) - i128::from(first_us)) * 1000;
        self.done_ns = self.done_ns.max(end_ns) + i128::try_from(work.as_nanos()).unwrap_or(i128::MAX >> 1);
        self.lag_max_ns = self.lag_max_ns.max(self.done_ns - end_ns);
    }

    pub(super) fn report(self) -> DeadlineReport {
        let (mut report, mut bins) = (self.report, self.bins.into_values().collect::<Vec<_>>());
        for last in 0..bins.len() {
            let mut pooled = Latency::new();
            for bin in bins[..=last].iter().rev() {
                if pooled.count() >= POOLED_PERIODS {
                    break;
                }
                pooled.add(&bin.work_us);
            }
            bins[last].pooled_p999_us = pooled.quantiles().expect("a bin is made for a period").p999;
        }
        let period_us = report.period_us as f64;
        let holds = |bin: &&DeadlineBin| bin.pooled_p999_us < period_us;
        report.sustained = bins.iter().take_while(holds).last().map(|bin| Sustained {
            events_per_period: bin.events_seen,
            events_per_s: bin.events_seen as f64 / (period_us / 1e6),
        });
        report.sustained_is_all_seen = bins.iter().all(|bin| holds(&bin));
        report.bins = bins;
        report.periods = self.ends_us.map_or(0, |(first, last)| {
            let periods = (i128::from(last) - i128::from(first)) / i128::from(report.period_us) + 1;
            u64::try_from(periods).unwrap_or(u64::MAX)
        });
        report.periods_without_work = report.periods - report.work_us.count().min(report.periods);
        report.excess_mean_us = (report.missed > 0).then(|| microseconds(self.excess) / report.missed as f64);
        report.lag_max_us = self.lag_max_ns as f64 / 1e3;
        let all_us = report.periods as f64 * period_us;
        report.load = (report.periods > 0).then(|| microseconds(report.work_us.total()) / all_us);
        report.real_time = report.load.filter(|&load| load > 0.0).map(|load| 1.0 / load);
        report
    }
}

/// Lower and upper limit of the bin for `events`. There are two bins for each doubling.
pub(super) fn bin(events: u64) -> (u64, u64) {
    let shift = events.max(2).ilog2() - 1;
    let half = events >> shift;
    (half << shift, (half << shift) + ((1 << shift) - 1))
}
