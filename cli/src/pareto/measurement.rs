//! What is known of a network with one setting, and who finds it out.

use meissner_models::metrics::wilson_95;
use serde::{Deserialize, Serialize};

use super::numerical::Numerical;
use super::timing::Timing;
use crate::error::CliError;

/// Name of the setting that everything is compared with.
pub(super) const EXACT: &str = "exact";

/// A network that can be measured with each of its settings.
pub(super) trait Subject {
    /// Its name.
    fn network(&self) -> &str;
    /// Where its weights come from.
    fn weights(&self) -> &str;
    /// What tells network and weights from all others.
    fn fingerprint(&self) -> &str;
    /// Names of its settings; the first is [`EXACT`].
    fn settings(&self) -> Vec<String>;
    /// Measures the setting at this place.
    fn measure(&self, setting: usize) -> Result<Measurement, CliError>;
}

/// Times, work and errors of one setting; times, rows and products are those of an event of the input, or of a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Measurement {
    /// Events or windows that were timed in each repeat.
    pub(super) timed: u64,
    /// Share of these that no filter dropped.
    pub(super) entered: f64,
    #[serde(flatten)]
    pub(super) timing: Timing,
    /// Rows of events and cells, or pixels of frames, that were computed.
    pub(super) rows: f64,
    pub(super) multiply_adds: f64,
    pub(super) numerical: Numerical,
    /// Against labels; the first one is what settings are compared by. None where there are no labels.
    pub(super) task: Vec<Task>,
}

#[cfg(test)]
impl Measurement {
    /// One event that took no time and had no error, with what a `task` was answered.
    pub(super) fn of_nothing(task: Vec<Task>) -> Self {
        use super::numerical::Differences;
        use super::timing::Lap;
        Self {
            timed: 1,
            entered: 1.0,
            timing: Timing::of(&[(Lap::default(), Lap::default())]),
            rows: 0.0,
            multiply_adds: 0.0,
            numerical: Differences::default().finish(),
            task,
        }
    }
}

/// How often a class was wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Task {
    /// What was judged.
    pub(super) of: String,
    /// Share of wrong answers, the mean over the trainings.
    pub(super) error: f64,
    /// 95 % Wilson interval of one training; over several the mean of their bounds.
    pub(super) interval_95: (f64, f64),
    /// Answers of each training.
    pub(super) trials: u64,
    pub(super) trainings: usize,
}

impl Task {
    /// Of (wrong, all) answers of each training; `None` where nothing was asked.
    pub(super) fn new(of: impl Into<String>, counts: &[(u64, u64)]) -> Option<Self> {
        let intervals: Vec<(f64, f64)> =
            counts.iter().filter_map(|&(wrong, all)| wilson_95(wrong, all)).collect();
        let trainings = intervals.len();
        if trainings == 0 || trainings != counts.len() {
            return None;
        }
        let mean = |sum: f64| sum / trainings as f64;
        Some(Self {
            of: of.into(),
            error: mean(counts.iter().map(|&(wrong, all)| wrong as f64 / all as f64).sum()),
            interval_95: (
                mean(intervals.iter().map(|bounds| bounds.0).sum()),
                mean(intervals.iter().map(|bounds| bounds.1).sum()),
            ),
            trials: counts[0].1,
            trainings,
        })
    }
}

impl Measurement {
    /// The error by which settings are compared, with its interval where it has one.
    pub(super) fn error(&self) -> (f64, Option<(f64, f64)>) {
        match self.task.first() {
            Some(task) => (task.error, Some(task.interval_95)),
            None => (self.numerical.compared(), None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Task;

    #[test]
    fn several_trainings_count_alike() {
        let task = Task::new("test", &[(1, 10), (3, 10)]).expect("asked");
        assert!((task.error - 0.2).abs() < 1e-12);
        assert_eq!((task.trials, task.trainings), (10, 2));
        assert!(task.interval_95.0 < 0.2 && 0.2 < task.interval_95.1);
        assert_eq!(Task::new("test", &[]), None);
        assert_eq!(Task::new("test", &[(0, 0)]), None);
    }
}
