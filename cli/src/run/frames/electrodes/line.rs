//! A prediction over electrodes: a line for people or for programs.

use std::io::{self, Write};

use meissner_io::Reading;
use meissner_models::systems::slip::Decision;
use serde::Serialize;

use crate::run::json::Values;

/// The unit of values that a softmax makes into probabilities.
const LOGIT: &str = "logit";

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
        for name in self.names {
            let name =
                if self.are_classes() { format!("p({name})") } else { format!("{name} ({})", self.unit) };
            write!(out, "  {name:>8}")?;
        }
        let classes = if self.are_classes() { "  class     decision" } else { "" };
        writeln!(out, "{classes}  {:>11}", "update (us)")
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
        let values = if shown.class.is_some() { self.probabilities } else { self.values };
        let values: Vec<String> = values.iter().map(|value| format!("  {value:>8.6}")).collect();
        let values = values.concat();
        let classes = shown
            .class
            .map_or_else(String::new, |class| format!("  {class:<8}  {:<8}", shown.decision.unwrap_or("-")));
        format!("{:>7}  {time:>9}{values}{classes}  {:>11.1}", shown.line, self.update_us)
    }
}
