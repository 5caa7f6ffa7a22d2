//! What is told of each kind of result.

mod bench;
mod eval;
mod fit;
mod layers;
mod pareto;
mod soak;
mod stream;

use crate::parts::Section;
use crate::read::{Body, Outcome};

/// The section of a result.
pub(crate) fn section(outcome: &Outcome) -> Section {
    match &outcome.body {
        Body::Stream(of) => stream::section(outcome, of),
        Body::Object(object) => match outcome.command.as_str() {
            "bench" => bench::section(outcome, object),
            "fit" => fit::section(object),
            "pareto" => pareto::section(object),
            "soak" => soak::section(outcome, object),
            _ => eval::section(&outcome.command, object),
        },
    }
}
