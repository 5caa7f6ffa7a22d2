//! Outcomes against labels.
//!
//! Enters: of each recording its class and its outcome. Leaves: the figures of one training ([`One`]), and of several
//! ([`Judged`]). Counts are integers; figures are formed from them in a fixed order.

use meissner_models::metrics::{Confusion, MeanStd, wilson_95};
use meissner_models::systems::digits::{CLASSES, correct_from};

use super::report::{Judged, One};
use super::runs::Outcome;

/// Outcomes with their true classes.
pub(super) struct Judgeable<'a> {
    /// Of each recording.
    pub(super) outcomes: Vec<(usize, &'a Outcome)>,
    /// Microseconds from one prediction to the next.
    pub(super) every_us: i64,
    /// Number of times at which predictions are read, up to the end of the longest recording.
    pub(super) times: usize,
}

impl One {
    /// The figures of `judgeable`; `None` where there is nothing to judge.
    pub(super) fn new(seed: Option<i64>, files: Vec<String>, judgeable: &Judgeable<'_>) -> Option<Self> {
        let Judgeable { outcomes, every_us, times } = judgeable;
        let recordings = outcomes.len() as u64;
        let share = |hits: usize| hits as f64 / recordings as f64;
        let interval = |hits: usize| wilson_95(hits as u64, recordings);
        let mut confusion = Confusion::new(CLASSES.len());
        outcomes.iter().for_each(|(truth, outcome)| confusion.add(*truth, outcome.at(usize::MAX)));
        let hits_at = |time| outcomes.iter().filter(|(truth, outcome)| outcome.at(time) == *truth).count();
        let hits: Vec<usize> = (0..*times).map(hits_at).collect();
        let hits_at_end = hits_at(usize::MAX);
        let settled: Vec<_> =
            outcomes.iter().map(|(truth, outcome)| outcome.settled_us(*truth, *every_us)).collect();
        Some(Self {
            seed,
            files,
            recordings,
            accuracy: share(hits_at_end),
            interval_95: interval(hits_at_end)?,
            settled_us: half(settled.clone()),
            confusion,
            accuracy_at: hits.iter().map(|&hits| share(hits)).collect(),
            interval_95_at: hits.iter().map(|&hits| interval(hits)).collect::<Option<_>>()?,
            settled,
        })
    }
}

impl Judged {
    /// The figures of `each` training together; `None` where there are none.
    pub(super) fn new(each: Vec<One>) -> Option<Self> {
        let spread = |figure: &dyn Fn(&One) -> f64| MeanStd::of(&each.iter().map(figure).collect::<Vec<_>>());
        let mean = |figure: &dyn Fn(&One) -> f64| spread(figure).map(|spread| spread.mean);
        let mut confusion = Confusion::new(CLASSES.len());
        each.iter().for_each(|one| confusion.merge(&one.confusion));
        let times = 0..each.first()?.accuracy_at.len();
        let interval_at =
            |t: usize| Some((mean(&|one| one.interval_95_at[t].0)?, mean(&|one| one.interval_95_at[t].1)?));
        Some(Self {
            recordings: each.iter().map(|one| one.recordings).min()?,
            trainings: each.len(),
            accuracy: spread(&|one| one.accuracy)?,
            interval_95: (mean(&|one| one.interval_95.0)?, mean(&|one| one.interval_95.1)?),
            settled_us: half(each.iter().flat_map(|one| one.settled.iter().copied()).collect()),
            confusion,
            accuracy_at: times.clone().map(|t| spread(&|one| one.accuracy_at[t])).collect::<Option<_>>()?,
            interval_95_at: times.map(interval_at).collect::<Option<_>>()?,
            each,
        })
    }
}

impl Outcome {
    /// The answer at the `time`th time at which a prediction is read; from the end of the recording on the last one.
    fn at(&self, time: usize) -> usize {
        self.answers[time.min(self.answers.len() - 1)]
    }

    /// From when on the answer is right and stays right.
    fn settled_us(&self, truth: usize, every_us: i64) -> Option<i64> {
        let first = correct_from(&self.answers, truth)?;
        let is_end = first + 1 == self.answers.len();
        Some(if is_end { self.end_us } else { (first as i64 + 1) * every_us })
    }
}

/// The least time by which half of `times` are over; `None` where too many never are. The lower median.
fn half(mut times: Vec<Option<i64>>) -> Option<i64> {
    times.sort_unstable_by_key(|time| time.unwrap_or(i64::MAX));
    times.get(times.len().checked_sub(1)? / 2).copied().flatten()
}

#[cfg(test)]
mod tests {
    use super::{Judgeable, Judged, One, Outcome, half};

    fn outcome(answers: &[usize], end_us: i64) -> Outcome {
        Outcome { answers: answers.to_vec(), logits: Vec::new(), end_us }
    }

    fn one(outcomes: &[(usize, Outcome)], times: usize) -> One {
        let outcomes = outcomes.iter().map(|(truth, outcome)| (*truth, outcome)).collect();
        One::new(Some(1), Vec::new(), &Judgeable { outcomes, every_us: 10, times }).unwrap()
    }

    #[test]
    fn behind_its_end_a_recordings_last_answer_stands() {
        let one = one(&[(3, outcome(&[3, 1, 3], 25)), (4, outcome(&[4], 8))], 4);
        assert_eq!(one.accuracy_at, [1.0, 0.5, 1.0, 1.0]);
        assert_eq!((one.accuracy, one.confusion.hits()), (1.0, 2));
    }

    #[test]
    fn an_answer_settles_when_it_is_read_first_and_at_the_end_at_the_last_event() {
        let outcomes = [
            (3, outcome(&[3, 1, 3], 25)),
            (3, outcome(&[1, 3, 3], 25)),
            (3, outcome(&[3, 3, 3], 25)),
            (3, outcome(&[3, 3, 0], 25)),
        ];
        let one = one(&outcomes, 3);
        assert_eq!(one.settled, [Some(25), Some(20), Some(10), None]);
        assert_eq!(one.settled_us, Some(20));
    }

    #[test]
    fn half_are_over_at_the_lower_median() {
        assert_eq!(half(vec![Some(4), None, Some(2)]), Some(4));
        assert_eq!(half(vec![Some(4), None, Some(2), None]), Some(4));
        assert_eq!(half(vec![None, None, Some(2)]), None);
        assert_eq!(half(vec![]), None);
    }

    #[test]
    fn several_trainings_give_mean_and_deviation_and_the_mean_of_their_bounds() {
        let each = [&[1, 3][..], &[3, 3]].map(|answers| one(&[(3, outcome(answers, 15))], 2));
        let bounds = each[0].interval_95_at[0].0.midpoint(each[1].interval_95_at[0].0);
        let judged = Judged::new(each.into()).unwrap();
        assert_eq!((judged.accuracy_at[0].mean, judged.accuracy_at[0].std), (0.5, Some(0.5_f64.sqrt())));
        assert_eq!((judged.accuracy.mean, judged.trainings, judged.recordings), (1.0, 2, 1));
        assert!((judged.interval_95_at[0].0 - bounds).abs() < 1e-15);
        assert_eq!((judged.settled_us, judged.confusion.count(3, 3)), (Some(10), 2));
    }
}
