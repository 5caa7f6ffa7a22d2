//! Networks over events on the labels, event by event.
//!
//! Input: the data set, networks with their trainings. Output: a [`Report`], and the outputs at
//! the end of each recording. Whole trainings are judged on the split test, all folds of a seed
//! together on the recordings that they held out. Every recording begins with a reset: threads
//! change no bit.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use meissner_engine::EngineError;
use meissner_io::datasets::{EventRecording, Split};
use meissner_models::{Description, ModelError, TensorFile};
use meissner_run::approximations::Approximations;
use meissner_run::losses::LossWarning;
use meissner_run::predictor::{EventPredictor, Mode};
use meissner_run::provenance::{Header, InputCard, ModelCard};
use serde::Serialize;
use serde_json::json;

use super::{EventData, EventTask, lost};
use crate::error::{Result, weights_error};
use crate::judge::{Figures, Judge, JudgedTrial, NetworkReport, judge};
use crate::metrics::{Confusion, MeanStd, mean_interval, predicted, wilson_95};
use crate::trainings::{EvaluatedNetwork, Evaluation, Request, Training, candidates};
use crate::trials::Trial;
use crate::workers::Workers;

/// The networks to be judged, and when predictions are read.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Networks and trainings.
    pub request: Request<'a>,
    /// Every `stride`-th event of a recording is pushed; `None` for the stride of the trainings.
    pub stride: Option<usize>,
    /// Number of folds of a cross-validation; `None` for any.
    pub folds: Option<usize>,
    /// Microseconds from one prediction to the next.
    pub every_us: i64,
    /// How predictions are computed.
    pub mode: Mode,
}

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    pub classes: &'static [&'static str],
    /// "incremental" or "batch".
    pub mode: &'static str,
    /// Microseconds from one prediction to the next.
    pub every_us: i64,
    /// Times of predictions since the begin of a recording, up to the end of the longest.
    pub times_us: Vec<i64>,
    /// The begin of a recording: "the first event" or "contact".
    pub since: &'static str,
    pub networks: Vec<NetworkReport<Protocols>>,
}

/// The data set that networks are judged on.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub folder: String,
    pub recordings: usize,
    pub train: usize,
    pub test: usize,
    pub events: u64,
    /// Remarks about the data and the trainings, for people.
    pub notes: Vec<String>,
    /// Warnings about events that networks drop.
    pub warnings: Vec<LossWarning>,
}

/// Figures of a network.
#[derive(Serialize)]
pub struct Protocols {
    /// Every `stride`-th event was pushed.
    pub stride: usize,
    /// Whole trainings on the split test.
    pub test: Option<Judged>,
    /// Folds on the recordings that they held out.
    pub cross_validation: Option<Judged>,
}

/// Figures of several trainings on the same recordings.
pub type Judged = crate::judge::Judged<OverTime>;

/// Figures of answers over time; `T` is a number for one training, [`MeanStd`] for several.
#[derive(Serialize)]
pub struct OverTime<T = f64> {
    /// Number of recordings that each training is judged on.
    pub recordings: u64,
    /// Share of recordings with the right class at their end.
    pub accuracy: T,
    /// 95 % interval; for several trainings the means of the bounds.
    pub interval_95: (f64, f64),
    /// Time in microseconds by which half of all answers are right and stay right.
    pub settled_us: Option<i64>,
    /// Counts of predictions at the end, the sum over the trainings.
    pub confusion: Confusion,
    /// Accuracy at each time.
    pub accuracy_at: Vec<T>,
    /// Interval at each time.
    pub interval_95_at: Vec<(f64, f64)>,
    /// Time in microseconds from which on the answer for each recording is right.
    #[serde(skip)]
    pub settled: Vec<Option<i64>>,
}

impl Protocols {
    /// Names and figures of the protocols, as above.
    pub fn protocols(&self) -> [(&'static str, Option<&Judged>); 2] {
        [("test split", self.test.as_ref()), ("cross-validation", self.cross_validation.as_ref())]
    }
}

/// Judges the networks of `options` on the data set in `folder`, with the threads of `workers`.
/// `done` is called after each training with its label and the time since judging began.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit. Reported before a network
/// runs.
pub fn evaluate<T: EventTask>(
    folder: &Path,
    options: &Options<'_>,
    workers: &Workers,
    done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>> {
    let (candidates, notes) = candidates::<T>(options.request)?;
    let data = T::read(folder)?;
    let test = data.of(Split::Test);
    let names: Vec<&str> = data.recordings.iter().map(|recording| recording.name.as_str()).collect();
    let names_of_test: Vec<&str> = test.iter().map(|&i| names[i]).collect();
    let metadata = [("recordings", json!(names)), ("test", json!(names_of_test))];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_string()));
    let logits = TensorFile::new(BTreeMap::from(metadata));
    let times_us = data.times(options.every_us);
    let of_task = OfEvents { data: &data, options, times: times_us.len(), task: PhantomData::<T> };
    let judged = judge(&of_task, &candidates, logits, workers, done)?;

    let name = folder.display().to_string();
    let input = InputCard::events(&name, &data.set.name, data.set.sensor, Some(data.events()));
    let stride = options.stride.unwrap_or(1);
    let streams = data.recordings.iter().map(|recording| recording.events.iter().step_by(stride));
    Ok(judged.evaluation(|networks| Report {
        header: Header::of_many(data.set.command, input),
        data: DataReport {
            recordings: names.len(),
            train: data.of(Split::Train).len(),
            test: test.len(),
            events: data.events(),
            notes: data.notes.iter().cloned().chain(notes).collect(),
            warnings: lost(&name, data.set.sensor, streams),
            folder: name,
        },
        classes: data.set.classes,
        mode: options.mode.word(),
        every_us: options.every_us,
        times_us,
        since: data.set.since,
        networks,
    }))
}

struct OfEvents<'a, T> {
    data: &'a EventData,
    options: &'a Options<'a>,
    times: usize,
    task: PhantomData<T>,
}

/// Predictions for a recording.
#[derive(Debug, PartialEq)]
pub(super) struct Outcome {
    /// The class at each time before the end, and the class at the end.
    pub(super) answers: Vec<usize>,
    pub(super) logits: Vec<f32>,
    /// Time of the newest event since the begin.
    pub(super) end_us: i64,
}

impl<T: EventTask> Judge for OfEvents<'_, T> {
    type Task = T;
    /// One of so many events is pushed.
    type Plan = usize;
    type Engine = EventPredictor;
    type Outcome = Outcome;
    type Figures = Option<OverTime>;
    type Network = Protocols;

    fn plan(&self, candidate: &EvaluatedNetwork<Description>) -> Result<(usize, Vec<Trial>)> {
        let own = candidate.stride();
        let stride = self.options.stride.map_or(own, Ok)?;
        let trials = self.data.trials(&candidate.trainings, self.options.folds)?;
        self.data.has_test(&trials)?;
        Ok((stride, trials))
    }

    fn engine(&self, description: &Description, _: &usize, training: &Training) -> Result<EventPredictor> {
        let failed = weights_error(&training.label);
        let network = Arc::new(description.network(&training.weights).map_err(&failed)?);
        let (mode, exact) = (self.options.mode, Approximations::default());
        EventPredictor::new(mode, network, self.data.set.sensor, &exact, meissner_engine::Options::default())
            .map_err(|source| failed(ModelError::Engine(source)))
    }

    fn outcome(&self, &stride: &usize, predictor: &mut EventPredictor, case: usize) -> Result<Outcome> {
        Ok(outcome(predictor, &self.data.recordings[case], stride, self.options.every_us)?)
    }

    fn figures(&self, _: &usize, mut judged: JudgedTrial<'_, Outcome>) -> Option<OverTime> {
        let classes = self.data.set.classes.len();
        judged.write(classes, |outcome| outcome.logits.clone());
        let class = |recording: usize| self.data.recordings[recording].class;
        let outcomes: Vec<_> =
            judged.outcomes.iter().map(|(case, outcome)| (class(*case), outcome)).collect();
        OverTime::new(classes, &outcomes, self.options.every_us, self.times)
    }

    fn network(
        &self,
        stride: usize,
        card: &mut ModelCard,
        judged: Vec<(Trial, Option<OverTime>)>,
    ) -> Protocols {
        card.network.stride = stride;
        let (folds, test): (Vec<_>, Vec<_>) =
            judged.into_iter().partition(|(trial, _)| trial.scheme.is_some());
        Protocols { stride, test: Judged::new(test), cross_validation: Judged::new(folds) }
    }
}

/// Pushes every `stride`-th event, and reads a prediction every `every_us` and at the end.
fn outcome(
    predictor: &mut EventPredictor,
    recording: &EventRecording,
    stride: usize,
    every_us: i64,
) -> Result<Outcome, EngineError> {
    predictor.reset();
    let epoch_us = recording.begin_us();
    let (mut due_us, mut end_us) = (every_us, 0);
    let mut answers = Vec::new();
    for &event in recording.events.iter().step_by(stride) {
        let t_us = event.t_us - epoch_us;
        // An event at the due time belongs to its window.
        while due_us < t_us {
            predictor.advance(epoch_us + due_us);
            answers.push(predicted(predictor.predict()?.values));
            due_us += every_us;
        }
        predictor.push(event);
        end_us = end_us.max(t_us);
    }
    let logits = predictor.predict()?.values.to_vec();
    answers.push(predicted(&logits));
    Ok(Outcome { answers, logits, end_us })
}

impl OverTime {
    /// Figures of (true class, outcome) at so many `times`; `None` for no outcomes.
    pub(super) fn new(
        classes: usize,
        outcomes: &[(usize, &Outcome)],
        every_us: i64,
        times: usize,
    ) -> Option<Self> {
        let recordings = outcomes.len() as u64;
        let right_at =
            |time| outcomes.iter().filter(|(truth, outcome)| outcome.at(time) == *truth).count() as u64;
        let share = |hits: u64| hits as f64 / recordings as f64;
        let interval = |hits: u64| wilson_95(hits, recordings);
        let mut confusion = Confusion::new(classes);
        outcomes.iter().for_each(|(truth, outcome)| confusion.add(*truth, outcome.at(usize::MAX)));
        let hits: Vec<u64> = (0..times).map(right_at).collect();
        let settled: Vec<_> =
            outcomes.iter().map(|(truth, outcome)| outcome.settled_us(*truth, every_us)).collect();
        Some(Self {
            recordings,
            accuracy: share(confusion.hits()),
            interval_95: interval(confusion.hits())?,
            settled_us: lower_median(settled.clone()),
            confusion,
            accuracy_at: hits.iter().map(|&hits| share(hits)).collect(),
            interval_95_at: hits.iter().map(|&hits| interval(hits)).collect::<Option<_>>()?,
            settled,
        })
    }
}

impl Figures for OverTime {
    type Mean = OverTime<MeanStd>;

    fn mean(each: &[&Self]) -> Option<OverTime<MeanStd>> {
        let times = 0..each.first()?.accuracy_at.len();
        let interval = |of: &dyn Fn(&Self) -> (f64, f64)| {
            mean_interval(&each.iter().map(|one| of(one)).collect::<Vec<_>>())
        };
        let settled: Vec<_> = each.iter().flat_map(|one| one.settled.iter().copied()).collect();
        Some(OverTime {
            recordings: each.iter().map(|one| one.recordings).min()?,
            accuracy: MeanStd::over(each, |one| one.accuracy)?,
            interval_95: interval(&|one| one.interval_95)?,
            settled_us: lower_median(settled.clone()),
            confusion: Confusion::sum(each.iter().map(|one| &one.confusion))?,
            accuracy_at: times
                .clone()
                .map(|t| MeanStd::over(each, |one| one.accuracy_at[t]))
                .collect::<Option<_>>()?,
            interval_95_at: times.map(|t| interval(&|one| one.interval_95_at[t])).collect::<Option<_>>()?,
            settled,
        })
    }
}

impl Outcome {
    /// The answer at the `time`-th time; after the end of the recording the last answer stands.
    fn at(&self, time: usize) -> usize {
        self.answers[time.min(self.answers.len() - 1)]
    }

    fn settled_us(&self, truth: usize, every_us: i64) -> Option<i64> {
        let first = correct_from(&self.answers, truth)?;
        let is_end = first + 1 == self.answers.len();
        Some(if is_end { self.end_us } else { (first as i64 + 1) * every_us })
    }
}

/// The index from which on all `answers`, in order of time, are `truth`; `None` if the last answer
/// is wrong, and without answers. O(n).
pub(super) fn correct_from(answers: &[usize], truth: usize) -> Option<usize> {
    let wrong = answers.iter().rposition(|&answer| answer != truth);
    let first = wrong.map_or(0, |last_wrong| last_wrong + 1);
    (first < answers.len()).then_some(first)
}

/// The lower median of `times`, where `None` is later than all times.
pub(super) fn lower_median(mut times: Vec<Option<i64>>) -> Option<i64> {
    times.sort_unstable_by_key(|time| time.unwrap_or(i64::MAX));
    times.get(times.len().checked_sub(1)? / 2).copied().flatten()
}
