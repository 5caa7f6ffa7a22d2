//! Errors of quantities at the end of presses and over time.

use std::time::Duration;

use meissner_run::latency::Latency;
use serde::Serialize;

use super::press::{Effort, Outcome, Quantity};
use crate::doubts::{BAD, Doubts};
use crate::judge::Figures;
use crate::metrics::MeanStd;

/// Figures of a network on presses; `T` is a number for one training and [`MeanStd`] for several.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Errors<T = f64> {
    pub presses: u64,
    pub outputs: Vec<OutputErrors<T>>,
    /// All angles together, where there are several.
    pub angles: Option<OutputErrors<T>>,
    /// Median share of the press from which on all angles stay within 1 degree, if half do.
    pub settled_share: Option<f64>,
    /// Counts of windows unlike those of the training, if the weights have statistics of these.
    pub doubts: Option<PressDoubts>,
    /// Events and work of all trainings together.
    pub work: Work,
    /// Share of each press from which on its angles stay within 1 degree.
    #[serde(skip)]
    settled: Vec<Option<f64>>,
}

/// Errors of an output, or of several with the same unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct OutputErrors<T = f64> {
    pub name: String,
    pub unit: String,
    /// Mean absolute error at the end of a press.
    pub mean_absolute: T,
    /// Standard deviation of that absolute error over the presses; 0 for a single press.
    pub std: T,
    /// Mean absolute error of a reader's newest prediction at each millisecond, if any.
    pub newest: Option<T>,
    /// Mean absolute error at each time since contact; after the end, the last one counts.
    pub mean_absolute_at: Vec<T>,
}

/// Predictions since contact, and the ends of presses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PressDoubts {
    /// A bad prediction has an output whose error is more than three times its mean at the end.
    #[serde(flatten)]
    pub all: Doubts,
    /// Presses, and those that end with an unlike window.
    pub ends: u64,
    pub ends_unlike: u64,
}

impl PressDoubts {
    /// The counts for `outcomes`, whose outputs have these mean errors at the end.
    fn of(outcomes: &[Outcome], mean: &[f64]) -> Option<Self> {
        let is_bad = |errors: &Vec<f64>| errors.iter().zip(mean).any(|(error, mean)| *error > BAD * mean);
        let each = outcomes.iter().flat_map(|outcome| outcome.unlike_at.iter().zip(&outcome.errors_at));
        let all = Doubts::of(each.map(|(unlike, errors)| (*unlike, is_bad(errors))))?;
        let mut doubts = Self { all, ends: 0, ends_unlike: 0 };
        for outcome in outcomes {
            doubts.ends += 1;
            doubts.ends_unlike += u64::from(outcome.unlike_at.last().copied().flatten()? > 1.0);
        }
        Some(doubts)
    }

    fn add(&mut self, other: &Self) {
        self.all.add(&other.all);
        self.ends += other.ends;
        self.ends_unlike += other.ends_unlike;
    }
}

/// Events and work of presses.
#[derive(Debug, Default, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Work {
    /// Presses, once for each training.
    pub presses: u64,
    pub events: u64,
    pub predictions: u64,
    /// Rows of the event graph; 0 for networks over frames.
    pub rows: u64,
    /// Multiply-adds of rows, dense layers and frames.
    pub multiply_adds: u64,
    /// Time for a prediction with the events since the one before it, as measured.
    pub update_us: Latency,
}

impl Errors {
    /// Figures of `outcomes` over so many `times` since contact; `None` for no presses.
    pub(super) fn new(quantities: &[Quantity], outcomes: &[Outcome], times: usize) -> Option<Self> {
        let each = |i: usize| OutputErrors::of(&quantities[i], &[i], outcomes, times);
        let outputs = (0..quantities.len()).map(each).collect::<Option<Vec<_>>>()?;
        let angles: Vec<usize> = (0..quantities.len()).filter(|&i| quantities[i].is_angle()).collect();
        let together = angles.first().filter(|_| angles.len() > 1).and_then(|&first| {
            let quantity = Quantity { name: "all angles".to_owned(), ..quantities[first].clone() };
            OutputErrors::of(&quantity, &angles, outcomes, times)
        });
        let settled: Vec<Option<f64>> = outcomes.iter().map(|outcome| outcome.settled).collect();
        let mut work = Work::default();
        outcomes.iter().for_each(|outcome| work.add_press(&outcome.effort));
        let mean: Vec<f64> = outputs.iter().map(|output| output.mean_absolute).collect();
        Some(Self {
            presses: outcomes.len() as u64,
            doubts: PressDoubts::of(outcomes, &mean),
            outputs,
            angles: together,
            settled_share: lower_median(settled.clone()),
            work,
            settled,
        })
    }
}

impl OutputErrors {
    /// The errors of the outputs `chosen` together.
    fn of(quantity: &Quantity, chosen: &[usize], outcomes: &[Outcome], times: usize) -> Option<Self> {
        let at = |time: usize| {
            let errors = outcomes.iter().flat_map(|outcome| {
                let errors = &outcome.errors_at[time.min(outcome.errors_at.len() - 1)];
                chosen.iter().map(|&i| errors[i])
            });
            MeanStd::of(&errors.collect::<Vec<_>>())
        };
        let end = at(usize::MAX)?;
        let newest = outcomes.iter().filter_map(|outcome| outcome.newest.as_ref());
        let newest: Vec<f64> = newest.flat_map(|errors| chosen.iter().map(|&i| errors[i])).collect();
        Some(Self {
            name: quantity.name.clone(),
            unit: quantity.unit.clone(),
            mean_absolute: end.mean,
            std: end.std.unwrap_or(0.0),
            newest: MeanStd::of(&newest).map(|newest| newest.mean),
            mean_absolute_at: (0..times).map(|time| at(time).map(|at| at.mean)).collect::<Option<_>>()?,
        })
    }

    fn mean(each: &[&Self]) -> Option<OutputErrors<MeanStd>> {
        let first = each.first()?;
        let newest: Vec<f64> = each.iter().filter_map(|one| one.newest).collect();
        let times = 0..first.mean_absolute_at.len();
        Some(OutputErrors {
            name: first.name.clone(),
            unit: first.unit.clone(),
            mean_absolute: MeanStd::over(each, |one| one.mean_absolute)?,
            std: MeanStd::over(each, |one| one.std)?,
            newest: MeanStd::of(&newest),
            mean_absolute_at: times
                .map(|time| MeanStd::over(each, |one| one.mean_absolute_at[time]))
                .collect::<Option<_>>()?,
        })
    }
}

impl Figures for Errors {
    type Mean = Errors<MeanStd>;

    fn mean(each: &[&Self]) -> Option<Errors<MeanStd>> {
        let first = each.first()?;
        let output =
            |i: usize| OutputErrors::mean(&each.iter().map(|one| &one.outputs[i]).collect::<Vec<_>>());
        let angles: Vec<&OutputErrors> = each.iter().filter_map(|one| one.angles.as_ref()).collect();
        let settled: Vec<Option<f64>> = each.iter().flat_map(|one| one.settled.iter().copied()).collect();
        let mut work = Work::default();
        each.iter().for_each(|one| work.add(&one.work));
        let doubts = each.iter().try_fold(PressDoubts::default(), |mut sum, one| {
            sum.add(one.doubts.as_ref()?);
            Some(sum)
        });
        Some(Errors {
            doubts,
            presses: first.presses,
            outputs: (0..first.outputs.len()).map(output).collect::<Option<_>>()?,
            angles: OutputErrors::mean(&angles),
            settled_share: lower_median(settled.clone()),
            work,
            settled,
        })
    }
}

impl Work {
    pub(crate) fn add_press(&mut self, press: &Effort) {
        self.presses += 1;
        self.events += press.events;
        self.predictions += press.update_ns.len() as u64;
        self.rows += press.count.rows;
        self.multiply_adds += press.count.multiply_adds;
        press.update_ns.iter().for_each(|&ns| self.update_us.record(Duration::from_nanos(ns)));
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.presses += other.presses;
        self.events += other.events;
        self.predictions += other.predictions;
        self.rows += other.rows;
        self.multiply_adds += other.multiply_adds;
        self.update_us.add(&other.update_us);
    }
}

/// True and predicted values at the end of each press, for each output, in the units of the report.
pub(super) fn scatter(outcomes: &[Outcome], quantities: &[Quantity]) -> Vec<Vec<(f64, f64)>> {
    let point =
        |outcome: &Outcome, i: usize, scale: f64| (outcome.truth[i], f64::from(outcome.values[i]) * scale);
    let each = quantities.iter().enumerate();
    each.map(|(i, quantity)| outcomes.iter().map(|outcome| point(outcome, i, quantity.scale)).collect())
        .collect()
}

/// The lower median of `shares`, where `None` is larger than all shares.
fn lower_median(mut shares: Vec<Option<f64>>) -> Option<f64> {
    shares.sort_unstable_by(|a, b| a.unwrap_or(f64::INFINITY).total_cmp(&b.unwrap_or(f64::INFINITY)));
    shares.get(shares.len().checked_sub(1)? / 2).copied().flatten()
}
