//! The sections of each kind of result.

mod bench;
mod closed_loop;
mod eval;
mod fit;
mod layers;
mod pareto;
mod regressions;
mod soak;
mod stream;
mod sweep;
mod verify;

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
            "verify" => verify::section(outcome, object),
            "stress" => verify::stress(object),
            "simulate loop" => closed_loop::section(object),
            "sweep" => sweep::section(object),
            of @ ("eval angle" | "eval force" | "eval area") => regressions::section(of, object),
            _ => eval::section(&outcome.command, object),
        },
    }
}
