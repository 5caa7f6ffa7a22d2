//! Networks for the direction of slip on the labels.
//!
//! Enters: the data set, networks with their trainings. Leaves: a [`Report`], and the outputs of whole trainings. Whole
//! trainings are judged on the objects of each set. Folds are judged on the windows that they held out, all folds of a
//! scheme and a seed together.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use meissner_engine::frames::{Convolution, FrameEngine};
use meissner_models::systems::slip::{CLASSES, ObjectSet, REFERENCES, Reference};
use meissner_models::{AnyDescription, FrameDescription, ModelError, TensorFile};
use meissner_pipeline::model::frame_network;
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use meissner_pipeline::text::grouped;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::{Slip, SlipData, Windows, trained_on_basic};
use crate::error::{EvaluateError, TrainingError, weights_error};
use crate::judged::{self, Figures};
use crate::metrics::{Confusion, MeanStd, Scores, predicted};
use crate::trainings::Scheme;
use crate::trainings::{Candidate, Evaluation, Metadata, Request, Training, candidates};
use crate::workers::Workers;

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    pub classes: [&'static str; CLASSES.len()],
    pub networks: Vec<NetworkReport>,
    /// Accuracies of other methods.
    #[serde(serialize_with = "named")]
    pub references: [Reference; REFERENCES.len()],
}

/// The data set that networks are judged on.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub folder: String,
    pub recordings: usize,
    pub readings: usize,
    /// Remarks about the data and the trainings, for people.
    pub notes: Vec<String>,
}

/// Figures of a network.
#[derive(Serialize)]
pub struct NetworkReport {
    /// Network and weights.
    #[serde(flatten)]
    pub card: ModelCard,
    /// How its frames are made.
    pub preparation: Value,
    /// Source of its weights.
    #[serde(skip)]
    pub weights: String,
    /// Whole trainings on each set of the data.
    pub sets: Vec<SetReport>,
    /// Folds, by scheme.
    pub cross_validation: Vec<ValidationReport>,
}

/// Figures of whole trainings on one set.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SetReport {
    pub set: &'static str,
    /// Whether the networks were trained on it.
    pub trained_on: bool,
    #[serde(flatten)]
    pub judged: Judged,
}

/// Figures of the folds of a scheme.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ValidationReport {
    pub scheme: Scheme,
    /// Number of windows of the set Basic.
    pub of_basic: u64,
    #[serde(flatten)]
    pub judged: Judged,
}

/// Figures of several trainings.
pub type Judged = judged::Judged<Classified>;

/// Figures of a classification of windows; `T` is a number for one training and [`MeanStd`] for several.
#[derive(Serialize)]
pub struct Classified<T = f64> {
    /// Number of windows; for several trainings the smallest. It differs only where folds are missing.
    pub windows: u64,
    /// Accuracy, precision, recall and F1.
    #[serde(flatten)]
    pub scores: Scores<T>,
    /// Counts of predictions, the sum over the trainings.
    pub confusion: Confusion,
}

impl Classified {
    /// The figures of predictions (true class, outputs); `None` for no predictions.
    fn new<'a>(predictions: impl Iterator<Item = (usize, &'a Vec<f32>)>) -> Option<Self> {
        let mut confusion = Confusion::new(CLASSES.len());
        predictions.for_each(|(truth, values)| confusion.add(truth, predicted(values)));
        Some(Self { windows: confusion.total(), scores: Scores::of(&confusion)?, confusion })
    }
}

impl Figures for Classified {
    type Mean = Classified<MeanStd>;

    fn mean(each: &[&Self]) -> Option<Classified<MeanStd>> {
        Some(Classified {
            windows: each.iter().map(|one| one.windows).min()?,
            scores: Scores::mean(&each.iter().map(|one| one.scores).collect::<Vec<_>>())?,
            confusion: Confusion::sum(each.iter().map(|one| &one.confusion))?,
        })
    }
}

/// Writes `references` as a list of objects, each with the accuracies by set.
fn named<S: Serializer>(references: &[Reference], s: S) -> Result<S::Ok, S::Error> {
    s.collect_seq(references.iter().map(|reference| {
        let of_set = |set: ObjectSet| reference.accuracy(set).map(|accuracy| (set.name(), accuracy));
        let accuracy: BTreeMap<_, _> = ObjectSet::ALL.into_iter().filter_map(of_set).collect();
        json!({ "name": reference.name, "about": reference.about, "accuracy": accuracy })
    }))
}

/// Judges the networks of `request` on the data set in `folder`, with the threads of `workers`. `done` is called after each
/// training with its label and the time since judging began.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn evaluate(
    folder: &Path,
    request: Request<'_>,
    workers: &Workers,
    mut done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>, EvaluateError> {
    let (candidates, notes) = candidates::<Slip>(request)?;
    let data = SlipData::read(folder)?;
    let start = Instant::now();
    let mut judge = Judge {
        data: &data,
        workers,
        logits: TensorFile::new(BTreeMap::new()),
        notes: data.notes.iter().cloned().chain(notes).collect(),
    };
    let mut done = |training: &Training| done(&training.label, start.elapsed());
    let networks = candidates.iter().map(|candidate| judge.network(candidate, &mut done));
    let networks = networks.collect::<Result<_, _>>()?;
    let took = start.elapsed();
    let name = folder.display().to_string();
    let report = Report {
        header: Header::of_many("eval slip", InputCard::other(&name, "readings of 24 electrodes")),
        data: DataReport {
            folder: name,
            recordings: data.recordings.len(),
            readings: data.recordings.iter().map(|recording| recording.readings.len()).sum(),
            notes: judge.notes,
        },
        classes: CLASSES,
        networks,
        references: REFERENCES,
    };
    Ok(Evaluation { report, logits: judge.logits, took })
}

/// Judges networks on one data set.
struct Judge<'a> {
    data: &'a SlipData,
    workers: &'a Workers,
    /// Outputs of whole trainings.
    logits: TensorFile,
    notes: Vec<String>,
}

impl Judge<'_> {
    fn network(
        &mut self,
        candidate: &Candidate<FrameDescription>,
        mut done: impl FnMut(&Training),
    ) -> Result<NetworkReport, EvaluateError> {
        let Candidate { description, trainings } = candidate;
        let (data, name) = (self.data, description.name());
        let windows = Windows::cut(data, description)?;
        let class = |window: usize| data.recordings[windows.cases.recording(window)].class;
        let set = |window: usize| data.objects[windows.cases.recording(window)].set;
        let all: Vec<usize> = (0..windows.cases.len()).collect();
        let of_basic = all.iter().filter(|&&window| set(window) == ObjectSet::Basic).count();
        let is_basic = |chosen: &[usize]| match chosen.iter().find(|&&window| set(window) != ObjectSet::Basic)
        {
            None => Ok(()),
            Some(&window) => {
                let recording = &data.recordings[windows.cases.recording(window)].name;
                let expected = "recordings of the set Basic, which it was trained on".to_owned();
                let found = format!("{recording:?} of {}", set(window));
                Err(TrainingError::HeldOut { expected, found })
            }
        };
        let trials = windows.cases.trials(trainings, &all, is_basic)?;
        let mut sets: BTreeMap<ObjectSet, Vec<_>> = BTreeMap::new();
        let mut schemes: BTreeMap<Scheme, Vec<_>> = BTreeMap::new();
        for trial in &trials {
            let outputs = trial.outcomes(&mut done, |training, chosen| {
                self.outputs(description, training, &windows, chosen)
            })?;
            let of = |chosen: &dyn Fn(usize) -> bool| {
                let outputs = outputs.iter().filter(|(window, _)| chosen(*window));
                (trial, Classified::new(outputs.map(|(window, values)| (class(*window), values))))
            };
            let Some(scheme) = trial.scheme else {
                for of_set in ObjectSet::ALL {
                    sets.entry(of_set).or_default().push(of(&|window| set(window) == of_set));
                }
                let values =
                    outputs.iter().flat_map(|(_, values)| values.iter().copied()).collect::<Vec<_>>();
                trial.write(name, CLASSES.len(), &values, &mut self.logits);
                continue;
            };
            if trial.cases() != of_basic {
                let (folds, seed) = (trial.folds.len(), trial.seed.unwrap_or_default());
                self.notes.push(format!(
                    "{name}: the {folds} folds of seed {seed} hold out {} of the {} windows of Basic",
                    grouped(trial.cases() as u64),
                    grouped(of_basic as u64)
                ));
            }
            schemes.entry(scheme).or_default().push(of(&|_| true));
        }
        let on_basic =
            trainings.iter().any(|training| trained_on_basic(Metadata(training.weights.metadata())));
        let sets = sets.into_iter().filter_map(|(set, each)| {
            let trained_on = set == ObjectSet::Basic && on_basic;
            Some(SetReport { set: set.name(), trained_on, judged: Judged::new(each)? })
        });
        let validations = schemes.into_iter().filter_map(|(scheme, each)| {
            Some(ValidationReport { scheme, of_basic: of_basic as u64, judged: Judged::new(each)? })
        });
        let described = AnyDescription::Frames(description.clone());
        let preparation = description.preparation().and_then(|text| serde_json::from_str(&text).ok());
        Ok(NetworkReport {
            card: ModelCard::new(&described, &trainings[0].weights, candidate.weights())?,
            preparation: preparation.unwrap_or(Value::Null),
            weights: candidate.weights(),
            sets: sets.collect(),
            cross_validation: validations.collect(),
        })
    }

    /// The outputs for the windows `chosen` with the weights of `training`.
    fn outputs(
        &self,
        description: &FrameDescription,
        training: &Training,
        windows: &Windows,
        chosen: &[usize],
    ) -> Result<Vec<Vec<f32>>, EvaluateError> {
        let weights = (&training.weights, training.label.clone());
        let (network, _) = frame_network(description, weights, Convolution::Direct, false)?;
        let engine = FrameEngine::new(network)?;
        let failed = weights_error(&training.label);
        let failed = |source| failed(ModelError::Engine(source));
        windows.logits(self.workers, &engine, chosen, windows.steps, failed)
    }
}

impl NetworkReport {
    /// The figures on `set`, if there are any.
    pub fn on(&self, set: ObjectSet) -> Option<&SetReport> {
        self.sets.iter().find(|report| report.set == set.name())
    }

    /// The cross-validation by `scheme`, if there is one.
    pub fn validated(&self, scheme: Scheme) -> Option<&ValidationReport> {
        self.cross_validation.iter().find(|report| report.scheme == scheme)
    }
}
