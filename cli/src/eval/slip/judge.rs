//! A network's trainings against the labels.
//!
//! Enters: the data set, a network with its trainings. Leaves: its figures, and the outputs of whole trainings. A whole
//! training is judged on the objects of each set; folds of a cross-validation on what they held out, those of one scheme
//! and seed together.

use std::collections::BTreeMap;
use std::path::Path;

use meissner_models::metrics::{Confusion, largest};
use meissner_models::systems::slip::{CLASSES, ObjectSet};
use meissner_models::{AnyDescription, ModelError};
use rayon::ThreadPool;
use serde_json::Value;

use super::report::{Judged, NetworkReport, One, SetReport, ValidationReport};
use crate::error::CliError;
use crate::slip::{Candidate, HeldOut, Scheme, SlipData, Training, Windows, engine};
use crate::trainings::TrainingError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::card;
use meissner_pipeline::text::grouped;

/// Judges networks on one data set.
pub(super) struct Judge<'a> {
    pub(super) data: &'a SlipData,
    pub(super) pool: &'a ThreadPool,
}

/// What a network is worth.
pub(super) struct Judgement {
    pub(super) report: NetworkReport,
    /// Name and outputs (windows, 7) of each whole training.
    pub(super) logits: Vec<(String, Vec<f32>)>,
    /// What a person should know about it.
    pub(super) notes: Vec<String>,
}

/// Figures as they come.
#[derive(Default)]
struct Tally<'a> {
    sets: BTreeMap<ObjectSet, Vec<One>>,
    folds: BTreeMap<(Scheme, Option<i64>), Folds<'a>>,
    logits: Vec<(String, Vec<f32>)>,
}

/// The folds of a scheme and a seed.
struct Folds<'a> {
    confusion: Confusion,
    files: Vec<String>,
    /// Of each window of each recording, the fold that held it out.
    owners: Vec<Vec<Option<&'a Path>>>,
}

impl Judge<'_> {
    /// Judges one network, and calls `done` after each training.
    pub(super) fn judge(
        &self,
        candidate: &Candidate,
        mut done: impl FnMut(&Training),
    ) -> Result<Judgement, CliError> {
        let Candidate { description, trainings } = candidate;
        let windows = Windows::cut(self.data, description)?;
        let mut tally = Tally::default();
        for training in trainings {
            let engine = engine(description, &training.weights, &training.label)?;
            let outputs = |chosen: &[Vec<usize>]| {
                windows.logits(self.pool, &engine, chosen, windows.steps()).map_err(|source| {
                    PipelineError::Weights {
                        weights: training.label.as_str().into(),
                        source: Box::new(ModelError::Engine(source)),
                    }
                })
            };
            match &training.held_out {
                None => self.whole(&mut tally, training, &outputs(&windows.all())?),
                Some(held_out) => {
                    let failed = |source| CliError::Training { path: training.path.clone(), source };
                    let chosen = self.held_out(held_out, &windows).map_err(failed)?;
                    let folds = tally
                        .folds
                        .entry((held_out.scheme(), training.seed))
                        .or_insert_with(|| Folds::new(&windows));
                    folds.own(&training.path, &chosen, self.data).map_err(failed)?;
                    folds.confusion.merge(&self.confusion(&outputs(&chosen)?, |_| true));
                    folds.files.extend(training.files());
                }
            }
            done(training);
        }
        let trained_on_basic = trainings.iter().any(|training| training.trained_on_basic);
        let sets = tally.sets.into_iter().filter_map(|(set, each)| {
            let trained_on = set == ObjectSet::Basic && trained_on_basic;
            Some(SetReport { set: set.name(), trained_on, judged: Judged::new(each)? })
        });
        let of_basic = self.windows_of(ObjectSet::Basic, &windows);
        let (cross_validation, notes) = validations(description.name(), tally.folds, of_basic);
        let preparation = description.preparation().and_then(|text| serde_json::from_str(&text).ok());
        let training =
            trainings.first().ok_or_else(|| CliError::NeedsTrainings(description.name().to_owned()))?;
        let described = AnyDescription::Frames(description.clone());
        let report = NetworkReport {
            card: card(&described, &training.weights, weights(trainings))?,
            network: description.name().to_owned(),
            preparation: preparation.unwrap_or(Value::Null),
            weights: weights(trainings),
            sets: sets.collect(),
            cross_validation,
        };
        Ok(Judgement { report, logits: tally.logits, notes })
    }

    /// A whole training with the `outputs` for each recording.
    fn whole(&self, tally: &mut Tally<'_>, training: &Training, outputs: &[Vec<f32>]) {
        for set in ObjectSet::ALL {
            let confusion = self.confusion(outputs, |index| self.data.objects[index].set == set);
            let one = One::new(training.seed, training.files(), confusion);
            tally.sets.entry(set).or_default().extend(one);
        }
        let name = format!("{}.{}", training.network, training.seed_name());
        tally.logits.push((name, outputs.concat()));
    }

    /// The windows of each recording that training did not see, in order.
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

    /// What `outputs` predict for each of the recordings that `count`.
    fn confusion(&self, outputs: &[Vec<f32>], count: impl Fn(usize) -> bool) -> Confusion {
        let mut confusion = Confusion::new(CLASSES.len());
        for (index, outputs) in outputs.iter().enumerate().filter(|(index, _)| count(*index)) {
            for values in outputs.chunks_exact(CLASSES.len()) {
                let class = largest(values).expect("the engine refuses predictions that are not numbers");
                confusion.add(self.data.recordings[index].class, class);
            }
        }
        confusion
    }

    fn windows_of(&self, set: ObjectSet, windows: &Windows) -> u64 {
        let counts = self.data.objects.iter().zip(&windows.counts);
        counts.filter(|(object, _)| object.set == set).map(|(_, &count)| count as u64).sum()
    }
}

impl<'a> Folds<'a> {
    /// None yet.
    fn new(windows: &Windows) -> Self {
        Self {
            confusion: Confusion::new(CLASSES.len()),
            files: Vec::new(),
            owners: windows.counts.iter().map(|&count| vec![None; count]).collect(),
        }
    }

    /// The fold in the file at `path` holds out the windows `chosen` of each recording, and no other did.
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

/// The figures of each scheme over its seeds, and a note where folds of a seed do not hold out all of Basic.
fn validations(
    network: &str,
    folds: BTreeMap<(Scheme, Option<i64>), Folds<'_>>,
    of_basic: u64,
) -> (Vec<ValidationReport>, Vec<String>) {
    let mut schemes: BTreeMap<Scheme, Vec<One>> = BTreeMap::new();
    let mut notes = Vec::new();
    for ((scheme, seed), Folds { confusion, files, .. }) in folds {
        let found = confusion.total();
        if found != of_basic {
            let seed = seed.unwrap_or_default();
            notes.push(format!(
                "{network}: the {} folds of seed {seed} hold out {} of the {} windows of Basic",
                files.len(),
                grouped(found),
                grouped(of_basic)
            ));
        }
        schemes.entry(scheme).or_default().extend(One::new(seed, files, confusion));
    }
    let reports = schemes
        .into_iter()
        .filter_map(|(scheme, each)| Some(ValidationReport { scheme, of_basic, judged: Judged::new(each)? }));
    (reports.collect(), notes)
}

/// Where the weights of a network come from.
fn weights(trainings: &[Training]) -> String {
    let folds = trainings.iter().filter(|training| training.held_out.is_some()).count();
    match trainings {
        [training] => training.label.clone(),
        _ => format!("{} trainings, {folds} folds of cross-validations", trainings.len() - folds),
    }
}
