//! Figures of one training, and of several trainings together.
//!
//! A kind of figures implements [`Figures`], which says how several trainings are summed up. The
//! rest of a report is the same for every kind of figures, of classes or of quantities.

use serde::Serialize;

use crate::trials::Trial;

/// Figures of one training.
pub trait Figures: Sized {
    /// Figures of several trainings together.
    type Mean;

    /// The figures of `each` training together; `None` for no trainings.
    fn mean(each: &[&Self]) -> Option<Self::Mean>;
}

/// Figures of several trainings on the same data.
#[derive(Serialize)]
pub struct Judged<F: Figures> {
    /// Number of trainings.
    pub trainings: usize,
    /// Figures of all trainings together.
    #[serde(flatten)]
    pub mean: F::Mean,
    /// The trainings.
    pub each: Vec<TrainingFigures<F>>,
}

/// Figures of one training, or of the folds of one seed together.
#[derive(Serialize)]
pub struct TrainingFigures<F> {
    /// Seed of the training, where the weights state it.
    pub seed: Option<i64>,
    /// Files of the weights; none for shipped ones.
    pub files: Vec<String>,
    /// The figures.
    #[serde(flatten)]
    pub figures: F,
}

impl<F: Figures> Judged<F> {
    /// The figures of `each` trial; `None` for no trials, and where a trial has no figures.
    pub(crate) fn new(each: impl IntoIterator<Item = (Trial, Option<F>)>) -> Option<Self> {
        let judged = |(trial, figures): (Trial, Option<F>)| {
            Some(TrainingFigures { seed: trial.seed, files: trial.files(), figures: figures? })
        };
        let each: Vec<TrainingFigures<F>> = each.into_iter().filter_map(judged).collect();
        let mean = F::mean(&each.iter().map(|one| &one.figures).collect::<Vec<_>>())?;
        Some(Self { trainings: each.len(), mean, each })
    }
}
