//! All results, as they are written as JSON.

use std::collections::BTreeMap;

use meissner_models::metrics::{Confusion, MeanStd, Scores};
use meissner_models::systems::slip::{CLASSES, ObjectSet, REFERENCES, Reference};
use serde::Serialize;
use serde_json::Value;

use crate::slip::{Scheme, SlipData};
use meissner_pipeline::provenance::{Header, ModelCard};

/// Everything.
#[derive(Serialize)]
pub(super) struct Report {
    /// What was judged on what; each of `networks` says what it is.
    pub(super) header: Header,
    pub(super) data: DataReport,
    pub(super) classes: [&'static str; CLASSES.len()],
    pub(super) networks: Vec<NetworkReport>,
    pub(super) references: Vec<ReferenceReport>,
}

/// What networks are judged on.
#[derive(Serialize)]
pub(super) struct DataReport {
    pub(super) folder: String,
    pub(super) recordings: usize,
    pub(super) readings: usize,
    /// What a person should know about the data and the trainings.
    pub(super) notes: Vec<String>,
}

/// A network's results.
#[derive(Serialize)]
pub(super) struct NetworkReport {
    #[serde(flatten)]
    pub(super) card: ModelCard,
    #[serde(skip)]
    pub(super) network: String,
    /// How its frames are made.
    pub(super) preparation: Value,
    /// Where its weights come from.
    #[serde(skip)]
    pub(super) weights: String,
    /// Of whole trainings, on each set that the data has.
    pub(super) sets: Vec<SetReport>,
    pub(super) cross_validation: Vec<ValidationReport>,
}

/// Whole trainings on one set.
#[derive(Serialize)]
pub(super) struct SetReport {
    pub(super) set: &'static str,
    pub(super) trained_on: bool,
    #[serde(flatten)]
    pub(super) judged: Judged,
}

/// The folds of a cross-validation.
#[derive(Serialize)]
pub(super) struct ValidationReport {
    pub(super) scheme: Scheme,
    /// Windows that Basic has.
    pub(super) of_basic: u64,
    #[serde(flatten)]
    pub(super) judged: Judged,
}

/// Figures of several trainings.
#[derive(Serialize)]
pub(super) struct Judged {
    /// The fewest windows that a training is judged on; equal for all but where folds are missing.
    pub(super) windows: u64,
    pub(super) trainings: usize,
    pub(super) accuracy: MeanStd,
    pub(super) precision: MeanStd,
    pub(super) recall: MeanStd,
    pub(super) f1: MeanStd,
    /// Summed over the trainings.
    pub(super) confusion: Confusion,
    pub(super) each: Vec<One>,
}

/// Figures of one training, or of the folds of one seed.
#[derive(Serialize)]
pub(super) struct One {
    pub(super) seed: Option<i64>,
    /// The files of its weights; none for shipped ones.
    pub(super) files: Vec<String>,
    pub(super) windows: u64,
    #[serde(flatten)]
    pub(super) scores: Scores,
    pub(super) confusion: Confusion,
}

/// What others reach.
#[derive(Serialize)]
pub(super) struct ReferenceReport {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    /// By set.
    pub(super) accuracy: BTreeMap<&'static str, f64>,
    #[serde(skip)]
    pub(super) reference: Reference,
}

impl DataReport {
    pub(super) fn new(folder: String, data: &SlipData, notes: Vec<String>) -> Self {
        let readings = data.recordings.iter().map(|recording| recording.readings.len()).sum();
        Self { folder, recordings: data.recordings.len(), readings, notes }
    }
}

impl ReferenceReport {
    /// All there are.
    pub(super) fn all() -> Vec<Self> {
        let report = |reference: Reference| {
            let of_set = |set: ObjectSet| reference.accuracy(set).map(|accuracy| (set.name(), accuracy));
            let accuracy = ObjectSet::ALL.into_iter().filter_map(of_set).collect();
            Self { name: reference.name, about: reference.about, accuracy, reference }
        };
        REFERENCES.into_iter().map(report).collect()
    }
}

impl One {
    /// The figures of `confusion`; `None` where it counts nothing.
    pub(super) fn new(seed: Option<i64>, files: Vec<String>, confusion: Confusion) -> Option<Self> {
        let scores = Scores::of(&confusion)?;
        Some(Self { seed, files, windows: confusion.total(), scores, confusion })
    }
}

impl Judged {
    /// The figures of `each` training together; `None` where there are none.
    pub(super) fn new(each: Vec<One>) -> Option<Self> {
        let of = |figure: fn(&Scores) -> f64| {
            MeanStd::of(&each.iter().map(|one| figure(&one.scores)).collect::<Vec<_>>())
        };
        let mut confusion = Confusion::new(CLASSES.len());
        each.iter().for_each(|one| confusion.merge(&one.confusion));
        Some(Self {
            windows: each.iter().map(|one| one.windows).min()?,
            trainings: each.len(),
            accuracy: of(|scores| scores.accuracy)?,
            precision: of(|scores| scores.precision)?,
            recall: of(|scores| scores.recall)?,
            f1: of(|scores| scores.f1)?,
            confusion,
            each,
        })
    }
}

impl NetworkReport {
    /// The results on `set`, where there are any.
    pub(super) fn on(&self, set: ObjectSet) -> Option<&SetReport> {
        self.sets.iter().find(|report| report.set == set.name())
    }

    /// The cross-validation of `scheme`, where there is one.
    pub(super) fn validated(&self, scheme: Scheme) -> Option<&ValidationReport> {
        self.cross_validation.iter().find(|report| report.scheme == scheme)
    }
}
