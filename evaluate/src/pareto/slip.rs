//! The study of the direction of slip: frame networks over windows of readings.
//!
//! Input: the windows of a data set. Output: a [`Measurement`] of each setting. Some windows,
//! evenly chosen, are timed in turns with the exact network. The outputs for all windows of unseen
//! objects are compared with the exact outputs and with the labels.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameEngine, FrameNetwork, FrameNetworkParts};
use meissner_models::systems::slip::ObjectSet;
use meissner_run::fingerprint::Fingerprint;
use meissner_run::model::LayerCost;

use super::measurement::{Differences, Lap, Measurement, evenly, take_turns, timed_label};
use super::report::DataReport;
use super::settings::{FrameSetting, Thinning, common, has_pixels_to_keep, notes};
use super::task_error::TaskError;
use super::{NetworkReport, NetworkStudy, Options, Study};
use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::metrics::predicted;
use crate::slip::{Slip, SlipData, Windows};
use crate::trainings::{EvaluatedNetwork, Request, candidates};
use crate::workers::Workers;

/// Default number of timed windows.
const WINDOWS: usize = 400;
const TURN: usize = 10;

/// The study of slip on the data set in `folder`: errors on unseen objects, without folds.
///
/// # Errors
/// The data set or a network cannot be read, a network has only folds, or all objects are seen.
pub fn slip<'a>(
    folder: &Path,
    request: Request<'_>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>> {
    let (candidates, mut remarks) = candidates::<Slip>(request)?;
    let data = Arc::new(SlipData::read(folder)?);
    remarks.splice(0..0, data.notes.iter().cloned());
    let asked = options.timed.unwrap_or(WINDOWS);
    let (mut networks, mut size, mut timed) = (Vec::new(), 0, 0);
    for EvaluatedNetwork { description, trainings } in candidates {
        let name = description.name().to_owned();
        let whole: Vec<_> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
        let folds = trainings.len() - whole.len();
        if folds > 0 {
            remarks.push(format!(
                "{name}: {folds} folds are passed over, unseen objects are for whole trainings"
            ));
        }
        let Some(first) = whole.first() else {
            let expected = format!("a whole training of {name}");
            return Err(EvaluateError::request(RequestPart::Trainings, expected, "folds alone"));
        };
        let label = timed_label(whole.len(), &first.label);
        let windows = Windows::cut(&data, &description)?;
        let set = |window: usize| data.objects[windows.cases.recording(window)].set;
        let windows_of_unseen = (0..windows.cases.len()).filter(|&window| set(window) != ObjectSet::Basic);
        let unseen: Vec<usize> = windows_of_unseen.collect();
        if unseen.is_empty() {
            let (expected, found) = ("recordings of unseen objects", "Basic alone");
            return Err(EvaluateError::request(RequestPart::Data, expected, found));
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        let mut parts = Vec::new();
        for training in &whole {
            fingerprint.weights(&training.weights);
            parts.push(description.network_parts(&training.weights).map_err(weights_error(&training.label))?);
        }
        remarks.extend(notes(&name, &parts[0]));
        let network = FramesNetwork {
            trainings: parts,
            costs: description.layers().iter().map(LayerCost::new).collect(),
            data: Arc::clone(&data),
            timed: evenly(&unseen, asked.min(unseen.len())),
            windows,
            unseen,
            repeats: options.repeats,
            workers,
            exact: OnceCell::new(),
        };
        (size, timed) = (network.windows.cases.len(), network.timed.len());
        networks.push(network.study(NetworkReport::new(name, label, fingerprint)));
    }
    let mut fingerprint = Fingerprint::default();
    for (recording, object) in data.recordings.iter().zip(&data.objects) {
        fingerprint.text(&recording.name);
        fingerprint.text(&format!("{} {}", recording.class, object.name));
        recording.readings.iter().for_each(|reading| fingerprint.floats(&reading.values));
    }
    let report = DataReport {
        name: folder.display().to_string(),
        recordings: data.recordings.len() as u64,
        size: size as u64,
        timed: timed as u64,
        fingerprint: fingerprint.finish(),
    };
    Ok(Study { system: "slip", unit: "window", asked, data: report, networks, notes: remarks })
}

/// Outputs of each training for the unseen windows.
type Outputs = Vec<Vec<Vec<f32>>>;

/// A frame network with its trainings and its data.
struct FramesNetwork<'a> {
    /// Each training; the first one is timed.
    trainings: Vec<FrameNetworkParts>,
    costs: Vec<LayerCost>,
    data: Arc<SlipData>,
    windows: Windows,
    /// The windows of unseen objects.
    unseen: Vec<usize>,
    /// The timed windows among them.
    timed: Vec<usize>,
    repeats: u32,
    workers: &'a Workers,
    /// Outputs of the exact network, once they are computed.
    exact: OnceCell<Outputs>,
}

pub(super) fn settings(parts: &FrameNetworkParts, steps: usize) -> Vec<FrameSetting> {
    let mut settings = common(parts, &[1e-3, 1e-2, 3e-2, 1e-1]);
    let without = |left_out| Thinning::Last { kept: steps - left_out, of: steps };
    let shorter = |left_out| FrameSetting { thinning: without(left_out), ..FrameSetting::default() };
    settings.extend((1..steps.min(4)).map(shorter));
    if has_pixels_to_keep(parts) {
        let both = |left_out| FrameSetting { tolerance: Some(1e-2), ..shorter(left_out) };
        settings.extend((1..steps.min(3)).map(both));
    }
    settings
}

/// Number of readings that the network sees, of the `whole` number in a window.
fn steps(setting: FrameSetting, whole: usize) -> usize {
    if let Thinning::Last { kept, .. } = setting.thinning { kept } else { whole }
}

fn engine(setting: FrameSetting, parts: &FrameNetworkParts) -> Result<FrameEngine, EngineError> {
    FrameEngine::with_options(FrameNetwork::new(parts.clone(), setting.convolution)?, setting.options())
}

/// An engine that is timed over the last `steps` readings of windows.
struct Run {
    engine: FrameEngine,
    steps: usize,
}

impl<'a> FramesNetwork<'a> {
    fn study(self, report: NetworkReport) -> NetworkStudy<'a> {
        let all = settings(&self.trainings[0], self.windows.steps);
        let settings = FrameSetting::names(&all);
        let measure = Box::new(move |setting: usize| self.measure(all[setting]));
        NetworkStudy { report, settings, measure }
    }

    fn measure(&self, setting: FrameSetting) -> Result<Measurement> {
        let whole = self.windows.steps;
        let run = |setting: FrameSetting| {
            let engine = engine(setting, &self.trainings[0])?;
            Ok::<_, EngineError>(Run { engine, steps: steps(setting, whole) })
        };
        let (mut own, mut exact) = (run(setting)?, run(FrameSetting::default())?);
        let mut counters = own.engine.counters().clone();
        let timing = take_turns(
            (&mut exact, &mut own),
            (std::slice::from_ref(&self.timed), self.repeats, TURN),
            |_| Ok(()),
            |run, windows, lap| self.push(run, windows, lap),
            |_, _, own| counters.clone_from(own.engine.counters()),
        )?;
        let layers = counters.layers;
        let per_window = |count: u64| count as f64 / self.timed.len() as f64;
        let products = self.costs.iter().zip(&layers).map(|(cost, layer)| cost.of(layer)).sum();
        let outputs = self.outputs(setting)?;
        if self.exact.get().is_none() {
            // The cell is still empty.
            let _ = self.exact.set(self.outputs(FrameSetting::default())?);
        }
        Ok(Measurement {
            timed: self.timed.len() as u64,
            entered: own.steps as f64 / whole as f64,
            timing,
            rows: per_window(layers.iter().map(|layer| layer.computed).sum()),
            multiply_adds: per_window(products),
            numerical: self.differences(self.exact.get().unwrap_or(&outputs), &outputs).finish(),
            task: self.errors(&outputs),
        })
    }

    /// Measures the times of `windows`, each from a reset on; the push of a window is that of all
    /// its frames.
    fn push(&self, run: &mut Run, windows: &[usize], lap: &mut Lap) -> Result<(), EngineError> {
        for &window in windows {
            let start = Instant::now();
            run.engine.reset();
            for frame in self.windows.frames(window, run.steps) {
                run.engine.push(frame)?;
            }
            let pushed = start.elapsed();
            run.engine.predict()?;
            lap.push((pushed, start.elapsed()));
        }
        Ok(())
    }

    fn outputs(&self, setting: FrameSetting) -> Result<Outputs> {
        let steps = steps(setting, self.windows.steps);
        let windows = &self.windows;
        let logits = |engine: &mut FrameEngine, &window: &usize| {
            windows.logits(engine, window, steps).map(|(logits, _)| logits)
        };
        let of = |parts| self.workers.for_each(&engine(setting, parts)?, &self.unseen, logits);
        self.trainings.iter().map(of).collect()
    }

    /// Errors on all unseen objects, then on each set.
    fn errors(&self, outputs: &Outputs) -> Vec<TaskError> {
        let unseen = ObjectSet::ALL.into_iter().filter(|set| *set != ObjectSet::Basic);
        let sets = std::iter::once(None).chain(unseen.map(Some));
        let error = |set: Option<ObjectSet>| {
            let counts: Vec<(u64, u64)> = outputs.iter().map(|outputs| self.wrong(outputs, set)).collect();
            TaskError::new(set.map_or("unseen", ObjectSet::name), &counts)
        };
        sets.filter_map(error).collect()
    }

    /// Numbers of wrong and of all answers for the objects of `set`, or of all sets.
    fn wrong(&self, outputs: &[Vec<f32>], set: Option<ObjectSet>) -> (u64, u64) {
        let (mut wrong, mut all) = (0, 0);
        for (&window, values) in self.unseen.iter().zip(outputs) {
            let recording = self.windows.cases.recording(window);
            if set.is_none_or(|set| self.data.objects[recording].set == set) {
                wrong += u64::from(predicted(values) != self.data.recordings[recording].class);
                all += 1;
            }
        }
        (wrong, all)
    }

    /// The differences of all trainings; a stream is a recording.
    fn differences(&self, exact: &Outputs, found: &Outputs) -> Differences {
        let mut differences = Differences::default();
        for (exact, found) in exact.iter().zip(found) {
            for ((&window, exact), found) in self.unseen.iter().zip(exact).zip(found) {
                let stream = self.windows.cases.of(self.windows.cases.recording(window));
                differences.add((window - stream.start, stream.len()), exact, found);
            }
        }
        differences
    }
}
