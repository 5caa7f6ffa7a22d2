//! The predictions of `run`, the reports of `play`, and their summary: line by line.

use std::borrow::Cow;

use serde::Deserialize;
use serde_json::Value;

use crate::decimated::Decimated;
use crate::json::{list, text, texts};
use crate::truth::{Truths, value_at};
use crate::words::shown_unit;

/// Maximum number of layers and values of a prediction that are kept.
const MAX_LINES: usize = 64;

/// A line after the header.
#[derive(Deserialize)]
pub(crate) struct Line<'a> {
    pub(crate) header: Option<Value>,
    summary: Option<Value>,
    failed: Option<Value>,
    input: Option<usize>,
    t_us: Option<f64>,
    time_s: Option<f64>,
    #[serde(rename = "line")]
    reading: Option<f64>,
    picture: Option<f64>,
    value: Option<Vec<Option<f64>>>,
    probabilities: Option<Vec<Option<f64>>>,
    #[serde(borrow)]
    class: Option<Cow<'a, str>>,
    #[serde(borrow)]
    decision: Option<Cow<'a, str>>,
    unlike: Option<f64>,
    nodes: Option<f64>,
    rows: Option<Vec<f64>>,
    update_us: Option<f64>,
    age_us: Option<f64>,
    waited_us: Option<f64>,
    behind_us: Option<f64>,
    since_arrival_us: Option<f64>,
    area_mm2: Option<f64>,
    force_n: Option<f64>,
}

impl Line<'_> {
    /// The number of its input.
    pub(crate) fn input(&self) -> usize {
        let of = |value: &Option<Value>| {
            value.as_ref().and_then(|value| value.get("input")).and_then(Value::as_u64)
        };
        let named = of(&self.summary).or(of(&self.failed));
        self.input.or(named.map(|input| input as usize)).unwrap_or(0)
    }
}

/// The quantity along the horizontal axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Along {
    /// Milliseconds since the first prediction.
    #[default]
    Time,
    /// The number of the prediction, from 1.
    Number,
}

/// A value along the stream, with its truth.
#[derive(Clone, Debug, Default)]
pub(crate) struct Valued {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) line: Decimated,
    /// Points of the truth, and its line at the predictions.
    points: Vec<(f64, f64)>,
    pub(crate) truth: Decimated,
    /// Sum and number of absolute errors.
    pub(crate) errors: (f64, f64),
    /// Factor from the network's unit to the shown one.
    factor: f64,
}

/// A line with its name.
pub(crate) type Named = (String, Decimated);

/// All data that is kept of a stream: O(1) in its length.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stream {
    pub(crate) header: Value,
    pub(crate) summary: Option<Value>,
    pub(crate) failed: Option<String>,
    pub(crate) along: Along,
    first_us: Option<f64>,
    pub(crate) predictions: u64,
    /// The outputs, or area and force of pictures.
    pub(crate) values: Vec<Valued>,
    /// Probabilities of the classes.
    pub(crate) classes: Vec<Named>,
    /// How often each class was predicted, in the order of the classes.
    pub(crate) predicted: Vec<u64>,
    pub(crate) last_class: Option<String>,
    pub(crate) last_decision: Option<String>,
    /// Rows that each layer computed for a prediction.
    pub(crate) rows: Vec<Decimated>,
    pub(crate) unlike: Decimated,
    pub(crate) nodes: Decimated,
    /// Times of a prediction in microseconds.
    pub(crate) times: Vec<Named>,
}

impl Stream {
    /// A stream before its first prediction.
    pub(crate) fn new(header: Value, truths: &Truths) -> Self {
        let input = text(&header, "input/name").unwrap_or_default();
        let valued = |output: &Value| {
            let (name, unit) = (text(output, "name")?, text(output, "unit").unwrap_or_default());
            let (shown, factor) = shown_unit(unit);
            let points = truths.of(input, name, unit).unwrap_or_default();
            Some(Valued {
                name: name.to_owned(),
                unit: shown.to_owned(),
                points,
                factor,
                ..Valued::default()
            })
        };
        let classes = texts(&header, "classes").into_iter().take(MAX_LINES);
        let classes: Vec<Named> = classes.map(|name| (name.to_owned(), Decimated::default())).collect();
        let values = if classes.is_empty() {
            list(&header, "outputs").iter().filter_map(valued).take(MAX_LINES).collect()
        } else {
            Vec::new()
        };
        let predicted = vec![0; classes.len()];
        Self { header, values, classes, predicted, ..Self::default() }
    }

    /// Takes a line.
    pub(crate) fn take(&mut self, line: Line<'_>) {
        if let Some(summary) = line.summary {
            self.summary = Some(summary);
            return;
        }
        if let Some(failed) = line.failed {
            self.failed = Some(text(&failed, "error").unwrap_or("no reason was given").to_owned());
            return;
        }
        self.predictions += 1;
        let t_us = line.t_us.or(line.time_s.map(|s| s * 1e6));
        let numbered =
            t_us.is_none() && (line.reading.is_some() || line.picture.is_some() || line.area_mm2.is_some());
        if numbered {
            self.along = Along::Number;
        }
        let x = match (t_us, self.along) {
            (Some(t_us), Along::Time) => (t_us - *self.first_us.get_or_insert(t_us)) / 1e3,
            _ => self.predictions as f64,
        };
        self.take_values(&line, t_us, x);
        for (class, probability) in self.classes.iter_mut().zip(line.probabilities.iter().flatten()) {
            class.1.push(x, probability.unwrap_or(f64::NAN));
        }
        if let Some(class) = line.class {
            if let Some(i) = self.classes.iter().position(|(name, _)| *name == class) {
                self.predicted[i] += 1;
            }
            self.last_class = Some(class.into_owned());
        }
        self.last_decision = line.decision.map(Cow::into_owned).or(self.last_decision.take());
        for (layer, &rows) in line.rows.iter().flatten().take(MAX_LINES).enumerate() {
            if layer == self.rows.len() {
                self.rows.push(Decimated::default());
            }
            self.rows[layer].push(x, rows);
        }
        self.unlike.push(x, line.unlike.unwrap_or(f64::NAN));
        self.nodes.push(x, line.nodes.unwrap_or(f64::NAN));
        let times = [
            ("work since the prediction before", line.update_us),
            ("age", line.age_us),
            ("waited", line.waited_us),
            ("behind", line.behind_us),
            ("since arrival", line.since_arrival_us),
        ];
        for (name, us) in times {
            if let Some(us) = us {
                named(&mut self.times, name).push(x, us);
            }
        }
    }

    /// True and predicted values of an output, at the points of its line with known truth.
    pub(crate) fn pairs(&self, value: &Valued) -> Vec<(f64, f64)> {
        let Some(first_us) = self.first_us.filter(|_| self.along == Along::Time) else { return Vec::new() };
        let truth = |x: f64| value_at(&value.points, (first_us + 1e3 * x).round());
        value.line.points().into_iter().filter_map(|(x, found)| Some((truth(x)?, found))).collect()
    }

    fn take_values(&mut self, line: &Line<'_>, t_us: Option<f64>, x: f64) {
        if let Some(area) = line.area_mm2 {
            // Over pictures, outputs are pixels of a map, which are not listed.
            let of_pictures =
                [("contact area", "mm2", area), ("total force", "N", line.force_n.unwrap_or(f64::NAN))];
            if self.values.first().is_none_or(|value| value.name != of_pictures[0].0) {
                let valued = |(name, unit, _): (&str, &str, f64)| Valued {
                    name: name.to_owned(),
                    unit: unit.to_owned(),
                    factor: 1.0,
                    ..Valued::default()
                };
                self.values = of_pictures.map(valued).to_vec();
            }
            for (valued, (.., value)) in self.values.iter_mut().zip(of_pictures) {
                valued.line.push(x, value);
            }
            return;
        }
        for (valued, value) in self.values.iter_mut().zip(line.value.iter().flatten()) {
            let Some(value) = value.map(|value| valued.factor * value) else { continue };
            valued.line.push(x, value);
            if let Some(truth) = t_us.and_then(|t_us| value_at(&valued.points, t_us)) {
                valued.truth.push(x, truth);
                valued.errors.0 += (value - truth).abs();
                valued.errors.1 += 1.0;
            }
        }
    }
}

/// The line called `name`; a new one if there is none.
fn named<'a>(lines: &'a mut Vec<Named>, name: &str) -> &'a mut Decimated {
    let found = lines.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
        lines.push((name.to_owned(), Decimated::default()));
        lines.len() - 1
    });
    &mut lines[found].1
}
