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
use meissner_models::{AnyDescription, ModelError, TensorFile};
use meissner_pipeline::model::{card, frame_network};
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use meissner_pipeline::text::grouped;
use rayon::ThreadPool;
use serde::Serialize;
use serde_json::Value;

use super::{Candidate, HeldOut, Scheme, Slip, SlipData, Training, Windows, trained_on_basic};
use crate::error::{EvaluateError, TrainingError, weights_error};
use crate::metrics::{Confusion, MeanStd, Scores, predicted};
use crate::trainings::{Evaluation, Metadata, Request, candidates, seed_name};

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
pub struct Report {
    /// Command and input.
    pub header: Header,
    /// The data set.
    pub data: DataReport,
    /// Names of the classes.
    pub classes: [&'static str; CLASSES.len()],
    /// The networks.
    pub networks: Vec<NetworkReport>,
    /// Accuracies of other methods.
    pub references: Vec<ReferenceReport>,
}

/// The data set that networks are judged on.
#[derive(Serialize)]
pub struct DataReport {
    /// Its folder.
    pub folder: String,
    /// Number of recordings.
    pub recordings: usize,
    /// Number of readings.
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
    /// Name of the network.
    #[serde(skip)]
    pub network: String,
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
pub struct SetReport {
    /// Name of the set.
    pub set: &'static str,
    /// Whether the networks were trained on it.
    pub trained_on: bool,
    /// The figures.
    #[serde(flatten)]
    pub judged: Judged,
}

/// Figures of the folds of a scheme.
#[derive(Serialize)]
pub struct ValidationReport {
    /// The scheme.
    pub scheme: Scheme,
    /// Number of windows of the set Basic.
    pub of_basic: u64,
    /// The figures.
    #[serde(flatten)]
    pub judged: Judged,
}

/// Figures of several trainings.
#[derive(Serialize)]
pub struct Judged {
    /// The smallest number of windows that a training is judged on. It differs only where folds are missing.
    pub windows: u64,
    /// Number of trainings.
    pub trainings: usize,
    /// Share of windows with the right class.
    pub accuracy: MeanStd,
    /// Mean precision of the classes.
    pub precision: MeanStd,
    /// Mean recall of the classes.
    pub recall: MeanStd,
    /// Mean F1 of the classes.
    pub f1: MeanStd,
    /// Sum over the trainings.
    pub confusion: Confusion,
    /// The trainings.
    pub each: Vec<JudgedSeed>,
}

/// Figures of one training, or of the folds of one seed together.
#[derive(Serialize)]
pub struct JudgedSeed {
    /// Seed of the training, where the weights state it.
    pub seed: Option<i64>,
    /// Files of the weights; none for shipped ones.
    pub files: Vec<String>,
    /// Number of windows.
    pub windows: u64,
    /// Accuracy, precision, recall and F1.
    #[serde(flatten)]
    pub scores: Scores,
    /// Counts of predictions.
    pub confusion: Confusion,
}

/// Accuracies of another method.
#[derive(Serialize)]
pub struct ReferenceReport {
    /// Its name.
    pub name: &'static str,
    /// The method.
    pub about: &'static str,
    /// Accuracy by set.
    pub accuracy: BTreeMap<&'static str, f64>,
    /// The same as numbers.
    #[serde(skip)]
    pub reference: Reference,
}

/// Judges the networks of `request` on the data set in `folder`, with the threads of `pool`. `done` is called after each
/// training with its label and the time since judging began.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn evaluate(
    folder: &Path,
    request: Request<'_>,
    pool: &ThreadPool,
    mut done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>, EvaluateError> {
    let (candidates, notes) = candidates::<Slip>(request)?;
    let data = SlipData::read(folder)?;
    let start = Instant::now();
    let mut judge = Judge {
        data: &data,
        pool,
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
        references: ReferenceReport::all(),
    };
    Ok(Evaluation { report, logits: judge.logits, took })
}

/// Judges networks on one data set.
struct Judge<'a> {
    data: &'a SlipData,
    pool: &'a ThreadPool,
    /// Outputs of whole trainings.
    logits: TensorFile,
    notes: Vec<String>,
}

/// The folds of a scheme and a seed.
struct Folds<'a> {
    confusion: Confusion,
    files: Vec<String>,
    /// The fold that held out each window, by recording.
    owners: Vec<Vec<Option<&'a Path>>>,
}

impl Judge<'_> {
    fn network(
        &mut self,
        candidate: &Candidate,
        mut done: impl FnMut(&Training),
    ) -> Result<NetworkReport, EvaluateError> {
        let Candidate { description, trainings } = candidate;
        let windows = Windows::cut(self.data, description)?;
        let mut sets: BTreeMap<ObjectSet, Vec<JudgedSeed>> = BTreeMap::new();
        let mut folds: BTreeMap<(Scheme, Option<i64>), Folds<'_>> = BTreeMap::new();
        for training in trainings {
            let weights = (&training.weights, training.label.clone());
            let (network, _) = frame_network(description, weights, Convolution::Direct, false)?;
            let engine = FrameEngine::new(network)?;
            let failed = weights_error(&training.label);
            let outputs = |chosen: &[Vec<usize>]| {
                let logits = windows.logits(self.pool, &engine, chosen, windows.steps());
                logits.map_err(|source| failed(ModelError::Engine(source)))
            };
            if let Some(held_out) = &training.held_out {
                let chosen = self.held_out(held_out, &windows).map_err(|source| training.refused(source))?;
                let folds = folds.entry((held_out.scheme(), training.seed));
                let folds = folds.or_insert_with(|| Folds::new(&windows));
                let owned = folds.own(&training.path, &chosen, self.data);
                owned.map_err(|source| training.refused(source))?;
                folds.confusion.merge(&self.confusion(&outputs(&chosen)?, |_| true));
                folds.files.extend(training.files());
            } else {
                let outputs = outputs(&windows.all())?;
                for set in ObjectSet::ALL {
                    let confusion = self.confusion(&outputs, |index| self.data.objects[index].set == set);
                    let judged = JudgedSeed::new(training.seed, training.files(), confusion);
                    sets.entry(set).or_default().extend(judged);
                }
                let (name, values) =
                    (format!("{}.{}", training.network, seed_name(training.seed)), outputs.concat());
                self.logits.f32(&name, &[values.len() / CLASSES.len(), CLASSES.len()], &values);
            }
            done(training);
        }
        let on_basic =
            trainings.iter().any(|training| trained_on_basic(Metadata(training.weights.metadata())));
        let sets = sets.into_iter().filter_map(|(set, each)| {
            let trained_on = set == ObjectSet::Basic && on_basic;
            Some(SetReport { set: set.name(), trained_on, judged: Judged::new(each)? })
        });
        let described = AnyDescription::Frames(description.clone());
        let preparation = description.preparation().and_then(|text| serde_json::from_str(&text).ok());
        Ok(NetworkReport {
            card: card(&described, &trainings[0].weights, candidate.weights())?,
            network: description.name().to_owned(),
            preparation: preparation.unwrap_or(Value::Null),
            weights: candidate.weights(),
            sets: sets.collect(),
            cross_validation: self.validations(description.name(), folds, &windows),
        })
    }

    /// The windows of each recording that a fold held out, in order.
    fn held_out(&self, held_out: &HeldOut, windows: &Windows) -> Result<Vec<Vec<usize>>, TrainingError> {
        let mut chosen = vec![Vec::new(); windows.counts.len()];
        let find = |name: &str| {
            let index = self.data.recordings.iter().position(|recording| recording.name == name);
            let found = || name.to_owned();
            let index = index.ok_or_else(|| TrainingError::Recording { found: found() })?;
            match self.data.objects[index].set {
                ObjectSet::Basic => Ok(index),
                set => Err(TrainingError::OtherSet { found: found(), set }),
            }
        };
        match held_out {
            HeldOut::Recordings(names) => {
                for name in names {
                    let index = find(name)?;
                    chosen[index].extend(0..windows.counts[index]);
                }
            }
            HeldOut::Windows(list) => {
                for (name, window) in list {
                    let index = find(name)?;
                    if *window >= windows.counts[index] {
                        let (recording, windows) = (name.clone(), windows.counts[index]);
                        return Err(TrainingError::Window { recording, windows, found: *window });
                    }
                    chosen[index].push(*window);
                }
            }
        }
        chosen.iter_mut().for_each(|windows| windows.sort_unstable());
        Ok(chosen)
    }

    /// Predictions of the `outputs` for the recordings that `counts` is true for.
    fn confusion(&self, outputs: &[Vec<f32>], counts: impl Fn(usize) -> bool) -> Confusion {
        let mut confusion = Confusion::new(CLASSES.len());
        for (index, outputs) in outputs.iter().enumerate().filter(|(index, _)| counts(*index)) {
            for values in outputs.chunks_exact(CLASSES.len()) {
                confusion.add(self.data.recordings[index].class, predicted(values));
            }
        }
        confusion
    }

    /// The figures of each scheme over its seeds, and a note where the folds of a seed do not hold out all of Basic.
    fn validations(
        &mut self,
        network: &str,
        folds: BTreeMap<(Scheme, Option<i64>), Folds<'_>>,
        windows: &Windows,
    ) -> Vec<ValidationReport> {
        let counts = self.data.objects.iter().zip(&windows.counts);
        let of_basic = counts.filter(|(object, _)| object.set == ObjectSet::Basic);
        let of_basic = of_basic.map(|(_, &count)| count as u64).sum();
        let mut schemes: BTreeMap<Scheme, Vec<JudgedSeed>> = BTreeMap::new();
        for ((scheme, seed), Folds { confusion, files, .. }) in folds {
            let found = confusion.total();
            if found != of_basic {
                let seed = seed.unwrap_or_default();
                self.notes.push(format!(
                    "{network}: the {} folds of seed {seed} hold out {} of the {} windows of Basic",
                    files.len(),
                    grouped(found),
                    grouped(of_basic)
                ));
            }
            schemes.entry(scheme).or_default().extend(JudgedSeed::new(seed, files, confusion));
        }
        let report = |(scheme, each)| Some(ValidationReport { scheme, of_basic, judged: Judged::new(each)? });
        schemes.into_iter().filter_map(report).collect()
    }
}

impl<'a> Folds<'a> {
    fn new(windows: &Windows) -> Self {
        Self {
            confusion: Confusion::new(CLASSES.len()),
            files: Vec::new(),
            owners: windows.counts.iter().map(|&count| vec![None; count]).collect(),
        }
    }

    /// Notes that the fold in the file at `path` held out the windows `chosen` of each recording.
    fn own(&mut self, path: &'a Path, chosen: &[Vec<usize>], data: &SlipData) -> Result<(), TrainingError> {
        for (index, windows) in chosen.iter().enumerate() {
            for &window in windows {
                if let Some(first) = self.owners[index][window].replace(path) {
                    let (recording, first) = (data.recordings[index].name.clone(), first.to_owned());
                    return Err(TrainingError::Overlap { recording, window, first });
                }
            }
        }
        Ok(())
    }
}

impl ReferenceReport {
    fn all() -> Vec<Self> {
        let report = |reference: Reference| {
            let of_set = |set: ObjectSet| reference.accuracy(set).map(|accuracy| (set.name(), accuracy));
            let accuracy = ObjectSet::ALL.into_iter().filter_map(of_set).collect();
            Self { name: reference.name, about: reference.about, accuracy, reference }
        };
        REFERENCES.into_iter().map(report).collect()
    }
}

impl JudgedSeed {
    /// The figures of `confusion`; `None` where it has no counts.
    fn new(seed: Option<i64>, files: Vec<String>, confusion: Confusion) -> Option<Self> {
        let scores = Scores::of(&confusion)?;
        Some(Self { seed, files, windows: confusion.total(), scores, confusion })
    }
}

impl Judged {
    /// The figures of `each` training together; `None` for no trainings.
    fn new(each: Vec<JudgedSeed>) -> Option<Self> {
        let spread = |figure: fn(&Scores) -> f64| {
            MeanStd::of(&each.iter().map(|one| figure(&one.scores)).collect::<Vec<_>>())
        };
        let mut confusion = Confusion::new(CLASSES.len());
        each.iter().for_each(|one| confusion.merge(&one.confusion));
        Some(Self {
            windows: each.iter().map(|one| one.windows).min()?,
            trainings: each.len(),
            accuracy: spread(|scores| scores.accuracy)?,
            precision: spread(|scores| scores.precision)?,
            recall: spread(|scores| scores.recall)?,
            f1: spread(|scores| scores.f1)?,
            confusion,
            each,
        })
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
