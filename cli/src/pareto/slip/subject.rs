//! A frame network over windows of readings with each of its settings.
//!
//! Enters: the windows of a data set. Leaves: times of some windows, evenly chosen, by turns with the exact network; the
//! outputs for all windows of objects that training has not seen, against the exact outputs and against the labels.

use std::cell::OnceCell;
use std::time::Instant;

use meissner_engine::frames::{FrameEngine, FrameNetworkParts};
use meissner_models::metrics::largest;
use meissner_models::systems::slip::{CLASSES, ObjectSet};
use rayon::ThreadPool;

use super::settings::Setting;
use crate::error::CliError;
use crate::pareto::measurement::{Measurement, Subject, Task};
use crate::pareto::numerical::Differences;
use crate::pareto::timing::{Lap, Timing};
use crate::slip::{SlipData, Windows};
use meissner_pipeline::layer_cost::LayerCost;

/// Windows from one turn to the next.
const TURN: usize = 10;

/// A frame network, its trainings, and what it is measured on.
pub(super) struct SlipSubject<'a> {
    pub(super) name: String,
    /// Where the weights come from.
    pub(super) weights: String,
    pub(super) fingerprint: String,
    /// Of each training; the first one is timed.
    pub(super) trainings: Vec<FrameNetworkParts>,
    pub(super) costs: Vec<LayerCost>,
    pub(super) settings: Vec<Setting>,
    pub(super) data: &'a SlipData,
    pub(super) windows: Windows,
    /// Windows of each recording of an object that training has not seen.
    pub(super) unseen: Vec<Vec<usize>>,
    /// Of these (recording, window), those that are timed.
    pub(super) timed: Vec<(usize, usize)>,
    pub(super) repeats: u32,
    pub(super) pool: &'a ThreadPool,
    /// Exact outputs of each training for the unseen windows of each recording, once they are known.
    pub(super) exact: OnceCell<Vec<Vec<Vec<f32>>>>,
}

impl Subject for SlipSubject<'_> {
    fn network(&self) -> &str {
        &self.name
    }

    fn weights(&self) -> &str {
        &self.weights
    }

    fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    fn settings(&self) -> Vec<String> {
        self.settings.iter().map(|setting| setting.name(self.windows.steps())).collect()
    }

    fn measure(&self, setting: usize) -> Result<Measurement, CliError> {
        let setting = self.settings[setting];
        let mut own = setting.engine(self.trainings[0].clone())?;
        let mut exact = Setting::default().engine(self.trainings[0].clone())?;
        let mut counters = None;
        let mut laps = Vec::new();
        for _ in 0..self.repeats {
            laps.push(self.take_turns(&mut own, setting, &mut exact)?);
            counters.get_or_insert_with(|| own.counters().clone());
        }
        let layers = counters.expect("there is at least one repeat").layers;
        let per_window = |count: u64| count as f64 / self.timed.len() as f64;
        let products = self.costs.iter().zip(&layers).map(|(cost, layer)| cost.of(layer)).sum();
        let outputs = self.outputs(setting)?;
        let exact = self.exact()?;
        Ok(Measurement {
            timed: self.timed.len() as u64,
            entered: setting.steps(self.windows.steps()) as f64 / self.windows.steps() as f64,
            timing: Timing::of(&laps),
            rows: per_window(layers.iter().map(|layer| layer.computed).sum()),
            multiply_adds: per_window(products),
            numerical: differences(exact, &outputs).finish(),
            task: self.tasks(&outputs),
        })
    }
}

impl SlipSubject<'_> {
    /// Both over the windows that are timed.
    fn take_turns(
        &self,
        own: &mut FrameEngine,
        setting: Setting,
        exact: &mut FrameEngine,
    ) -> Result<(Lap, Lap), CliError> {
        let (mut of_own, mut of_exact) = (Lap::default(), Lap::default());
        let whole = self.windows.steps();
        let steps = setting.steps(whole);
        for (turn, windows) in self.timed.chunks(TURN).enumerate() {
            // Neither always runs on what the other left in the caches.
            if turn % 2 == 0 {
                self.run(exact, windows, whole, &mut of_exact)?;
                self.run(own, windows, steps, &mut of_own)?;
            } else {
                self.run(own, windows, steps, &mut of_own)?;
                self.run(exact, windows, whole, &mut of_exact)?;
            }
        }
        Ok((of_own, of_exact))
    }

    /// A window's push is that of all its frames, from the reset on.
    fn run(
        &self,
        engine: &mut FrameEngine,
        windows: &[(usize, usize)],
        steps: usize,
        lap: &mut Lap,
    ) -> Result<(), CliError> {
        for &(recording, window) in windows {
            let start = Instant::now();
            engine.reset();
            for frame in self.windows.frames(recording, window, steps) {
                engine.push(frame)?;
            }
            let pushed = start.elapsed();
            engine.predict()?;
            lap.record(pushed, start.elapsed());
        }
        Ok(())
    }

    /// Outputs of each training for the unseen windows of each recording.
    fn outputs(&self, setting: Setting) -> Result<Vec<Vec<Vec<f32>>>, CliError> {
        let steps = setting.steps(self.windows.steps());
        let of = |parts: &FrameNetworkParts| {
            let engine = setting.engine(parts.clone())?;
            Ok(self.windows.logits(self.pool, &engine, &self.unseen, steps)?)
        };
        self.trainings.iter().map(of).collect()
    }

    fn exact(&self) -> Result<&Vec<Vec<Vec<f32>>>, CliError> {
        if let Some(exact) = self.exact.get() {
            return Ok(exact);
        }
        let exact = self.outputs(Setting::default())?;
        Ok(self.exact.get_or_init(|| exact))
    }

    /// Wrong answers over all unseen objects, then for each set.
    fn tasks(&self, outputs: &[Vec<Vec<f32>>]) -> Vec<Task> {
        let unseen = ObjectSet::ALL.into_iter().filter(|set| *set != ObjectSet::Basic);
        let sets = std::iter::once(None).chain(unseen.map(Some));
        let task = |set: Option<ObjectSet>| {
            let counts: Vec<(u64, u64)> = outputs.iter().map(|outputs| self.wrong(outputs, set)).collect();
            Task::new(set.map_or("unseen", ObjectSet::name), &counts)
        };
        sets.filter_map(task).collect()
    }

    /// Wrong and all answers over the objects of `set`, or of all sets.
    fn wrong(&self, outputs: &[Vec<f32>], set: Option<ObjectSet>) -> (u64, u64) {
        let (mut wrong, mut all) = (0, 0);
        for (recording, outputs) in outputs.iter().enumerate() {
            if set.is_some_and(|set| self.data.objects[recording].set != set) {
                continue;
            }
            for values in outputs.chunks_exact(CLASSES.len()) {
                let class = largest(values).expect("the engine refuses predictions that are not numbers");
                wrong += u64::from(class != self.data.recordings[recording].class);
                all += 1;
            }
        }
        (wrong, all)
    }
}

/// Of all trainings; a stream is a recording.
fn differences(exact: &[Vec<Vec<f32>>], found: &[Vec<Vec<f32>>]) -> Differences {
    let mut differences = Differences::default();
    let recordings = exact.iter().flatten().zip(found.iter().flatten());
    for (exact, found) in recordings {
        let windows = exact.len() / CLASSES.len();
        let pairs = exact.chunks_exact(CLASSES.len()).zip(found.chunks_exact(CLASSES.len()));
        for (window, (exact, found)) in pairs.enumerate() {
            differences.add((window, windows), exact, found);
        }
    }
    differences
}
