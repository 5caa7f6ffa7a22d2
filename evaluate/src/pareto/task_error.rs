//! Errors of a task: what they measure, in which unit, and their 95 % intervals.
//!
//! A share of wrong answers has the interval of Wilson. A mean has the interval of a mean over
//! presses or recordings, which are independent.

use serde::{Deserialize, Serialize};

use crate::metrics::{Cluster, MeanStd, clustered_95, mean_interval, wilson_95};

/// What an error of a task measures; 0 is the best.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Share of wrong answers.
    #[default]
    WrongAnswers,
    /// 1 minus the intersection over union of contacts: the mean over pictures.
    OneMinusIou,
    /// Squared error of the force in N^2, the mean over frames.
    SquaredForce,
    /// Absolute error of the force in N, the mean over pictures or frames.
    AbsoluteForce,
}

/// An error of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskError {
    /// The part of the data set.
    pub of: String,
    /// The kind; wrong answers in files without a kind.
    #[serde(default)]
    pub kind: ErrorKind,
    /// The error in the unit of its kind, shares from 0 to 1: the mean over the trainings.
    pub error: f64,
    /// 95 % interval, of several trainings the mean bounds; `None` for one press or recording.
    pub interval_95: Option<(f64, f64)>,
    /// Number of answers, pictures or frames of each training.
    pub trials: u64,
    /// Number of trainings.
    pub trainings: usize,
}

impl ErrorKind {
    /// Heading of such errors, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::WrongAnswers => "wrong answers (%)",
            Self::OneMinusIou => "1 - IoU (%)",
            Self::SquaredForce => "mean squared error (N^2)",
            Self::AbsoluteForce => "mean absolute error (N)",
        }
    }

    /// The same for the column of a table.
    pub fn short(self) -> &'static str {
        match self {
            Self::WrongAnswers => "wrong %",
            Self::OneMinusIou => "1 - IoU %",
            Self::SquaredForce => "MSE (N^2)",
            Self::AbsoluteForce => "MAE (N)",
        }
    }

    /// The unit that errors are shown in.
    pub fn unit(self) -> &'static str {
        match self {
            Self::WrongAnswers | Self::OneMinusIou => "%",
            Self::SquaredForce => "N^2",
            Self::AbsoluteForce => "N",
        }
    }

    /// Whether errors are shares, which are shown in percent and do not exceed 1.
    pub fn is_share(self) -> bool {
        matches!(self, Self::WrongAnswers | Self::OneMinusIou)
    }

    /// An error in its shown unit.
    pub fn shown(self, error: f64) -> f64 {
        if self.is_share() { 100.0 * error } else { error }
    }

    /// An error under a heading with the unit.
    pub fn text(self, error: f64) -> String {
        format!("{:.*}", if self.is_share() { 2 } else { 4 }, self.shown(error))
    }

    /// An interval under a heading with the unit.
    pub fn interval_text(self, (low, high): (f64, f64)) -> String {
        format!("{} to {}", self.text(low), self.text(high))
    }

    /// An interval, cut to the possible values of such an error.
    fn possible(self, (low, high): (f64, f64)) -> (f64, f64) {
        let most = if self.is_share() { 1.0 } else { f64::INFINITY };
        (low.clamp(0.0, most), high.clamp(0.0, most))
    }
}

/// The error of one training, with its interval and the number of figures.
struct Judged(f64, Option<(f64, f64)>, u64);

impl TaskError {
    /// The error of (wrong, all) answers of each training; `None` where there are none.
    pub(super) fn new(of: impl Into<String>, counts: &[(u64, u64)]) -> Option<Self> {
        let judged = |&(wrong, all): &(u64, u64)| {
            Some(Judged(wrong as f64 / all as f64, Some(wilson_95(wrong, all)?), all))
        };
        let each: Vec<Judged> = counts.iter().map(judged).collect::<Option<_>>()?;
        Self::over(of.into(), ErrorKind::WrongAnswers, &each)
    }

    /// The mean of each training's figures, with those of each press or recording, if any.
    pub(super) fn mean(
        of: impl Into<String>,
        kind: ErrorKind,
        trainings: impl IntoIterator<Item = (f64, Vec<Cluster>)>,
    ) -> Option<Self> {
        let judged = |(mean, clusters): (f64, Vec<Cluster>)| {
            let figures = clusters.iter().map(|(_, size)| size).sum();
            let interval = clustered_95(&clusters).map(|interval| kind.possible(interval));
            (figures > 0).then_some(Judged(mean, interval, figures))
        };
        let each: Vec<Judged> = trainings.into_iter().map(judged).collect::<Option<_>>()?;
        Self::over(of.into(), kind, &each)
    }

    fn over(of: String, kind: ErrorKind, each: &[Judged]) -> Option<Self> {
        let intervals: Option<Vec<(f64, f64)>> = each.iter().map(|judged| judged.1).collect();
        Some(Self {
            of,
            kind,
            error: MeanStd::over(each, |judged| judged.0)?.mean,
            interval_95: intervals.and_then(|intervals| mean_interval(&intervals)),
            trials: each[0].2,
            trainings: each.len(),
        })
    }
}
