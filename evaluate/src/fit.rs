//! A network for a sensor of one's own: the layers of events of another network, and a head that is
//! fitted to labelled presses.
//!
//! Enters: a network over events with its weights, and [`Presses`]. Leaves: a description and
//! weights that an engine runs, and a [`Report`]: errors on presses that were held out, against a
//! constant and against the network as it was; what more presses would bring; which labels are not
//! in the events.
//!
//! | file | contents |
//! |---|---|
//! | `request` | the network whose layers stay, and options |
//! | `samples` | what is fitted, at which instants of which presses |
//! | `readouts` | what an engine reads out there |
//! | `cholesky`, `design` | linear systems of readouts |
//! | `heads` | ridge regression, and a shrunken discriminant for classes |
//! | `validation` | presses that are held out, and strengths |
//! | `figures`, `report` | errors and what they say |
//! | `written` | weights with their card |
//!
//! Everything follows from the input and the seed; the number of threads changes no bit.

mod cholesky;
mod design;
mod figures;
mod heads;
mod readouts;
mod report;
mod request;
mod samples;
mod validation;
mod written;

use std::sync::Arc;

use meissner_engine::{Engine, Options as EngineOptions};
use meissner_kernels::random::Random;
use meissner_models::{Description, ModelError};
use meissner_run::RunError;
use meissner_run::model::Model;

use crate::error::{EvaluateError, RequestPart, Result};
use crate::events::folds;
use crate::presses::Presses;
use crate::workers::Workers;
use design::Design;
pub use figures::{AgeFigure, CurvePoint, Figure, OutputFigures};
use heads::STRENGTHS;
use readouts::Readouts;
pub use report::{BaseReport, DataReport, Report, SensorReport};
use request::Base;
pub use request::{DEFAULT_AGES, DEFAULT_FOLDS, Options};
use samples::{Instant, Samples, Target};
use validation::{HeldOut, Validation};

/// Fewer presses are no point of a learning curve.
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

/// Fits a head to `presses`. O(presses rows^2) for the systems of up to as many rows as instants or
/// values of a readout; memory for all readouts in f32, and two such systems in f64.
///
/// # Errors
/// Before any work: the network is unknown or not over events, or its weights do not fit; there are
/// too few presses, a label has one value, a class is too rare. Later: a recording cannot be read
/// any more, or the network computes NaN.
pub fn fit(presses: &Presses, options: &Options, workers: &Workers) -> Result<Fitted> {
    let (base, text) = Base::load(options)?;
    let sensor = presses.sensor()?;
    let known = base.description.outputs();
    let target = Target::choose(presses, options, known)?;
    let samples = Samples::of(presses, &target, options)?;
    // Ends are by press, one of each.
    let class = |end: &Instant| match target {
        Target::Quantities(_) => 0,
        Target::Classes { .. } => end.truth[0] as usize,
    };
    let classes: Vec<usize> = samples.ends().map(class).collect();
    let fold = folds(&classes, options.folds)?;
    let inconsistent = |error| RunError::description(options.name.clone(), ModelError::Description(error));
    let text = Description::with_dense_head(&text, &options.name, &target.outputs()).map_err(inconsistent)?;
    let description = Description::parse(&text).map_err(inconsistent)?;
    let model = Model::of(&base.description, (&base.weights, base.label.clone()), false)?;
    let network = Arc::new(model.network);
    let engine = Engine::with_options(Arc::clone(&network), sensor, EngineOptions::default())?;

    let readouts = Readouts::of((presses, &samples), &engine, base.stride, workers)?;
    let channels = network.readout_channels();
    let validation = Validation {
        design: Design { values: &readouts.values, columns: readouts.columns, channels },
        target: &target,
        instants: &samples.instants,
        fold: &fold,
        folds: options.folds,
        watch: &workers.watch,
    };
    let order = order(&classes, options.seed);
    let (held_out, fewer, head) = workers.install(|| -> Result<_> {
        let held_out = validation.held_out(|_| true, &STRENGTHS)?;
        let near = near(&held_out);
        let mut fewer: Vec<(usize, HeldOut)> = Vec::new();
        for part in [4, 2] {
            let taken = order.iter().filter(|order| order.is_multiple_of(part)).count();
            if taken >= MIN_CURVE.max(options.folds) {
                fewer.push((part, validation.held_out(|press| order[press].is_multiple_of(part), &near)?));
            }
        }
        let head = validation.whole(&held_out.strengths);
        Ok((held_out, fewer, head))
    })?;
    let Some(head) = head else {
        let found = "readouts that rounding makes dependent on each other".to_owned();
        return Err(EvaluateError::request(
            RequestPart::Data,
            "readouts of which a head can be fitted",
            found,
        ));
    };
    let report = report::Inputs {
        presses,
        samples: &samples,
        target: &target,
        readouts: &readouts,
        base: &base,
        sensor,
        options,
        fold: &fold,
        order: &order,
        held_out: &held_out,
        fewer: &fewer,
    };
    let report = report.report()?;
    let of = (&target, &samples, &report.outputs[..]);
    let card = written::card((&description, &base), &presses.folder, sensor, of, options);
    let weights = written::weights(&description, &base, &head, &card)?;
    Ok(Fitted { description: text, weights, report })
}

/// A place of each press in an order that `seed` draws, in which classes follow each other: of
/// every two or four presses one, each class has its share.
fn order(classes: &[usize], seed: u64) -> Vec<usize> {
    let mut random = Random::new(seed);
    let mut drawn: Vec<(usize, u64, usize)> =
        classes.iter().enumerate().map(|(press, &class)| (class, random.bits(), press)).collect();
    drawn.sort_unstable();
    let mut order = vec![0; classes.len()];
    drawn.into_iter().enumerate().for_each(|(place, (.., press))| order[press] = place);
    order
}

/// The strengths that were chosen, and the next weaker and stronger ones.
fn near(held_out: &HeldOut) -> Vec<f64> {
    let chosen = |i: usize| held_out.strengths.contains(&STRENGTHS[i]);
    let is_near = |&i: &usize| (i.saturating_sub(1)..(i + 2).min(STRENGTHS.len())).any(chosen);
    (0..STRENGTHS.len()).filter(is_near).map(|i| STRENGTHS[i]).collect()
}

#[cfg(test)]
mod tests;
