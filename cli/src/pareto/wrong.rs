//! How often a network over events with a setting names the wrong class.
//!
//! Enters: recordings with their classes, and the weights that have not seen them. Leaves: the share of recordings whose
//! class at the end is wrong. Recordings are shared by threads, each with an engine of its own, and every recording begins
//! with a reset: neither the number of threads nor the order reaches a count. Where a prediction depends on when others
//! were read (tolerance, stale readout), one is read after each event, as in timing; else only the last.

use std::sync::Arc;

use meissner_engine::{EngineError, Event, Options, Outcome, Sensor};
use meissner_models::metrics::largest;
use meissner_models::{Description, Weights};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::measurement::Task;
use super::settings::Setting;
use crate::error::CliError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::filtered::FilteredEngine;

/// A network's trainings and what each is judged on.
pub(super) struct Judge<'a> {
    /// What is judged, for reports.
    pub(super) of: &'static str,
    pub(super) description: Description,
    pub(super) sensor: Sensor,
    /// Trainings of a seed together, such as the folds of a cross-validation.
    pub(super) seeds: Vec<Vec<Judged<'a>>>,
    pub(super) pool: &'a ThreadPool,
}

/// Weights, and recordings that they have not seen.
pub(super) struct Judged<'a> {
    pub(super) weights: Weights,
    /// For messages.
    pub(super) label: String,
    /// Events and class of each.
    pub(super) recordings: Vec<(&'a [Event], usize)>,
}

impl Judge<'_> {
    /// The wrong answers with `setting`.
    pub(super) fn task(&self, setting: &Setting) -> Result<Option<Task>, CliError> {
        let mut counts = Vec::new();
        for seed in &self.seeds {
            let (mut wrong, mut all) = (0, 0);
            for judged in seed {
                wrong += self.wrong(judged, setting)?;
                all += judged.recordings.len() as u64;
            }
            counts.push((wrong, all));
        }
        Ok(Task::new(self.of, &counts))
    }

    fn wrong(&self, judged: &Judged<'_>, setting: &Setting) -> Result<u64, CliError> {
        let failed = |source| PipelineError::Weights {
            weights: judged.label.as_str().into(),
            source: Box::new(source),
        };
        let network = self.description.network(&judged.weights).map_err(failed)?;
        let network = Arc::new(setting.network(&network)?);
        let front = FilteredEngine::new(network, self.sensor, &setting.approximations, Options::default())?;
        let each = setting.reads_matter();
        let answers = || {
            let recordings = judged.recordings.par_iter();
            let answer = |front: &mut FilteredEngine, &(events, truth): &(&[Event], usize)| {
                answer(front, events, each).map(|class| class != truth)
            };
            recordings.map_init(|| front.clone(), answer).collect::<Vec<_>>()
        };
        // The first error in the order of the recordings, not of time.
        self.pool.install(answers).into_iter().try_fold(0, |wrong, answer| Ok(wrong + u64::from(answer?)))
    }
}

/// The class at the end of `events`, of which a prediction is read after each or only at the end.
fn answer(front: &mut FilteredEngine, events: &[Event], each: bool) -> Result<usize, EngineError> {
    front.reset();
    for &event in events {
        let (passes, _) = front.admit(event);
        if passes && front.readout.push(event) == Outcome::Accepted && each {
            front.readout.predict()?;
        }
    }
    let values = front.readout.predict()?.values;
    Ok(largest(values).expect("the engine refuses predictions that are not numbers"))
}
