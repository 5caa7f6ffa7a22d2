//! The outputs of a network, their displayed units, and the comparison of predictions with the
//! training.
//!
//! Input: predictions. Output: the outputs outside the range of the training, which the network has
//! never seen, with a warning; and the number of windows that were unlike those of the training.

use std::f64::consts::PI;

use meissner_models::ModelError;
use serde::Serialize;

use crate::text::grouped;

/// A value counts as outside if it is farther outside than this share of the length of the range:
/// labels at the ends of a range are predicted with the usual error.
const TOLERANCE: f64 = 0.1;

/// A predicted value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Output {
    pub name: String,
    pub unit: String,
    /// Lowest and highest label of the training in this unit, if the weights state them.
    pub range: Option<[f64; 2]>,
}

/// Marks the predictions of a run whose values or windows are outside of the training, and counts
/// them.
#[derive(Clone, Debug, Default)]
pub struct Training {
    outputs: Vec<Output>,
    /// Names of the outputs that are outside in the newest prediction.
    newest: Vec<String>,
    /// Number of predictions with at least one value outside, and number of all predictions.
    outside: u64,
    all: u64,
    /// Predictions that tell how unlike their window is, and those of them that are unlike the
    /// training.
    told: u64,
    unlike: u64,
    /// Whether each output was outside at least once.
    ever: Vec<bool>,
}

impl Output {
    /// The outputs called `names`, with the `ranges` that the weights state.
    pub(crate) fn all(
        names: &[String],
        units: &[String],
        ranges: Option<Vec<[f64; 2]>>,
    ) -> Result<Vec<Self>, ModelError> {
        if let Some(ranges) = &ranges
            && ranges.len() != names.len()
        {
            let (expected, found) =
                ("[low, high] of each output", format!("{} for {}", ranges.len(), names.len()));
            return Err(ModelError::Metadata { key: "ranges", expected, found });
        }
        let range = |i: usize| ranges.as_ref().map(|ranges| ranges[i]);
        let each = names.iter().zip(units).enumerate();
        Ok(each
            .map(|(i, (name, unit))| Self { name: name.clone(), unit: unit.clone(), range: range(i) })
            .collect())
    }

    /// The displayed unit: degrees for radians.
    pub fn shown_unit(&self) -> &str {
        if self.is_in_radians() { "deg" } else { &self.unit }
    }

    /// `value` in the [displayed unit](Self::shown_unit).
    pub fn shown(&self, value: f64) -> f64 {
        if self.is_in_radians() { value * 180.0 / PI } else { value }
    }

    /// Whether values are in radians, and shown in degrees.
    pub fn is_in_radians(&self) -> bool {
        self.unit == "rad"
    }

    /// Whether `value` is outside the range by more than a tenth of its length, or NaN.
    pub fn is_outside(&self, value: f32) -> bool {
        let Some([low, high]) = self.range else { return false };
        let slack = (high - low) * TOLERANCE;
        !(low - slack..=high + slack).contains(&f64::from(value))
    }
}

impl Training {
    /// A marker for a network with `outputs`, without predictions yet.
    pub fn new(outputs: &[Output]) -> Self {
        Self { outputs: outputs.to_vec(), ever: vec![false; outputs.len()], ..Self::default() }
    }

    /// Takes the values of a new prediction, and how unlike its window is.
    pub fn update(&mut self, values: &[f32], unlike: Option<f32>) {
        self.newest.clear();
        self.all += 1;
        if let Some(unlike) = unlike {
            self.told += 1;
            self.unlike += u64::from(unlike > 1.0);
        }
        if values.len() != self.outputs.len() {
            return;
        }
        for ((output, &value), ever) in self.outputs.iter().zip(values).zip(&mut self.ever) {
            if output.is_outside(value) {
                self.newest.push(output.name.clone());
                *ever = true;
            }
        }
        self.outside += u64::from(!self.newest.is_empty());
    }

    /// Names of the outputs that are outside in the newest prediction.
    pub fn newest(&self) -> &[String] {
        &self.newest
    }

    /// Predictions with a value outside; `None` if the weights state no ranges.
    pub fn outside(&self) -> Option<u64> {
        self.outputs.iter().any(|output| output.range.is_some()).then_some(self.outside)
    }

    /// Predictions of windows unlike those of the training; `None` if the weights contain no
    /// statistics of these.
    pub fn unlike(&self) -> Option<u64> {
        (self.told > 0).then_some(self.unlike)
    }

    /// Logs how many predictions of the input `name` are outside, if any.
    pub fn warn(&self, name: &str) {
        if let Some(warning) = self.warning() {
            tracing::warn!("{name}: {warning}");
        }
    }

    pub(crate) fn warning(&self) -> Option<String> {
        if self.outside == 0 {
            return None;
        }
        let ever = self.outputs.iter().zip(&self.ever).filter(|&(_, &ever)| ever);
        let ranges = ever.filter_map(|(output, _)| {
            let [low, high] = output.range?.map(|end| output.shown(end));
            Some(format!("{} {low:.1} to {high:.1} {}", output.name, output.shown_unit()))
        });
        let (outside, all) = (grouped(self.outside), grouped(self.all));
        Some(format!(
            "{outside} of {all} predictions have values outside the range of the training ({}): they mean little",
            ranges.collect::<Vec<_>>().join(", ")
        ))
    }
}
