//! A prediction over electrodes: a line for people or for programs.

use std::io::{self, Write};

use meissner_io::Reading;
use meissner_models::systems::slip::Decision;
use serde::Serialize;

use crate::run::json::Values;

/// The unit of values that a softmax makes into probabilities.
const LOGIT: &str = "logit";

/// Most values that a line for people shows.
const SHOWN: usize = 3;

/// What the network's values are called, and whether they are of classes.
#[derive(Clone, Copy)]
pub(super) struct Outputs<'a> {
    pub(super) names: &'a [String],
    pub(super) unit: &'a str,
}

/// A prediction.
pub(super) struct Line<'a> {
    pub(super) outputs: Outputs<'a>,
    pub(super) reading: &'a Reading,
    pub(super) values: &'a [f32],
    pub(super) probabilities: &'a [f32],
    /// Index of the most probable class.
    pub(super) class: usize,
    pub(super) decision: Option<Decision>,
    pub(super) update_us: f64,
}

/// A prediction, as programs see it.
#[derive(Serialize)]
pub(super) struct Shown<'a> {
    line: u64,
    time_s: Option<f64>,
    value: Values<'a>,
    probabilities: Option<Values<'a>>,
    class: Option<&'a str>,
    decision: Option<&'a str>,
    held: Option<u64>,
    update_us: f64,
}

impl Outputs<'_> {
    pub(super) fn are_classes(self) -> bool {
        self.unit == LOGIT
    }

    pub(super) fn write_headings(self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "{:>7}  {:>9}", "line", "time (s)")?;
        if self.are_classes() {
            write!(out, "  {:>8}  {:>11}  {:>8}", "class", "probability", "decision")?;
        } else {
            for name in self.names.iter().take(SHOWN) {
                write!(out, "  {:>11}", format!("{name} ({})", self.unit))?;
            }
        }
        writeln!(out, "  {:>11}", "update (us)")
    }
}

impl<'a> Line<'a> {
    pub(super) fn shown(&self) -> Shown<'a> {
        let is_class = self.outputs.are_classes();
        let name = |class: usize| self.outputs.names[class].as_str();
        Shown {
            line: self.reading.line,
            time_s: self.reading.time_s,
            value: Values(self.values),
            probabilities: is_class.then_some(Values(self.probabilities)),
            class: is_class.then(|| name(self.class)),
            decision: self.decision.map(|decision| name(decision.class)),
            held: self.decision.map(|decision| decision.held),
            update_us: self.update_us,
        }
    }

    pub(super) fn text(&self) -> String {
        let shown = self.shown();
        let time = shown.time_s.map_or_else(|| "-".to_owned(), |s| format!("{s:.3}"));
        let said = if let Some(class) = shown.class {
            let (probability, decision) = (self.probabilities[self.class], shown.decision.unwrap_or("-"));
            format!("  {class:>8}  {probability:>11.4}  {decision:>8}")
        } else {
            let values = self.values.iter().take(SHOWN);
            values.map(|value| format!("  {value:>11.6}")).collect::<Vec<_>>().concat()
        };
        format!("{:>7}  {time:>9}{said}  {:>11.1}", shown.line, self.update_us)
    }
}
