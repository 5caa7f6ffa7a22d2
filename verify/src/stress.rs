//! Streams, weights, states and images that strain the arithmetic, and elementary functions over all inputs.
//!
//! Enters: nothing; cases are data in this module. Leaves: for each case, comparisons of the engine with the batch, errors
//! against f64, times, and the promises that are broken.
//!
//! | file | contents |
//! |---|---|
//! | `streams`, `weights` | cases of networks over events |
//! | `recurrent`, `winograd` | cases of frame networks |
//! | `events`, `frames` | running a case: incremental, from scratch, in f64 |
//! | `functions` | elementary functions over all inputs |
//! | `result` | the result of a case, and the promises that it breaks |

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

use crate::error::VerifyError;
use result::Size;

const QUICK: Size = Size { events: 160, frames: 3_000, passes: 1 };
const FULL: Size = Size { events: 640, frames: 1_000_000, passes: 5 };

/// Runs a case.
type Run = Box<dyn Fn(Size) -> Result<CaseResult, VerifyError>>;

/// A case of a network.
pub struct Case {
    /// Group of cases.
    pub group: &'static str,
    /// Name of the case.
    pub name: &'static str,
    /// The network, or the variant of the computation.
    pub network: String,
    run: Run,
}

impl Case {
    /// Runs the case; with `quick`, over fewer events or frames and one pass of timing.
    ///
    /// # Errors
    /// A shipped network cannot be built or is refused by the engine.
    pub fn run(&self, quick: bool) -> Result<CaseResult, VerifyError> {
        (self.run)(if quick { QUICK } else { FULL })
    }
}

/// All cases, group after group.
pub fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    let mut add = |group, name, network: &str, run: Run| {
        all.push(Case { group, name, network: network.to_owned(), run });
    };
    for shape in streams::SHAPES {
        for network in streams::NETWORKS {
            let run = move |size: Size| streams::case(shape, network, size)?.run(size.passes);
            add("streams", shape.name, network, Box::new(run));
        }
    }
    for altered in weights::ALTERED {
        for network in weights::NETWORKS {
            let run = move |size: Size| weights::case(altered, network, size)?.run(size.passes);
            add("weights", altered.name, network, Box::new(run));
        }
    }
    for gates in recurrent::GATES {
        for cell in recurrent::CELLS {
            let run = move |size: Size| recurrent::case(cell, gates, size).run(size.passes);
            add("recurrent", gates.name, cell.name(), Box::new(run));
        }
    }
    for images in winograd::IMAGES {
        for (index, convolution) in winograd::CONVOLUTIONS.iter().enumerate() {
            let run = move |size: Size| winograd::case(images, index).run(size.passes);
            add("winograd", images.name, &format!("{convolution:?}"), Box::new(run));
        }
    }
    all
}
