//! All results, as they are written as JSON.

use meissner_models::metrics::{Confusion, MeanStd};
use meissner_models::systems::digits::CLASSES;
use serde::Serialize;

use meissner_pipeline::lost::Warning;
use meissner_pipeline::provenance::{Header, ModelCard};

/// Everything.
#[derive(Serialize)]
pub(super) struct Report {
    /// What was judged on what; each of `networks` says what it is.
    pub(super) header: Header,
    pub(super) data: DataReport,
    pub(super) classes: [&'static str; CLASSES.len()],
    pub(super) mode: &'static str,
    pub(super) every_us: i64,
    /// The times at which predictions are read, from the first event of a recording on; the last is at or behind the end
    /// of every recording.
    pub(super) times_us: Vec<i64>,
    pub(super) networks: Vec<NetworkReport>,
}

/// What networks are judged on.
#[derive(Serialize)]
pub(super) struct DataReport {
    pub(super) folder: String,
    pub(super) recordings: usize,
    pub(super) train: usize,
    pub(super) test: usize,
    pub(super) events: u64,
    /// What a person should know about the data and the trainings.
    pub(super) notes: Vec<String>,
    /// What networks lose of the recordings, where that is much.
    pub(super) warnings: Vec<Warning>,
}

/// A network's results.
#[derive(Serialize)]
pub(super) struct NetworkReport {
    #[serde(flatten)]
    pub(super) card: ModelCard,
    #[serde(skip)]
    pub(super) network: String,
    /// Where its weights come from.
    #[serde(skip)]
    pub(super) weights: String,
    /// Every `stride`-th event is taken.
    pub(super) stride: usize,
    /// Whole trainings on the split test.
    pub(super) test: Option<Judged>,
    /// Folds on what they held out.
    pub(super) cross_validation: Option<Judged>,
}

/// Figures of several trainings on the same recordings.
#[derive(Serialize)]
pub(super) struct Judged {
    /// Recordings that each is judged on.
    pub(super) recordings: u64,
    pub(super) trainings: usize,
    pub(super) accuracy: MeanStd,
    /// Means of the bounds.
    pub(super) interval_95: (f64, f64),
    /// The time by which half of the answers have settled, over all trainings.
    pub(super) settled_us: Option<i64>,
    /// Summed over the trainings.
    pub(super) confusion: Confusion,
    /// At each time.
    pub(super) accuracy_at: Vec<MeanStd>,
    pub(super) interval_95_at: Vec<(f64, f64)>,
    pub(super) each: Vec<One>,
}

/// Figures of one training, or of the folds of one seed.
#[derive(Serialize)]
pub(super) struct One {
    pub(super) seed: Option<i64>,
    /// The files of its weights; none for shipped ones.
    pub(super) files: Vec<String>,
    pub(super) recordings: u64,
    pub(super) accuracy: f64,
    pub(super) interval_95: (f64, f64),
    pub(super) settled_us: Option<i64>,
    pub(super) confusion: Confusion,
    pub(super) accuracy_at: Vec<f64>,
    pub(super) interval_95_at: Vec<(f64, f64)>,
    /// When the answer for each recording settled, where it did.
    #[serde(skip)]
    pub(super) settled: Vec<Option<i64>>,
}

/// What a network was judged on.
#[derive(Clone, Copy)]
pub(super) enum Way {
    Test,
    CrossValidation,
}

impl Way {
    pub(super) const ALL: [Self; 2] = [Self::Test, Self::CrossValidation];

    /// Its name for people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Test => "test split",
            Self::CrossValidation => "cross-validation",
        }
    }
}

impl NetworkReport {
    /// The results of this way of judging, where there are any.
    pub(super) fn judged(&self, way: Way) -> Option<&Judged> {
        match way {
            Way::Test => self.test.as_ref(),
            Way::CrossValidation => self.cross_validation.as_ref(),
        }
    }
}
