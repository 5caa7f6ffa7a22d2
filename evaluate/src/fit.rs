//! A network for the user's own sensor: the layers of events of another network, and a head that is
//! fitted to labelled presses.
//!
//! Input: a network over events with its weights, and [`Presses`]. Output: a description and
//! weights that an engine runs, and a [`Report`]: errors on held-out presses, against a constant
//! and against the original network; the error with more presses; labels that cannot be predicted
//! from the events.
//!
//! | file | contents |
//! |---|---|
//! | `request` | the network whose layers stay, and options |
//! | `samples` | the labels that are fitted, and the instants of presses |
//! | `readouts` | what an engine reads out there |
//! | `cholesky` | linear systems |
//! | `basis`, `modes` | coordinates of readouts, and products of the main ones |
//! | `kernel` | Gaussian kernels of the modes |
//! | `heads` | ridge regression, and a shrunken discriminant for classes |
//! | `perceptron` | a perceptron for what these leave |
//! | `dense` | heads as dense layers |
//! | `validation` | presses that are held out, and strengths |
//! | `figures`, `report` | errors and advice |
//! | `written` | weights with their card |
//!
//! Everything follows from the input and the seed; the number of threads changes no bit.

mod basis;
pub(crate) mod cholesky;
mod dense;
mod figures;
mod heads;
mod kernel;
mod modes;
mod perceptron;
mod readouts;
mod report;
mod request;
mod samples;
mod validation;
mod written;

use std::sync::Arc;

use meissner_engine::{Engine, Network, Options as EngineOptions, Sensor, TrainingWindows};
use meissner_kernels::random::Random;
use meissner_models::description::Outputs;
use meissner_models::{Description, windows_text};
use meissner_run::model::Model;

use crate::error::{EvaluateError, RequestPart, Result};
use crate::events::folds;
use crate::presses::Presses;
use crate::workers::{ProgressHandle, Workers};
use basis::{Basis, Design};
use dense::Dense;
pub use figures::{AgeFigure, CurvePoint, Figure, OutputFigures};
use heads::Choice;
use kernel::{Kernel, WIDTHS};
use modes::Features;
use readouts::Readouts;
pub use report::{BaseReport, DataReport, HeadReport, Report, SensorReport};
use request::Base;
pub use request::{DEFAULT_AGES, DEFAULT_FOLDS, Head, Options};
use samples::{Given, Instant, Samples, Target};
use validation::{HeldOut, Validation, sureness};

/// A point of the learning curve needs at least so many presses.
const MIN_CURVE: usize = 4;

/// A fitted network.
#[derive(Debug)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Fitted {
    /// The text of the description.
    pub description: String,
    /// The bytes of the weights (safetensors), with their card as metadata.
    pub weights: Vec<u8>,
    pub report: Report,
}

/// Fits a head to `presses`: behind the readout and, if the network has layers with weights there,
/// also instead of its last layer alone. Returns the one that predicts held-out presses better; if
/// they are equal, the latter.
///
/// O(rows columns) for each of up to 2,048 rows, for as many rows as instants and as many columns
/// as values that are read; memory for all of these in f32.
///
/// # Errors
/// Before any work: the network is unknown or not over events, or its weights do not fit; there are
/// too few presses, a label has one value, a class is too rare. Later: a recording cannot be read
/// any more, or the network computes NaN.
pub fn fit(presses: &Presses, options: &Options, workers: &Workers) -> Result<Fitted> {
    let base = Base::load(options)?;
    let sensor = presses.sensor()?;
    let target = Target::choose(presses, options, base.description.outputs())?;
    let samples = Samples::of(presses, &target, options)?;
    // The ends are in the order of the presses, one for each press.
    let class = |end: &Instant| match target {
        Target::Quantities(_) => 0,
        Target::Classes { .. } => end.truth[0] as usize,
    };
    let classes: Vec<usize> = samples.ends().map(class).collect();
    let fold = folds(&classes, options.folds)?;
    let before = if target.is_predicted_by(base.description.outputs()) {
        let model = Model::of(&base.description, (&base.weights, base.label.clone()), false)?;
        let engine = engine(model.network, sensor)?;
        Some(readouts::predictions((presses, &samples), &engine, base.stride, workers)?)
    } else {
        None
    };
    let given = Given {
        presses,
        samples: &samples,
        target: &target,
        before: before.as_deref(),
        base: &base,
        sensor,
        options,
        fold: &fold,
        order: &order(&classes, options.seed),
    };
    let mut best = given.fit(Head::New, workers)?;
    // Dense layers that were fitted to the same presses have already seen the held-out ones.
    let own = written::fingerprint(presses, &samples);
    let knows = base.weights.metadata().get(written::FITTED_TO).is_some_and(|other| *other == own);
    let mut heads = best.report.heads.clone();
    for kept in base.kept_heads(options, knows) {
        let kept = given.fit(kept, workers)?;
        heads.extend_from_slice(&kept.report.heads);
        if kept.report.heads[0].error <= best.report.heads[0].error {
            best = kept;
        }
    }
    best.report.heads = heads;
    Ok(best)
}

fn engine(network: Network, sensor: Sensor) -> Result<Engine> {
    Ok(Engine::with_options(Arc::new(network), sensor, EngineOptions::default())?)
}

impl Given<'_> {
    /// Fits the layers behind `head`.
    fn fit(&self, head: Head, workers: &Workers) -> Result<Fitted> {
        let Self { presses, samples, target, base, sensor, options, .. } = *self;
        let outputs = target.outputs();
        let (probe, last) = match head {
            Head::New => {
                let probe = base.refitted((options, sensor), head, &outputs, &[])?;
                let last = silence(&probe.description);
                (probe, last)
            }
            // The values that the next layer would read are predicted instead of the readout.
            Head::Kept { values, .. } => {
                let each = (0..values).map(|i| (format!("value{i}"), "1".to_owned())).collect();
                let probe = base.refitted((options, sensor), head, &Outputs::Quantities(each), &[])?;
                (probe, identity(values))
            }
        };
        let network = probe.description.network(&probe.weights(&base.named, &[last]));
        let engine = engine(network.map_err(|source| base.unfit(source))?, sensor)?;
        let readouts = Readouts::of((presses, samples), &engine, base.stride, head != Head::New, workers)?;
        let weights: Vec<f64> = samples.instants.iter().map(|instant| instant.weight).collect();
        let design = Design {
            values: &readouts.values,
            columns: readouts.columns,
            channels: readouts.channels,
            weights: &weights,
            counts: if head == Head::New { probe.counts } else { 0 },
        };
        let folds = (self.fold, self.order);
        let (held_out, fewer, dense) =
            workers.install(|| heads(design, (samples, target), folds, options, &workers.watch))?;
        let fitted = base.refitted((options, sensor), head, &outputs, &dense.hidden())?;
        let inputs =
            report::Inputs { given: self, head, readouts: &readouts, held_out: &held_out, fewer: &fewer };
        let report = inputs.report()?;
        let of = (target, samples, &report.outputs[..]);
        let mut card = written::card((&fitted.description, base, head), presses, sensor, of, options);
        let windows = TrainingWindows::of(&readouts.windows);
        card.extend(windows.map(|windows| ("training_windows".to_owned(), windows_text(&windows))));
        let weights = written::weights(&fitted, base, &dense, &card)?;
        Ok(Fitted { description: fitted.text, weights, report })
    }
}

/// Predictions of heads that were fitted to one of so many presses.
type Fewer = Vec<(usize, HeldOut)>;

/// Predictions for presses that were held out, the same of heads that were fitted to every fourth
/// and every second press of `order`, and the head of all.
fn heads(
    design: Design<'_>,
    (samples, target): (&Samples, &Target),
    (fold, order): (&[usize], &[usize]),
    options: &Options,
    watch: &ProgressHandle,
) -> Result<(HeldOut, Fewer, Dense)> {
    let dependent = || {
        let found = "readouts that rounding makes dependent on each other".to_owned();
        EvaluateError::request(RequestPart::Folder, "readouts of which a head can be fitted", found)
    };
    let (basis, coordinates) = Basis::new(design, options.seed).ok_or_else(dependent)?;
    let features = Features::new(coordinates, design.weights, options.seed);
    let validation = Validation {
        features: &features,
        target,
        instants: &samples.instants,
        fold,
        folds: options.folds,
        watch,
    };
    let tried = Choice::all();
    let held_out = validation.held_out(|_| true, &tried)?;
    // Perceptrons already cover what a kernel would add.
    let kernel = if options.hidden == 0 { kernel((&validation, &held_out), options.seed)? } else { None };
    let (validation, tried, held_out) = match &kernel {
        Some(of) => (Validation { features: &of.features, ..validation }, &of.tried[..], of.held_out.clone()),
        None => (validation, &tried[..], held_out),
    };
    let learn = |held_out: HeldOut, taken: &(dyn Fn(usize) -> bool + Sync)| {
        if options.hidden == 0 {
            return Ok(held_out);
        }
        validation.with_perceptrons(held_out, taken, (options.hidden, options.seed))
    };
    let held_out = learn(held_out, &|_| true)?;
    let near = Choice::near(&held_out.choices, tried);
    let mut fewer = Fewer::new();
    for part in [4, 2] {
        let taken = order.iter().filter(|order| order.is_multiple_of(part)).count();
        if taken >= MIN_CURVE.max(options.folds) {
            let taken = |press: usize| order[press].is_multiple_of(part);
            fewer.push((part, learn(validation.held_out(taken, &near)?, &taken)?));
        }
    }
    let mut head = validation.whole(&held_out.choices).ok_or_else(dependent)?;
    let mut choices = held_out.choices.clone();
    if matches!(target, Target::Classes { .. }) && !held_out.perceptrons.is_empty() {
        // The perceptrons predict classes alone.
        head.weight.fill(0.0);
        head.bias.fill(0.0);
        choices.iter_mut().for_each(|choice| choice.products = 0.0);
    }
    let mut head = match &kernel {
        Some(of) => Dense::of_kernel(&head, &of.kernel, &features, &basis),
        None => Dense::new((&head, &choices), &held_out.perceptrons, &features, &basis),
    };
    if matches!(target, Target::Classes { .. }) {
        let truth: Vec<usize> = samples.instants.iter().map(|instant| instant.truth[0] as usize).collect();
        head.scale(sureness(&held_out.predicted, &truth));
    }
    Ok((held_out, fewer, head))
}

/// A kernel, with features that are linear in its coordinates.
struct OfKernel {
    kernel: Kernel,
    features: Features,
    tried: Vec<Choice>,
    held_out: HeldOut,
}

/// The kernel that predicts held-out presses best. `None` where `held_out`, which is linear or
/// quadratic, is better.
fn kernel((validation, held_out): (&Validation<'_>, &HeldOut), seed: u64) -> Result<Option<OfKernel>> {
    let modes = validation.features.of_modes();
    let weights: Vec<f64> = validation.instants.iter().map(|instant| instant.weight).collect();
    let mut best: Option<OfKernel> = None;
    for width in WIDTHS {
        let Some((kernel, coordinates)) = Kernel::new((&modes, &weights), width, seed) else { continue };
        let (features, tried) = (Features::linear(coordinates), Choice::of_kernel(width));
        let found = Validation { features: &features, ..*validation }.held_out(|_| true, &tried)?;
        if validation.ratio(&found, best.as_ref().map_or(held_out, |best| &best.held_out)) < 1.0 {
            best = Some(OfKernel { kernel, features, tried, held_out: found });
        }
    }
    Ok(best)
}

/// A dense layer of zeros behind the readout of `description`, its only one.
fn silence(description: &Description) -> (Vec<f32>, Vec<f32>) {
    let last = description.layers().last();
    last.map_or_else(Default::default, |last| {
        (vec![0.0; last.inputs * last.outputs], vec![0.0; last.outputs])
    })
}

/// A dense layer whose output is its input.
fn identity(values: usize) -> (Vec<f32>, Vec<f32>) {
    let factor = |i: usize| f32::from(u8::from(i.is_multiple_of(values + 1)));
    ((0..values * values).map(factor).collect(), vec![0.0; values])
}

/// The position of each press in an order that `seed` draws. Classes alternate in it, so that each
/// class has its share of every second or fourth press.
fn order(classes: &[usize], seed: u64) -> Vec<usize> {
    let mut random = Random::new(seed);
    let mut drawn: Vec<(usize, u64, usize)> =
        classes.iter().enumerate().map(|(press, &class)| (class, random.bits(), press)).collect();
    drawn.sort_unstable();
    let mut order = vec![0; classes.len()];
    drawn.into_iter().enumerate().for_each(|(place, (.., press))| order[press] = place);
    order
}

#[cfg(test)]
mod tests;
