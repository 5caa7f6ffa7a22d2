//! Inputs and weights that strain the arithmetic, and elementary functions over all inputs.
//!
//! Output for each case: comparisons with the batch, errors against f64, times, broken promises.

pub(crate) mod events;
mod frames;
mod functions;
pub(crate) mod weights;

pub use functions::{FunctionResult, sweep};

use meissner_engine::EngineError;
use meissner_reference::Difference as Rounding;
use meissner_run::error::chain;
use serde::Serialize;

use crate::error::{Difference, VerifyError};

const QUICK: Size = Size { events: 160, frames: 3_000, passes: 1 };
const FULL: Size = Size { events: 640, frames: 1_000_000, passes: 5 };

/// A computation that a case compares and times.
pub(crate) trait Run {
    /// The network, and the variant of the computation.
    fn network(&self) -> String;
    /// Runs the input through the engine, from scratch and in f64, and adds the differences.
    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError>;
    /// Microseconds of an input and the prediction after it: the mean over all inputs.
    fn time_us(&self) -> Result<f64, EngineError>;
}

/// A run, and its expected result.
pub(crate) struct Prepared {
    run: Box<dyn Run>,
    expect: Expect,
    /// Largest relative error of a prediction.
    within: f64,
    /// The run with which its time is compared.
    ordinary: Box<dyn Run>,
}

/// A case of a network.
pub struct Case {
    /// Group of cases.
    pub group: &'static str,
    /// Name of the case.
    pub name: &'static str,
    /// The network, or the variant of the computation.
    pub network: String,
    prepare: Box<dyn Fn(Size) -> Result<Prepared, VerifyError>>,
}

impl Case {
    /// Runs the case; with `quick`, over fewer events or frames and one pass of timing.
    ///
    /// # Errors
    /// A shipped network cannot be built or is refused by the engine.
    pub fn run(&self, quick: bool) -> Result<CaseResult, VerifyError> {
        let size = if quick { QUICK } else { FULL };
        let Prepared { run, expect, within, ordinary } = (self.prepare)(size)?;
        let network = run.network();
        let mut result = CaseResult { group: self.group, case: self.name, network, ..CaseResult::default() };
        run.compare(&mut result)?;
        let (mut own, mut usual) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..size.passes {
            usual = usual.min(ordinary.time_us()?);
            own = own.min(run.time_us()?);
        }
        (result.us, result.times_ordinary) = (Some(own), Some(own / usual));
        Ok(result.judge(expect, within))
    }
}

/// Largest relative error of a prediction against f64, unless a case states another.
const WITHIN: f64 = 1e-4;

/// Length of the cases.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    events: usize,
    frames: u64,
    /// Passes of timing.
    passes: usize,
}

/// The values that a case must produce.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Expect {
    /// Finite values.
    Finite,
    /// Values beyond f32: infinite predictions, or a layer that reports NaN.
    Overflow,
}

/// Differences of predictions from f64.
#[derive(Clone, Debug, Serialize)]
pub struct Errors {
    /// Largest difference.
    pub absolute: f64,
    /// Largest difference, as a share of the largest magnitude.
    pub relative: f64,
    /// Root mean square difference.
    pub rms: f64,
}

impl From<&Rounding> for Errors {
    fn from(difference: &Rounding) -> Self {
        Self { absolute: difference.absolute, relative: difference.relative(), rms: difference.rms() }
    }
}

/// A layer and the largest difference of its values from f64, as a share of its largest magnitude.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, Serialize)]
pub struct LayerError {
    pub layer: String,
    /// The share.
    pub relative: f64,
}

/// The result of a case.
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[derive(Clone, Debug, Default, Serialize)]
pub struct CaseResult {
    pub group: &'static str,
    pub case: &'static str,
    pub network: String,
    /// Events that entered, or frames.
    pub steps: u64,
    /// Predictions that were compared with those of a full recomputation.
    pub compared: u64,
    /// Of these, those with other bits or another error.
    pub different: u64,
    /// Predictions that were refused because a layer computed NaN.
    pub refused: u64,
    /// The first reason for which a prediction was refused.
    pub refusal: Option<String>,
    /// Values of predictions that are NaN.
    pub not_numbers: u64,
    /// Values of predictions that are infinite.
    pub infinite: u64,
    /// Values of layers that are infinite where a prediction was given.
    pub infinite_inside: u64,
    /// Promised maximum of the relative error of a prediction; `None` if an overflow is expected.
    pub within: Option<f64>,
    /// Differences of predictions from f64; `None` without predictions.
    pub prediction: Option<Errors>,
    /// The layer with the largest relative difference, for networks over events.
    pub layer: Option<LayerError>,
    /// Largest finite magnitude of any activation.
    pub largest_activation: f64,
    /// Microseconds of an event or a frame with its prediction.
    pub us: Option<f64>,
    /// The same as a multiple of the ordinary case's.
    pub times_ordinary: Option<f64>,
    /// Promises that are broken.
    pub broken: Vec<String>,
}

impl CaseResult {
    /// Counts a prediction and a full recomputation: equal if their bits or their errors are.
    pub(crate) fn compare(
        &mut self,
        got: &Result<Vec<f32>, EngineError>,
        want: &Result<Vec<f32>, EngineError>,
    ) {
        self.compared += 1;
        self.different += u64::from(Difference::of_predictions(got, want).is_err());
        match got {
            Ok(values) => {
                self.not_numbers += values.iter().filter(|v| v.is_nan()).count() as u64;
                self.infinite += values.iter().filter(|v| v.is_infinite()).count() as u64;
            }
            Err(error) => {
                self.refused += 1;
                self.refusal.get_or_insert_with(|| chain(error));
            }
        }
    }

    /// The same with the broken promises. The relative error against f64 may be at most `within`.
    pub(crate) fn judge(mut self, expect: Expect, within: f64) -> Self {
        let mut broken = Vec::new();
        if self.different > 0 {
            broken.push(format!(
                "{} of {} predictions are not those of a full recomputation",
                self.different, self.compared
            ));
        }
        if self.not_numbers > 0 {
            broken.push(format!("{} predicted values are NaN", self.not_numbers));
        }
        let overflowed = self.refused + self.infinite + self.infinite_inside > 0;
        match expect {
            Expect::Finite if overflowed => {
                let why = self.refusal.clone().unwrap_or_else(|| "infinite values".to_owned());
                broken.push(format!("finite predictions were expected: {why}"));
            }
            Expect::Overflow if !overflowed => broken.push("an overflow was expected".to_owned()),
            _ => {}
        }
        if expect == Expect::Finite && self.compared == 0 {
            broken.push("nothing was compared".to_owned());
        }
        if expect == Expect::Finite
            && let Some(errors) = &self.prediction
            && (errors.relative > within || errors.relative.is_nan())
        {
            broken.push(format!("relative error {:.1e}, expected at most {within:.0e}", errors.relative));
        }
        self.within = (expect == Expect::Finite).then_some(within);
        self.broken = broken;
        self
    }
}

/// All cases, group after group.
pub fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    let mut add =
        |group, name, network: &str, prepare: Box<dyn Fn(Size) -> Result<Prepared, VerifyError>>| {
            all.push(Case { group, name, network: network.to_owned(), prepare });
        };
    for shape in events::SHAPES {
        for network in events::NETWORKS {
            add("streams", shape.name, network, Box::new(|size| events::prepare(shape, network, size)));
        }
    }
    for altered in weights::ALTERED {
        for network in weights::NETWORKS {
            add("weights", altered.name, network, Box::new(|size| weights::prepare(altered, network, size)));
        }
    }
    for gates in frames::GATES {
        for cell in &frames::CELLS {
            let prepare = |size| Ok(frames::recurrent(cell, gates, size));
            add("recurrent", gates.name, cell.name, Box::new(prepare));
        }
    }
    for images in frames::IMAGES {
        for (index, convolution) in frames::CONVOLUTIONS.iter().enumerate() {
            let prepare = move |_| Ok(frames::winograd(images, index));
            add("winograd", images.name, &format!("{convolution:?}"), Box::new(prepare));
        }
    }
    all
}
