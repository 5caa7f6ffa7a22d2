//! Streams, weights, states and images that strain the arithmetic, and elementary functions over all inputs.
//!
//! Enters: nothing; cases are data in this module. Leaves: for each case, comparisons of the engine with the batch, errors
//! against f64, times, and the promises that are broken.

mod events;
mod frames;
mod functions;
mod recurrent;
mod result;
mod streams;
mod weights;
mod winograd;

pub use functions::{FunctionResult, sweep};
pub use result::{CaseResult, Errors, LayerError};

use meissner_engine::EngineError;

use crate::error::VerifyError;
use result::{Expect, Size};

const QUICK: Size = Size { events: 160, frames: 3_000, passes: 1 };
const FULL: Size = Size { events: 640, frames: 1_000_000, passes: 5 };

/// A computation that a case compares and times.
trait Run {
    /// The network, and the variant of the computation.
    fn network(&self) -> String;
    /// Runs the input through the engine, from scratch and in f64, and adds the differences to `result`.
    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError>;
    /// Microseconds of an input and the prediction after it, mean over the input.
    fn time_us(&self) -> Result<f64, EngineError>;
}

/// A run, and its expected result.
struct Prepared {
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

/// All cases, group after group.
pub fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    let mut add =
        |group, name, network: &str, prepare: Box<dyn Fn(Size) -> Result<Prepared, VerifyError>>| {
            all.push(Case { group, name, network: network.to_owned(), prepare });
        };
    for shape in streams::SHAPES {
        for network in streams::NETWORKS {
            add("streams", shape.name, network, Box::new(|size| streams::prepare(shape, network, size)));
        }
    }
    for altered in weights::ALTERED {
        for network in weights::NETWORKS {
            add("weights", altered.name, network, Box::new(|size| weights::prepare(altered, network, size)));
        }
    }
    for gates in recurrent::GATES {
        for cell in &recurrent::CELLS {
            add(
                "recurrent",
                gates.name,
                cell.name,
                Box::new(|size| Ok(recurrent::prepare(cell, gates, size))),
            );
        }
    }
    for images in winograd::IMAGES {
        for (index, convolution) in winograd::CONVOLUTIONS.iter().enumerate() {
            let prepare = move |_| Ok(winograd::prepare(images, index));
            add("winograd", images.name, &format!("{convolution:?}"), Box::new(prepare));
        }
    }
    all
}
