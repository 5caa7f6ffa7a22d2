//! Contact area and normal force from pictures of a gel: the data, and how networks are judged.
//!
//! Input: files of pictures with the force on each pixel or a circle of contact, and networks.
//! Output: a [`Report`] and the maps of force. Each press begins with a reset, so that the number
//! of threads changes no bit, except in measured times.

mod baselines;
pub(crate) mod figures;
pub(crate) mod pictures;
mod stereo;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use meissner_engine::frames::{Convolution, FrameOptions};
use meissner_models::{FrameDescription, FrameSource, TensorFile};
use meissner_run::model::{FrameModel, LayerCost, describe_frames};
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::run::ContactPredictor;
use serde::Serialize;

use crate::error::{EvaluateError, RequestPart, Result};
use crate::judge::{Judge, JudgedTrial, NetworkReport, judge};
use crate::trainings::{EvaluatedNetwork, Evaluation, Request, Task, Training, candidates, seed_name};
use crate::trials::{Cases, Trial};
use crate::workers::Workers;
pub use baselines::BaselineFigures;
pub use figures::{Figures, KindFigures};
use figures::{Outcome, PressOptions};
pub use pictures::Source;
use pictures::{Press, Set};
use stereo::Stereo;

/// The task of contact area and normal force.
#[derive(Clone, Copy, Debug)]
pub struct Area;

impl Task for Area {
    type Description = FrameDescription;
    const PREFIX: &'static str = "canf";

    fn describe(network: &str) -> Result<(FrameDescription, bool)> {
        let (description, shipped) = describe_frames(network)?;
        if !matches!(description.source(), FrameSource::Picture(_)) {
            let found = format!("{network}, which reads other frames");
            return Err(EvaluateError::request(RequestPart::Networks, "networks over pictures", found));
        }
        Ok((description, shipped))
    }

    fn name(description: &FrameDescription) -> &str {
        description.name()
    }
}

/// The networks to be judged, and how they run.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Networks, at least one, and trainings.
    pub request: Request<'a>,
    /// Files of pictures.
    pub data: &'a [PathBuf],
    /// The work that is skipped between the pictures of a press.
    pub frames: FrameOptions,
}

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: Vec<DataReport>,
    /// Remarks about the trainings, for people.
    pub notes: Vec<String>,
    pub networks: Vec<NetworkReport<AreaFigures>>,
}

/// A file of pictures, with the figures that need no network.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub file: String,
    pub source: Source,
    pub presses: usize,
    pub pictures: usize,
    /// Least and greatest total force in N; `None` where the file has no forces.
    pub force_n: Option<[f64; 2]>,
    /// Where a picture differs from the picture at rest, in grey levels.
    pub difference: BaselineFigures,
    /// Where the depth by photometric stereo exceeds a threshold, in mm, with a force in proportion
    /// to the depth there.
    pub stereo: BaselineFigures,
}

/// Figures of a network.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct AreaFigures {
    pub trainings: Vec<TrainingReport>,
}

/// Figures of one training.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct TrainingReport {
    pub seed: Option<i64>,
    pub files: Vec<String>,
    /// Figures of each file of pictures.
    pub sets: Vec<Figures>,
}

/// Judges the networks of `options`; `done` gets each training's label and the time so far.
///
/// # Errors
/// A file or a network cannot be read, or pictures do not fit. Reported before a network runs.
pub fn evaluate(
    options: &Options<'_>,
    workers: &Workers,
    done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>> {
    let (candidates, notes) = candidates::<Area>(options.request)?;
    let sets = options.data.iter().map(|path| Set::read(path)).collect::<Result<Vec<_>, _>>()?;
    let of_area = OfArea { sets: &sets, frames: options.frames };
    let judged = judge(&of_area, &candidates, TensorFile::new(BTreeMap::new()), workers, done)?;
    let stereo = Stereo::calibrated(workers)?;
    let data = sets.iter().map(|set| data_report(set, &stereo, workers)).collect::<Result<Vec<_>, _>>()?;
    let names = options.data.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let header = Header::of_many("eval area", InputCard::other(&names, "pictures"));
    Ok(judged.evaluation(|networks| Report { header, data, notes, networks }))
}

/// Judges networks on files of pictures. A case is a press, file after file.
struct OfArea<'a> {
    sets: &'a [Set],
    frames: FrameOptions,
}

impl OfArea<'_> {
    fn presses(&self) -> impl Iterator<Item = &Press> {
        self.sets.iter().flat_map(|set| &set.presses)
    }
}

impl Judge for OfArea<'_> {
    type Task = Area;
    type Plan = ();
    type Engine = Arc<(FrameModel, Vec<LayerCost>)>;
    type Outcome = Outcome;
    /// Figures of each file of pictures.
    type Figures = Vec<Figures>;
    type Network = AreaFigures;

    fn plan(&self, candidate: &EvaluatedNetwork<FrameDescription>) -> Result<((), Vec<Trial>)> {
        let mut cases = Cases::default();
        self.presses().enumerate().for_each(|(press, _)| cases.push(&press.to_string(), 1));
        let all: Vec<usize> = (0..cases.len()).collect();
        Ok(((), cases.trials(&candidate.trainings, &all, |_| Ok(()))?))
    }

    fn engine(&self, description: &FrameDescription, (): &(), training: &Training) -> Result<Self::Engine> {
        let model = model(description, training, Convolution::Direct)?;
        let size = ContactPredictor::new(&model, self.frames)?.size();
        self.sets.iter().try_for_each(|set| set.check(&model.name, size))?;
        let costs = model.description.layers().iter().map(LayerCost::new).collect();
        Ok(Arc::new((model, costs)))
    }

    fn outcome(&self, (): &(), engine: &mut Self::Engine, case: usize) -> Result<Outcome> {
        let how = PressOptions { options: self.frames, every: 1 };
        let press = self.presses().nth(case).expect("a case is a press");
        Outcome::of(&engine.0, how, &engine.1, press)
    }

    /// The outputs are one tensor of maps for each file.
    fn figures(&self, (): &(), judged: JudgedTrial<'_, Outcome>) -> Vec<Figures> {
        let JudgedTrial { network, trial, mut outcomes, logits } = judged;
        let mut figures = Vec::new();
        for (index, set) in self.sets.iter().enumerate() {
            let outcomes: Vec<_> = outcomes.drain(..set.presses.len()).map(|(_, outcome)| outcome).collect();
            let maps: Vec<f32> = outcomes.iter().flat_map(|outcome| outcome.maps.iter().copied()).collect();
            let name = format!("{network}.{}.{index}", seed_name(trial.seed));
            logits.f32(&name, &[set.pictures(), set.size.height, set.size.width], &maps);
            figures.push(Figures::new(&outcomes.iter().collect::<Vec<_>>()));
        }
        figures
    }

    fn network(&self, (): (), _: &mut ModelCard, judged: Vec<(Trial, Vec<Figures>)>) -> AreaFigures {
        let training =
            |(trial, sets): (Trial, _)| TrainingReport { seed: trial.seed, files: trial.files(), sets };
        AreaFigures { trainings: judged.into_iter().map(training).collect() }
    }

    /// Each of two baselines runs on each press once, and one of them on its own presses twice.
    fn more_cases(&self) -> usize {
        2 * (self.presses().count() + Stereo::PRESSES)
    }
}

pub(crate) fn model(
    description: &FrameDescription,
    training: &Training,
    convolution: Convolution,
) -> Result<FrameModel> {
    let weights = (&training.weights, training.label.clone());
    Ok(FrameModel::of(description, weights, convolution, false)?)
}

fn data_report(set: &Set, stereo: &Stereo, workers: &Workers) -> Result<DataReport> {
    let forces =
        || set.presses.iter().flat_map(|press| &press.pictures).filter_map(pictures::Labelled::force_n);
    let ends = forces().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], n| [low.min(n), high.max(n)]);
    Ok(DataReport {
        file: set.name.clone(),
        source: set.source,
        presses: set.presses.len(),
        pictures: set.pictures(),
        force_n: (ends[0] <= ends[1]).then_some(ends),
        difference: baselines::difference(set, workers)?,
        stereo: stereo.figures(set, workers)?,
    })
}

#[cfg(test)]
pub(crate) mod tests;
