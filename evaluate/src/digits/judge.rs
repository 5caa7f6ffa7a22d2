//! Networks for digits on the labels, event by event.
//!
//! Enters: the data set, networks with their trainings. Leaves: a [`Report`], and the outputs at the end of each recording.
//! Whole trainings are judged on the split test. Folds are judged on the recordings that they held out, all folds of a seed
//! together. Counts are integers, and figures are computed from them in a fixed order. Every recording begins with a reset,
//! so the number of threads changes no bit.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{EngineError, Event, LatePolicy};
use meissner_io::datasets::Split;
use meissner_models::systems::digits::{CLASSES, SENSOR, correct_from};
use meissner_models::{AnyDescription, ModelError, TensorFile};
use meissner_pipeline::approximations::Approximations;
use meissner_pipeline::losses::LossWarning;
use meissner_pipeline::model::card;
use meissner_pipeline::predictor::{EventPredictor, Mode};
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use rayon::ThreadPool;
use serde::Serialize;
use serde_json::json;

use super::{Candidate, CrossValidation, Digits, DigitsData, Training, cross_validations};
use crate::error::{EvaluateError, weights_error};
use crate::metrics::{Confusion, MeanStd, predicted, wilson_95};
use crate::trainings::{Evaluation, Request, candidates, seed_name};
use crate::workers;

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
pub struct Report {
    /// Command and input.
    pub header: Header,
    /// The data set.
    pub data: DataReport,
    /// Names of the classes.
    pub classes: [&'static str; CLASSES.len()],
    /// "incremental" or "batch".
    pub mode: &'static str,
    /// Microseconds from one prediction to the next.
    pub every_us: i64,
    /// Times of predictions from the first event of a recording on. The last one is at or after the end of every recording.
    pub times_us: Vec<i64>,
    /// The networks.
    pub networks: Vec<NetworkReport>,
}

/// The data set that networks are judged on.
#[derive(Serialize)]
pub struct DataReport {
    /// Its folder.
    pub folder: String,
    /// Number of recordings.
    pub recordings: usize,
    /// Number of recordings of the split train.
    pub train: usize,
    /// Number of recordings of the split test.
    pub test: usize,
    /// Number of events.
    pub events: u64,
    /// Remarks about the data and the trainings, for people.
    pub notes: Vec<String>,
    /// Warnings about events that networks drop.
    pub warnings: Vec<LossWarning>,
}

/// Figures of a network.
#[derive(Serialize)]
pub struct NetworkReport {
    /// Network and weights.
    #[serde(flatten)]
    pub card: ModelCard,
    /// Name of the network.
    #[serde(skip)]
    pub network: String,
    /// Source of its weights.
    #[serde(skip)]
    pub weights: String,
    /// Every `stride`-th event was pushed.
    pub stride: usize,
    /// Whole trainings on the split test.
    pub test: Option<Judged>,
    /// Folds on the recordings that they held out.
    pub cross_validation: Option<Judged>,
}

/// Figures of several trainings on the same recordings.
#[derive(Serialize)]
pub struct Judged {
    /// Number of recordings that each training is judged on.
    pub recordings: u64,
    /// Number of trainings.
    pub trainings: usize,
    /// Share of recordings with the right class at their end.
    pub accuracy: MeanStd,
    /// Means of the bounds of the trainings' 95 % intervals.
    pub interval_95: (f64, f64),
    /// Time by which half of the answers of all trainings are right and stay right, in microseconds.
    pub settled_us: Option<i64>,
    /// Sum over the trainings.
    pub confusion: Confusion,
    /// Accuracy at each time.
    pub accuracy_at: Vec<MeanStd>,
    /// Interval at each time.
    pub interval_95_at: Vec<(f64, f64)>,
    /// The trainings.
    pub each: Vec<JudgedSeed>,
}

/// Figures of one training, or of the folds of one seed together; the fields are those of [`Judged`].
#[derive(Serialize)]
#[expect(missing_docs, reason = "those of Judged")]
pub struct JudgedSeed {
    /// Seed of the training, where the weights state it.
    pub seed: Option<i64>,
    /// Files of the weights; none for shipped ones.
    pub files: Vec<String>,
    pub recordings: u64,
    pub accuracy: f64,
    pub interval_95: (f64, f64),
    pub settled_us: Option<i64>,
    pub confusion: Confusion,
    pub accuracy_at: Vec<f64>,
    pub interval_95_at: Vec<(f64, f64)>,
    /// Time from which on the answer for each recording is right, in microseconds.
    #[serde(skip)]
    pub settled: Vec<Option<i64>>,
}

/// The recordings that trainings are judged on.
#[derive(Clone, Copy, Debug)]
pub enum Protocol {
    /// Whole trainings on the split test.
    Test,
    /// Folds on the recordings that they held out.
    CrossValidation,
}

impl Protocol {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Test, Self::CrossValidation];

    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Test => "test split",
            Self::CrossValidation => "cross-validation",
        }
    }
}

impl NetworkReport {
    /// The figures by `protocol`, if it was used.
    pub fn judged(&self, protocol: Protocol) -> Option<&Judged> {
        match protocol {
            Protocol::Test => self.test.as_ref(),
            Protocol::CrossValidation => self.cross_validation.as_ref(),
        }
    }
}

/// Judges the networks of `options` on the data set in `folder`, with the threads of `pool`. `done` is called after each
/// training with its label and the time since judging began.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit. All of this is checked before a network runs.
pub fn evaluate(
    folder: &Path,
    options: &Options<'_>,
    pool: &ThreadPool,
    mut done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>, EvaluateError> {
    let (candidates, notes) = candidates::<Digits>(options.request)?;
    let strides = candidates.iter().map(|candidate| {
        let own = candidate.stride();
        options.stride.map_or(own, Ok)
    });
    let strides = strides.collect::<Result<Vec<_>, _>>()?;
    let data = DigitsData::read(folder)?;
    let times_us = data.times(options.every_us);
    let judge = Judge { data: &data, pool, options, times: times_us.len(), test: data.of(Split::Test) };
    let mut plans = Vec::new();
    for (candidate, stride) in candidates.into_iter().zip(strides) {
        let validations = cross_validations(&candidate.trainings, &data, options.folds)?;
        let whole = candidate.trainings.iter().any(|training| training.held_out.is_none());
        if whole && judge.test.is_empty() {
            return Err(EvaluateError::NoTestSplit { folder: folder.to_owned() });
        }
        plans.push(Plan { candidate, stride, validations });
    }

    let start = Instant::now();
    let recordings: Vec<&str> = data.recordings.iter().map(|recording| recording.name.as_str()).collect();
    let test: Vec<&str> = judge.test.iter().map(|&i| recordings[i]).collect();
    let metadata = [("recordings", json!(recordings)), ("test", json!(test))];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_string()));
    let mut logits = TensorFile::new(BTreeMap::from(metadata));
    let mut done = |training: &Training| done(&training.label, start.elapsed());
    let networks = plans.iter().map(|plan| judge.network(plan, &mut logits, &mut done));
    let networks = networks.collect::<Result<_, _>>()?;
    let took = start.elapsed();

    let name = folder.display().to_string();
    let input = InputCard::events(&name, &"N-MNIST", SENSOR, Some(data.events()));
    let report = Report {
        header: Header::of_many("eval digits", input),
        data: DataReport {
            recordings: data.recordings.len(),
            train: data.of(Split::Train).len(),
            test: judge.test.len(),
            events: data.events(),
            notes: data.notes.iter().cloned().chain(notes).collect(),
            warnings: data.lost(options.stride.unwrap_or(1), &name),
            folder: name,
        },
        classes: CLASSES,
        mode: match options.mode {
            Mode::Incremental => "incremental",
            Mode::Batch => "batch",
        },
        every_us: options.every_us,
        times_us,
        networks,
    };
    Ok(Evaluation { report, logits, took })
}

/// Judges networks on one data set.
struct Judge<'a> {
    data: &'a DigitsData,
    pool: &'a ThreadPool,
    options: &'a Options<'a>,
    /// Number of times of predictions.
    times: usize,
    /// Indices of the recordings of the split test.
    test: Vec<usize>,
}

/// A network with its checked folds.
struct Plan {
    candidate: Candidate,
    stride: usize,
    validations: Vec<CrossValidation>,
}

/// Predictions for a recording.
#[derive(Debug, PartialEq)]
struct Outcome {
    /// The class at each time before the end, and the class at the end.
    answers: Vec<usize>,
    /// The outputs at the end.
    logits: Vec<f32>,
    /// Time of the newest event since the first one.
    end_us: i64,
}

impl Judge<'_> {
    fn network(
        &self,
        plan: &Plan,
        logits: &mut TensorFile,
        mut done: impl FnMut(&Training),
    ) -> Result<NetworkReport, EvaluateError> {
        let Plan { candidate, stride, validations } = plan;
        let name = candidate.name();
        let (mut test, mut cross_validation) = (Vec::new(), Vec::new());
        for training in candidate.trainings.iter().filter(|training| training.held_out.is_none()) {
            let outcomes = self.outcomes(plan, training, &self.test)?;
            write(logits, &format!("{name}.{}", seed_name(training.seed)), &outcomes);
            test.extend(self.seed(training.seed, training.files(), &outcomes));
            done(training);
        }
        for CrossValidation { seed, folds } in validations {
            let mut outcomes = Vec::new();
            for (training, chosen) in folds {
                outcomes.extend(self.outcomes(plan, training, chosen)?);
                done(training);
            }
            outcomes.sort_by_key(|(recording, _)| *recording);
            write(logits, &format!("{name}.{}.folds", seed_name(*seed)), &outcomes);
            let files = folds.iter().flat_map(|(training, _)| training.files()).collect();
            cross_validation.extend(self.seed(*seed, files, &outcomes));
        }
        let described = AnyDescription::Events(candidate.description.clone());
        let card = card(&described, &candidate.trainings[0].weights, candidate.weights())?;
        Ok(NetworkReport {
            card: card.taking_every(*stride),
            network: name.to_owned(),
            weights: candidate.weights(),
            stride: *stride,
            test: Judged::new(test),
            cross_validation: Judged::new(cross_validation),
        })
    }

    /// The outcomes of the recordings `chosen` with the weights of `training`.
    fn outcomes(
        &self,
        plan: &Plan,
        training: &Training,
        chosen: &[usize],
    ) -> Result<Vec<(usize, Outcome)>, EvaluateError> {
        let failed = weights_error(&training.label);
        let Options { mode, every_us, .. } = *self.options;
        let network = Arc::new(plan.candidate.description.network(&training.weights).map_err(&failed)?);
        let predictor =
            EventPredictor::new(mode, network, SENSOR, LatePolicy::Drop, &Approximations::default());
        let work = |predictor: &mut EventPredictor, &recording: &usize| {
            let events = &self.data.recordings[recording].events;
            Ok((recording, outcome(predictor, events, plan.stride, every_us)?))
        };
        let outcomes = predictor.and_then(|predictor| workers::for_each(self.pool, &predictor, chosen, work));
        outcomes.map_err(|source| failed(ModelError::Engine(source)))
    }

    fn seed(
        &self,
        seed: Option<i64>,
        files: Vec<String>,
        outcomes: &[(usize, Outcome)],
    ) -> Option<JudgedSeed> {
        let class = |recording: usize| self.data.recordings[recording].class;
        let outcomes = outcomes.iter().map(|(recording, outcome)| (class(*recording), outcome));
        JudgedSeed::new(seed, files, &outcomes.collect::<Vec<_>>(), self.options.every_us, self.times)
    }
}

/// Pushes every `stride`-th of `events`, and reads a prediction every `every_us` and at the end.
fn outcome(
    predictor: &mut EventPredictor,
    events: &[Event],
    stride: usize,
    every_us: i64,
) -> Result<Outcome, EngineError> {
    predictor.reset();
    let epoch_us = events.first().map_or(0, |event| event.t_us);
    let (mut due_us, mut end_us) = (every_us, 0);
    let mut answers = Vec::new();
    for &event in events.iter().step_by(stride) {
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

/// Adds the outputs at the end of each recording, (recordings, 10), as the tensor `name`.
fn write(file: &mut TensorFile, name: &str, outcomes: &[(usize, Outcome)]) {
    let values: Vec<f32> = outcomes.iter().flat_map(|(_, outcome)| outcome.logits.iter().copied()).collect();
    file.f32(name, &[values.len() / CLASSES.len(), CLASSES.len()], &values);
}

impl JudgedSeed {
    /// The figures of `outcomes`, each with its true class; `None` for no outcomes.
    fn new(
        seed: Option<i64>,
        files: Vec<String>,
        outcomes: &[(usize, &Outcome)],
        every_us: i64,
        times: usize,
    ) -> Option<Self> {
        let recordings = outcomes.len() as u64;
        let share = |hits: usize| hits as f64 / recordings as f64;
        let interval = |hits: usize| wilson_95(hits as u64, recordings);
        let mut confusion = Confusion::new(CLASSES.len());
        outcomes.iter().for_each(|(truth, outcome)| confusion.add(*truth, outcome.at(usize::MAX)));
        let hits_at = |time| outcomes.iter().filter(|(truth, outcome)| outcome.at(time) == *truth).count();
        let hits: Vec<usize> = (0..times).map(hits_at).collect();
        let hits_at_end = hits_at(usize::MAX);
        let settled: Vec<_> =
            outcomes.iter().map(|(truth, outcome)| outcome.settled_us(*truth, every_us)).collect();
        Some(Self {
            seed,
            files,
            recordings,
            accuracy: share(hits_at_end),
            interval_95: interval(hits_at_end)?,
            settled_us: lower_median(settled.clone()),
            confusion,
            accuracy_at: hits.iter().map(|&hits| share(hits)).collect(),
            interval_95_at: hits.iter().map(|&hits| interval(hits)).collect::<Option<_>>()?,
            settled,
        })
    }
}

impl Judged {
    /// The figures of `each` training together; `None` for no trainings.
    fn new(each: Vec<JudgedSeed>) -> Option<Self> {
        let spread =
            |figure: &dyn Fn(&JudgedSeed) -> f64| MeanStd::of(&each.iter().map(figure).collect::<Vec<_>>());
        let mean = |figure: &dyn Fn(&JudgedSeed) -> f64| spread(figure).map(|spread| spread.mean);
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
            settled_us: lower_median(each.iter().flat_map(|one| one.settled.iter().copied()).collect()),
            confusion,
            accuracy_at: times.clone().map(|t| spread(&|one| one.accuracy_at[t])).collect::<Option<_>>()?,
            interval_95_at: times.map(interval_at).collect::<Option<_>>()?,
            each,
        })
    }
}

impl Outcome {
    /// The answer at the `time`-th time; after the end of the recording the last answer stands.
    fn at(&self, time: usize) -> usize {
        self.answers[time.min(self.answers.len() - 1)]
    }

    /// Time from which on the answer is right.
    fn settled_us(&self, truth: usize, every_us: i64) -> Option<i64> {
        let first = correct_from(&self.answers, truth)?;
        let is_end = first + 1 == self.answers.len();
        Some(if is_end { self.end_us } else { (first as i64 + 1) * every_us })
    }
}

/// The lower median of `times`, where `None` is later than all times.
fn lower_median(mut times: Vec<Option<i64>>) -> Option<i64> {
    times.sort_unstable_by_key(|time| time.unwrap_or(i64::MAX));
    times.get(times.len().checked_sub(1)? / 2).copied().flatten()
}

#[cfg(test)]
mod tests;
