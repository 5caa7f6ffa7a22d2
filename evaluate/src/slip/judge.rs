//! Networks for the direction of slip on the labels.
//!
//! Input: the data set, networks with their trainings. Output: a [`Report`], and the outputs of
//! whole trainings. Whole trainings are judged on the objects of each set. Folds are judged on the
//! windows that they held out, all folds of a scheme and a seed together.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use meissner_engine::frames::{Convolution, FrameEngine};
use meissner_models::systems::slip::{CLASSES, ObjectSet, REFERENCES, Reference};
use meissner_models::{FrameDescription, TensorFile};
use meissner_run::model::frame_network;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::text::grouped;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::{Slip, SlipData, Windows, trained_on_basic};
use crate::doubts::Doubts;
use crate::error::{Result, TrainingError};
use crate::judge::{Figures, Judge, JudgedTrial, NetworkReport, judge};
use crate::metrics::{Confusion, MeanStd, Scores, predicted};
use crate::trainings::{EvaluatedNetwork, Evaluation, Metadata, Request, Scheme, Training, candidates};
use crate::trials::Trial;
use crate::workers::Workers;

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    pub classes: [&'static str; CLASSES.len()],
    pub networks: Vec<NetworkReport<SlipFigures>>,
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
pub struct SlipFigures {
    /// How its frames are made.
    pub preparation: Value,
    /// Whole trainings on each set of the data.
    pub sets: Vec<SetReport>,
    /// Folds, by scheme.
    pub cross_validation: Vec<ValidationReport>,
    /// Remarks about folds that hold out only a part of the windows.
    #[serde(skip)]
    partial: Vec<String>,
}

/// The logits of a window, and how unlike it is to those of the training.
type Logits = (Vec<f32>, Option<f32>);

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
pub type Judged = crate::judge::Judged<Classified>;

/// Figures of windows; `T` is a number for one training, [`MeanStd`] for several.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Classified<T = f64> {
    /// Number of windows; the smallest number of several trainings if folds are missing.
    pub windows: u64,
    #[serde(flatten)]
    pub scores: Scores<T>,
    /// Counts of predictions, the sum over the trainings.
    pub confusion: Confusion,
    /// How unlike the training's windows the windows are, if the weights have statistics of these.
    pub doubts: Option<Doubts>,
}

impl Classified {
    /// The figures of predictions (true class, outputs); `None` for no predictions.
    fn new<'a>(predictions: impl Iterator<Item = (usize, &'a Logits)>) -> Option<Self> {
        let mut confusion = Confusion::new(CLASSES.len());
        let each = predictions.map(|(truth, (values, unlike))| {
            confusion.add(truth, predicted(values));
            (*unlike, predicted(values) != truth)
        });
        let each: Vec<_> = each.collect();
        let (windows, scores) = (confusion.total(), Scores::of(&confusion)?);
        Some(Self { windows, scores, confusion, doubts: Doubts::of(each) })
    }
}

impl Figures for Classified {
    type Mean = Classified<MeanStd>;

    fn mean(each: &[&Self]) -> Option<Classified<MeanStd>> {
        Some(Classified {
            windows: each.iter().map(|one| one.windows).min()?,
            scores: Scores::mean(&each.iter().map(|one| one.scores).collect::<Vec<_>>())?,
            confusion: Confusion::sum(each.iter().map(|one| &one.confusion))?,
            doubts: Doubts::sum(each.iter().map(|one| one.doubts)),
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

/// Judges the networks of `request` on the data set in `folder`, with the threads of `workers`.
/// `done` is called after each training with its label and the time since judging began.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn evaluate(
    folder: &Path,
    request: Request<'_>,
    workers: &Workers,
    done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>> {
    let (candidates, notes) = candidates::<Slip>(request)?;
    let data = SlipData::read(folder)?;
    let of_slip = OfSlip { data: &data };
    let judged = judge(&of_slip, &candidates, TensorFile::new(BTreeMap::new()), workers, done)?;
    let partial = judged.networks.iter().flat_map(|network| &network.result.partial).cloned();
    let notes = data.notes.iter().cloned().chain(notes).chain(partial).collect();
    let name = folder.display().to_string();
    Ok(judged.evaluation(|networks| Report {
        header: Header::of_many("eval slip", InputCard::other(&name, "readings of 24 electrodes")),
        data: DataReport {
            folder: name,
            recordings: data.recordings.len(),
            readings: data.recordings.iter().map(|recording| recording.readings.len()).sum(),
            notes,
        },
        classes: CLASSES,
        networks,
        references: REFERENCES,
    }))
}

struct OfSlip<'a> {
    data: &'a SlipData,
}

struct Plan {
    windows: Windows,
    preparation: Value,
    /// Number of windows of the set Basic.
    of_basic: usize,
    /// Whether a training was on the set Basic.
    on_basic: bool,
}

/// Figures of a whole training on each set, or of the folds of a scheme.
enum OfTrial {
    Sets(Vec<Option<Classified>>),
    Folds(Scheme, Option<Classified>),
}

impl OfSlip<'_> {
    fn set(&self, windows: &Windows, window: usize) -> ObjectSet {
        self.data.objects[windows.cases.recording(window)].set
    }

    /// Whether a fold held out windows of the set Basic only.
    fn is_of_basic(&self, windows: &Windows, chosen: &[usize]) -> Result<(), TrainingError> {
        let other = chosen.iter().find(|&&window| self.set(windows, window) != ObjectSet::Basic);
        other.map_or(Ok(()), |&window| {
            let recording = &self.data.recordings[windows.cases.recording(window)].name;
            let expected = "recordings of the set Basic, which it was trained on".to_owned();
            let found = format!("{recording:?} of {}", self.set(windows, window));
            Err(TrainingError::HeldOut { expected, found })
        })
    }
}

impl Judge for OfSlip<'_> {
    type Task = Slip;
    type Plan = Plan;
    type Engine = FrameEngine;
    type Outcome = Logits;
    type Figures = OfTrial;
    type Network = SlipFigures;

    fn plan(&self, candidate: &EvaluatedNetwork<FrameDescription>) -> Result<(Plan, Vec<Trial>)> {
        let EvaluatedNetwork { description, trainings } = candidate;
        let windows = Windows::cut(self.data, description)?;
        let all: Vec<usize> = (0..windows.cases.len()).collect();
        let of_basic = all.iter().filter(|&&window| self.set(&windows, window) == ObjectSet::Basic).count();
        let trials = windows.cases.trials(trainings, &all, |chosen| self.is_of_basic(&windows, chosen))?;
        let preparation = description.preparation().and_then(|text| serde_json::from_str(&text).ok());
        let preparation = preparation.unwrap_or(Value::Null);
        let on_basic =
            trainings.iter().any(|training| trained_on_basic(Metadata(training.weights.metadata())));
        Ok((Plan { windows, preparation, of_basic, on_basic }, trials))
    }

    fn engine(&self, description: &FrameDescription, _: &Plan, training: &Training) -> Result<FrameEngine> {
        let weights = (&training.weights, training.label.clone());
        let (network, _) = frame_network(description, weights, Convolution::Direct, false)?;
        Ok(FrameEngine::new(network)?)
    }

    fn outcome(
        &self,
        Plan { windows, .. }: &Plan,
        engine: &mut FrameEngine,
        window: usize,
    ) -> Result<Logits> {
        Ok(windows.logits(engine, window, windows.steps)?)
    }

    /// Only whole trainings have outputs for every window, and write them.
    fn figures(&self, Plan { windows, .. }: &Plan, mut judged: JudgedTrial<'_, Logits>) -> OfTrial {
        if judged.trial.scheme.is_none() {
            judged.write(CLASSES.len(), |(values, _)| values.clone());
        }
        let class = |window: usize| self.data.recordings[windows.cases.recording(window)].class;
        let of = |chosen: &dyn Fn(usize) -> bool| {
            let outcomes = judged.outcomes.iter().filter(|(window, _)| chosen(*window));
            Classified::new(outcomes.map(|(window, values)| (class(*window), values)))
        };
        if let Some(scheme) = judged.trial.scheme {
            return OfTrial::Folds(scheme, of(&|_| true));
        }
        let on = |of_set| of(&|window| self.set(windows, window) == of_set);
        OfTrial::Sets(ObjectSet::ALL.into_iter().map(on).collect())
    }

    fn network(&self, plan: Plan, card: &mut ModelCard, judged: Vec<(Trial, OfTrial)>) -> SlipFigures {
        let Plan { preparation, of_basic, on_basic, .. } = plan;
        let mut sets: BTreeMap<ObjectSet, Vec<_>> = BTreeMap::new();
        let mut schemes: BTreeMap<Scheme, Vec<_>> = BTreeMap::new();
        let mut partial = Vec::new();
        for (trial, figures) in judged {
            match figures {
                OfTrial::Sets(figures) => {
                    for (set, figures) in ObjectSet::ALL.into_iter().zip(figures) {
                        sets.entry(set).or_default().push((trial.clone(), figures));
                    }
                }
                OfTrial::Folds(scheme, figures) => {
                    if trial.cases() != of_basic {
                        let (folds, seed) = (trial.folds.len(), trial.seed.unwrap_or_default());
                        partial.push(format!(
                            "{}: the {folds} folds of seed {seed} hold out {} of the {} windows of Basic",
                            card.network.name,
                            grouped(trial.cases() as u64),
                            grouped(of_basic as u64)
                        ));
                    }
                    schemes.entry(scheme).or_default().push((trial, figures));
                }
            }
        }
        let sets = sets.into_iter().filter_map(|(set, each)| {
            let trained_on = set == ObjectSet::Basic && on_basic;
            Some(SetReport { set: set.name(), trained_on, judged: Judged::new(each)? })
        });
        let validations = schemes.into_iter().filter_map(|(scheme, each)| {
            Some(ValidationReport { scheme, of_basic: of_basic as u64, judged: Judged::new(each)? })
        });
        let (sets, cross_validation) = (sets.collect(), validations.collect());
        SlipFigures { preparation, sets, cross_validation, partial }
    }
}

impl SlipFigures {
    /// The figures on `set`, if there are any.
    pub fn on(&self, set: ObjectSet) -> Option<&SetReport> {
        self.sets.iter().find(|report| report.set == set.name())
    }

    /// The cross-validation by `scheme`, if there is one.
    pub fn validated(&self, scheme: Scheme) -> Option<&ValidationReport> {
        self.cross_validation.iter().find(|report| report.scheme == scheme)
    }
}
