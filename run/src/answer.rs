//! Predictions in the terms of their network: values with exact digits, classes and probabilities.

use meissner_kernels::softmax;
use serde::Serialize;

/// The index of the first of the largest values; `None` if there are no values, or one is NaN.
pub fn largest(values: &[f32]) -> Option<usize> {
    if values.iter().any(|value| value.is_nan()) {
        return None;
    }
    (0..values.len()).reduce(|best, i| if values[i] > values[best] { i } else { best })
}

/// f32 values, serialised with the digits of the equal f64, so that a reader through f64 restores
/// each. The shortest digits of an f32 do not always do that (7.038531e-26).
#[derive(Clone, Copy, Debug)]
pub struct Values<'a>(pub &'a [f32]);

impl Serialize for Values<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        exact_digits(self.0, serializer)
    }
}

/// Serialises `values` as [`Values`].
pub(crate) fn exact_digits<S: serde::Serializer>(values: &[f32], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|&value| f64::from(value)))
}

/// The predicted class. It is serialised next to `value`.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Answer<'a> {
    /// Name of the most probable class.
    pub class: &'a str,
    /// Softmax of the values.
    pub probabilities: Values<'a>,
}

impl Answer<'_> {
    /// Probability of the class.
    pub fn probability(&self) -> f32 {
        self.probabilities.0.iter().copied().fold(0.0, f32::max)
    }
}

/// Names of the classes of a network, and the newest probabilities.
#[derive(Clone, Debug, Default)]
pub struct Classes {
    /// `None` if values are not logits of classes.
    names: Option<Vec<String>>,
    probabilities: Vec<f32>,
    largest: Option<usize>,
}

impl Classes {
    /// The classes of a network whose values are logits of `names`, or are not logits of classes.
    pub fn new(names: Option<Vec<String>>) -> Self {
        Self { names, ..Self::default() }
    }

    /// Whether values are logits of classes.
    pub fn are_known(&self) -> bool {
        self.names.is_some()
    }

    /// The name of the class with this index.
    ///
    /// # Panics
    /// There is no such class.
    pub fn name(&self, class: usize) -> &str {
        &self.names.as_ref().expect("values are of classes")[class]
    }

    /// Takes a new prediction: its class with its probability, if values are logits of classes.
    pub fn update(&mut self, values: &[f32]) -> Option<(usize, f32)> {
        self.largest = None;
        if values.len() != self.names.as_ref()?.len() {
            return None;
        }
        self.probabilities.clear();
        self.probabilities.extend_from_slice(values);
        softmax(&mut self.probabilities);
        self.largest = largest(values);
        self.largest.map(|class| (class, self.probabilities[class]))
    }

    /// Class and probabilities of the newest prediction.
    pub fn answer(&self) -> Option<Answer<'_>> {
        let class = self.name(self.largest?);
        Some(Answer { class, probabilities: Values(&self.probabilities) })
    }
}
