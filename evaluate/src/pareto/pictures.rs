//! The study of contact area and normal force: networks over pictures of a gel.
//!
//! Input: files of pictures, and networks. Output: a [`Study`] of 1 minus the intersection over
//! union, judged as by `eval area`. Some presses, evenly chosen, are timed without their reset, and
//! their maps are compared with the exact ones.

use std::path::PathBuf;
use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameCounters, FrameNetworkParts};
use meissner_kernels::WinogradTile;
use meissner_models::FrameDescription;
use meissner_run::fingerprint::Fingerprint;
use meissner_run::model::{FrameModel, LayerCost};
use meissner_run::run::ContactPredictor;

use super::measurement::{Differences, Lap, Measurement, spread, take_turns, timed_label};
use super::report::DataReport;
use super::settings::{FrameSetting, Thinning, common, has_pixels_to_keep, has_winograd};
use super::task_error::{ErrorKind, TaskError};
use super::{NetworkReport, NetworkStudy, Options, Study};
use crate::area::figures::{Answer, Figures, Outcome, PressOptions, Run};
use crate::area::pictures::{Press, Set, Truth};
use crate::area::{Area, model};
use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::trainings::{EvaluatedNetwork, Request, Training, candidates};
use crate::workers::Workers;

/// Default number of timed pictures.
const PICTURES: usize = 40;
/// Tolerances in the unit of the input, in which a grey level is 0.04 for the shipped networks;
/// normalised layers have about this scale. Noise is 1 to 3 grey levels: the first is below it,
/// 0.05 and 0.1 are within, and 0.2 is 5 grey levels, which only contact changes.
const TOLERANCES: [f32; 4] = [0.02, 0.05, 0.1, 0.2];

/// The study of networks over pictures on all presses in `files`.
///
/// # Errors
/// A file or a network cannot be read, there are no pictures, or pictures do not fit a network.
pub fn area<'a>(
    files: &[PathBuf],
    request: Request<'_>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>> {
    let (candidates, mut notes) = candidates::<Area>(request)?;
    let sets = files.iter().map(|path| Set::read(path)).collect::<Result<Vec<_>, _>>()?;
    let sets = Arc::new(sets);
    let asked = options.timed.unwrap_or(PICTURES);
    let presses: Vec<&Press> = all(&sets).collect();
    let filled: Vec<usize> = (0..presses.len()).filter(|&i| !presses[i].pictures.is_empty()).collect();
    if filled.is_empty() {
        return Err(EvaluateError::request(RequestPart::Pictures, "pictures", "none"));
    }
    let follow = presses.iter().any(|press| press.pictures.len() > 1);
    if !follow {
        notes.push("no press has a second picture, so none with a tolerance or every 2nd picture".to_owned());
    }
    let chosen = spread(&filled, |i| presses[i].pictures.len(), asked);
    let timed: usize = chosen.iter().map(|&i| presses[i].pictures.len()).sum();
    let mut networks = Vec::new();
    for EvaluatedNetwork { description, trainings } in candidates {
        let name = description.name().to_owned();
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        for training in &trainings {
            let model = model(&description, training, Convolution::Direct)?;
            let size = ContactPredictor::new(&model, FrameSetting::default().options())?.size();
            sets.iter().try_for_each(|set| set.check(&name, size))?;
            fingerprint.weights(&training.weights);
        }
        let first = &trainings[0];
        let parts = description.network_parts(&first.weights).map_err(weights_error(&first.label))?;
        let settings = settings(&parts, follow);
        let label = timed_label(trainings.len(), &first.label);
        let costs = description.layers().iter().map(LayerCost::new).collect();
        let (sets, timed, repeats) = (Arc::clone(&sets), chosen.clone(), options.repeats);
        let network = PicturesNetwork { description, trainings, costs, sets, timed, repeats, workers };
        let (names, report) = (FrameSetting::names(&settings), NetworkReport::new(name, label, fingerprint));
        let measure = Box::new(move |setting: usize| network.measure(settings[setting]));
        networks.push(NetworkStudy { report, settings: names, measure });
    }
    let data = DataReport {
        name: files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "),
        recordings: presses.len() as u64,
        size: presses.iter().map(|press| press.pictures.len() as u64).sum(),
        timed: timed as u64,
        fingerprint: fingerprint(&presses),
    };
    Ok(Study { system: "area", unit: "picture", asked, data, networks, notes })
}

fn all(sets: &[Set]) -> impl Iterator<Item = &Press> {
    sets.iter().flat_map(|set| &set.presses)
}

fn fingerprint(presses: &[&Press]) -> String {
    let mut fingerprint = Fingerprint::default();
    for press in presses {
        fingerprint.text(&format!("{} {:?} {}", press.kind, press.pixel_mm, press.pictures.len()));
        fingerprint.bytes(&press.reference);
        for picture in &press.pictures {
            fingerprint.bytes(&picture.rgb);
            match &picture.truth {
                Truth::Force(force) => fingerprint.floats(force),
                Truth::Contact(mask) => mask.iter().for_each(|&touches| fingerprint.bytes(&[touches.into()])),
            }
        }
    }
    fingerprint.finish()
}

/// The settings of a network of `parts`. `follow` states whether pictures follow others of their
/// press: if not, a tolerance has nothing to keep, and no picture can be left out.
fn settings(parts: &FrameNetworkParts, follow: bool) -> Vec<FrameSetting> {
    let mut settings = common(parts, if follow { &TOLERANCES } else { &[] });
    if follow {
        let exact = FrameSetting::default();
        let fast = FrameSetting { convolution: Convolution::Winograd(WinogradTile::Four), ..exact };
        let seldom = |of: FrameSetting| FrameSetting { thinning: Thinning::EverySecond, ..of };
        settings.push(seldom(exact));
        if has_winograd(parts) {
            settings.push(seldom(fast));
            if has_pixels_to_keep(parts) {
                settings.extend([0.05, 0.1].map(|of| FrameSetting { tolerance: Some(of), ..fast }));
            }
        }
    }
    settings
}

/// A network over pictures with its trainings and its data.
struct PicturesNetwork<'a> {
    description: FrameDescription,
    /// Each training; the first one is timed.
    trainings: Vec<Arc<Training>>,
    costs: Vec<LayerCost>,
    sets: Arc<Vec<Set>>,
    /// The timed presses, in the order of all files.
    timed: Vec<usize>,
    repeats: u32,
    workers: &'a Workers,
}

/// A network that is timed, with the maps of the last press.
struct Timed {
    run: Run,
    maps: Vec<f32>,
}

impl PicturesNetwork<'_> {
    /// The network with the weights of `training`, and how it runs over a press.
    fn model(&self, training: &Training, setting: FrameSetting) -> Result<(FrameModel, PressOptions)> {
        let how = PressOptions { options: setting.options(), every: setting.every() };
        Ok((model(&self.description, training, setting.convolution)?, how))
    }

    fn measure(&self, setting: FrameSetting) -> Result<Measurement> {
        let presses: Vec<&Press> = all(&self.sets).collect();
        let run = |setting: FrameSetting| {
            let (model, how) = self.model(&self.trainings[0], setting)?;
            Ok::<_, EvaluateError>(Timed { run: Run::new(&model, how)?, maps: Vec::new() })
        };
        let (mut own, mut exact) = (run(setting)?, run(FrameSetting::default())?);
        let mut differences = Differences::default();
        let mut counters = FrameCounters::default();
        let timing = take_turns(
            (&mut exact, &mut own),
            (std::slice::from_ref(&self.timed), self.repeats, 1),
            |_| Ok::<_, EvaluateError>(()),
            |timed: &mut Timed, chosen, lap| {
                chosen.iter().try_for_each(|&press| timed.press(presses[press], lap))
            },
            |_, exact, own| {
                counters = own.run.predictor.counters();
                let pixels = exact.run.predictor.force().len();
                let maps = exact.maps.chunks_exact(pixels).zip(own.maps.chunks_exact(pixels));
                let pictures = exact.maps.len() / pixels;
                maps.enumerate()
                    .for_each(|(place, (exact, own))| differences.add((place, pictures), exact, own));
            },
        )?;
        let timed: usize = self.timed.iter().map(|&press| presses[press].pictures.len()).sum();
        let per_picture = |count: u64| count as f64 / timed as f64;
        let layers = counters.layers;
        let products = self.costs.iter().zip(&layers).map(|(cost, layer)| cost.of(layer)).sum();
        Ok(Measurement {
            timed: timed as u64,
            entered: per_picture(counters.frames),
            timing,
            rows: per_picture(layers.iter().map(|layer| layer.computed).sum()),
            multiply_adds: per_picture(products),
            numerical: differences.finish(),
            task: self.errors(setting)?,
        })
    }

    /// Errors of contact, and of force where known: on all files, then on each file if there are
    /// several.
    fn errors(&self, setting: FrameSetting) -> Result<Vec<TaskError>> {
        let mut judged: Vec<Vec<Vec<Outcome>>> = Vec::new();
        for training in &self.trainings {
            let (model, how) = self.model(training, setting)?;
            let outcome = |(): &mut (), press: &Press| {
                let mut outcome = Outcome::of(&model, how, &self.costs, press)?;
                // Maps of all pictures would take much memory, and the figures are already
                // computed.
                outcome.maps = Vec::new();
                Ok::<_, EvaluateError>(outcome)
            };
            let of_set = |set: &Set| self.workers.for_each(&(), &set.presses, outcome);
            judged.push(self.sets.iter().map(of_set).collect::<Result<_, _>>()?);
        }
        let several = self.sets.len() > 1;
        let mut errors =
            errors(if several { "all files" } else { "pictures" }, judged.iter().map(|sets| &sets[..]));
        if several {
            for (i, set) in self.sets.iter().enumerate() {
                errors.extend(self::errors(
                    &set.name,
                    judged.iter().map(|sets| std::slice::from_ref(&sets[i])),
                ));
            }
        }
        Ok(errors)
    }
}

/// The errors of the part `of` the data, from the outcomes of each training on each of its files.
fn errors<'a>(of: &str, trainings: impl Iterator<Item = &'a [Vec<Outcome>]>) -> Vec<TaskError> {
    let trainings: Vec<(Figures, Vec<&Outcome>)> = trainings
        .map(|sets| sets.iter().flatten().collect::<Vec<_>>())
        .map(|outcomes| (Figures::new(&outcomes), outcomes))
        .collect();
    let contact = trainings.iter().map(|(figures, outcomes)| {
        (1.0 - figures.iou.mean, outcomes.iter().map(|outcome| outcome.lacking()).collect())
    });
    let force = trainings.iter().map(|(figures, outcomes)| {
        let mean = figures.force_n.map_or(f64::NAN, |force| force.mean);
        (mean, outcomes.iter().map(|outcome| outcome.force_error()).collect())
    });
    let force = TaskError::mean(of, ErrorKind::AbsoluteForce, force);
    TaskError::mean(of, ErrorKind::OneMinusIou, contact).into_iter().chain(force).collect()
}

impl Timed {
    fn press(&mut self, press: &Press, lap: &mut Lap) -> Result<()> {
        self.run.begin(press);
        self.maps.clear();
        for picture in &press.pictures {
            let Answer { push, push_predict, .. } = self.run.measure(&picture.rgb)?;
            lap.push((push, push_predict));
            self.maps.extend_from_slice(self.run.predictor.force());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
