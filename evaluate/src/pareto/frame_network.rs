//! A frame network over windows of readings with each of its settings.
//!
//! Enters: the windows of a data set. Leaves: a [`Measurement`] of each setting. Some windows, evenly chosen, are timed in
//! turns with the exact network. The outputs for all windows of unseen objects are compared with the exact outputs and with
//! the labels.

use std::cell::OnceCell;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::EngineError;
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_kernels::WinogradTile;
use meissner_models::systems::slip::ObjectSet;
use meissner_pipeline::model::LayerCost;

use super::measurement::{Differences, EXACT, Lap, Measurement, TaskError, take_turns};
use super::{NetworkReport, NetworkStudy};
use crate::error::EvaluateError;
use crate::metrics::predicted;
use crate::slip::{SlipData, Windows};
use crate::workers::Workers;

/// Windows of a turn.
const TURN: usize = 10;

/// Outputs of each training for the unseen windows.
type Outputs = Vec<Vec<Vec<f32>>>;

/// A frame network with its trainings and its data.
pub(super) struct FramesNetwork<'a> {
    /// Each training; the first one is timed.
    pub(super) trainings: Vec<FrameNetworkParts>,
    pub(super) costs: Vec<LayerCost>,
    pub(super) data: Arc<SlipData>,
    pub(super) windows: Windows,
    /// The windows of unseen objects.
    pub(super) unseen: Vec<usize>,
    /// The timed windows among them.
    pub(super) timed: Vec<usize>,
    pub(super) repeats: u32,
    pub(super) workers: &'a Workers,
    /// Outputs of the exact network, once they are computed.
    pub(super) exact: OnceCell<Outputs>,
}

/// A frame network with some approximations.
#[derive(Clone, Copy, Debug, Default)]
struct Setting {
    convolution: Convolution,
    tolerance: Option<f32>,
    /// Readings of a window that are left out, from the first on.
    left_out: usize,
}

/// The settings of a network of `parts` over windows of `steps` readings.
fn settings(parts: &FrameNetworkParts, steps: usize) -> Vec<Setting> {
    let exact = Setting::default();
    let mut settings = vec![exact];
    if has_convolutions(parts) {
        let tiles = [WinogradTile::Two, WinogradTile::Four];
        settings.extend(tiles.map(|tile| Setting { convolution: Convolution::Winograd(tile), ..exact }));
    }
    let tolerant = has_pixels_to_keep(parts);
    if tolerant {
        let tolerances = [1e-3, 1e-2, 3e-2, 1e-1];
        settings.extend(tolerances.map(|tolerance| Setting { tolerance: Some(tolerance), ..exact }));
    }
    settings.extend((1..steps.min(4)).map(|left_out| Setting { left_out, ..exact }));
    if tolerant {
        let both = |left_out| Setting { left_out, tolerance: Some(1e-2), ..exact };
        settings.extend((1..steps.min(3)).map(both));
    }
    settings
}

/// Whether there are convolutions that Winograd's algorithm can compute.
pub(super) fn has_convolutions(parts: &FrameNetworkParts) -> bool {
    parts.layers.iter().any(|layer| matches!(layer.kind, FrameLayerKind::Conv { kernel: 3, .. }))
}

/// Whether a tolerance can keep any pixel: recurrent layers couple all pixels, and vectors have none.
pub(super) fn has_pixels_to_keep(parts: &FrameNetworkParts) -> bool {
    use FrameLayerKind as Kind;
    let keeps = |kind: &Kind| {
        matches!(kind, Kind::Conv { .. } | Kind::UpConv { .. } | Kind::MaxPool | Kind::AveragePool { .. })
    };
    parts.layers.iter().any(|layer| keeps(&layer.kind))
}

impl Setting {
    /// Its name for windows of `steps` readings.
    fn name(self, steps: usize) -> String {
        let mut names = Vec::new();
        match self.convolution {
            Convolution::Direct => {}
            Convolution::Winograd(WinogradTile::Two) => names.push("winograd 2x2".to_owned()),
            Convolution::Winograd(WinogradTile::Four) => names.push("winograd 4x4".to_owned()),
        }
        if self.left_out > 0 {
            names.push(format!("steps {} of {steps}", steps - self.left_out));
        }
        names.extend(self.tolerance.map(|tolerance| format!("tolerance {tolerance}")));
        if names.is_empty() { EXACT.to_owned() } else { names.join(" + ") }
    }

    /// An engine of a network of `parts`.
    fn engine(self, parts: &FrameNetworkParts) -> Result<FrameEngine, EngineError> {
        let skip = self.tolerance.map_or(Skip::Exact, Skip::Tolerance);
        let network = FrameNetwork::new(parts.clone(), self.convolution)?;
        FrameEngine::with_options(network, FrameOptions::new().with_skip(skip))
    }
}

/// An engine that is timed over the last `steps` readings of windows.
struct Run {
    engine: FrameEngine,
    steps: usize,
}

impl<'a> FramesNetwork<'a> {
    /// The study of this network, for a `report` without settings.
    pub(super) fn study(self, report: NetworkReport) -> NetworkStudy<'a> {
        let steps = self.windows.steps;
        let all = settings(&self.trainings[0], steps);
        let settings = all.iter().map(|setting| setting.name(steps)).enumerate().collect();
        let measure = Box::new(move |setting: usize| self.measure(all[setting]));
        NetworkStudy { report, settings, measure }
    }

    fn measure(&self, setting: Setting) -> Result<Measurement, EvaluateError> {
        let whole = self.windows.steps;
        let run = |setting: Setting| {
            let engine = setting.engine(&self.trainings[0])?;
            Ok::<_, EngineError>(Run { engine, steps: whole - setting.left_out })
        };
        let (mut own, mut exact) = (run(setting)?, run(Setting::default())?);
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
            // There is nothing in it yet.
            let _ = self.exact.set(self.outputs(Setting::default())?);
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

    /// Times `windows`, each from a reset on; the push of a window is that of all its frames.
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

    fn outputs(&self, setting: Setting) -> Result<Outputs, EvaluateError> {
        let steps = self.windows.steps - setting.left_out;
        let failed = EvaluateError::from;
        let of =
            |parts| self.windows.logits(self.workers, &setting.engine(parts)?, &self.unseen, steps, failed);
        self.trainings.iter().map(of).collect()
    }

    /// Wrong answers for all unseen objects, then for each set.
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

#[cfg(test)]
mod tests {
    use super::settings;
    use meissner_models::{FrameDescription, Weights};

    #[test]
    fn settings_that_change_nothing_are_left_out() {
        let names = |name: &str| -> Vec<String> {
            let weights = Weights::shipped(name).expect("shipped");
            let parts = FrameDescription::shipped(name).expect("shipped").network_parts(&weights);
            settings(&parts.expect("they fit"), 5).into_iter().map(|setting| setting.name(5)).collect()
        };
        let (slip, canf) = (names("slip-tuned"), names("canf"));
        assert_eq!((slip[0].as_str(), canf[1].as_str()), ("exact", "winograd 2x2"));
        assert!(!slip.iter().any(|name| name.contains("winograd") || name.contains("tolerance")), "{slip:?}");
        for expected in ["steps 4 of 5", "steps 2 of 5"] {
            assert!(slip.iter().any(|name| name == expected), "{expected}: {slip:?}");
        }
        assert!(canf.iter().any(|name| name == "tolerance 0.01"), "{canf:?}");
        let mut sorted = canf.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), canf.len());
    }
}
