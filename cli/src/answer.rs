//! Predictions in the words of their network: classes with probabilities, or values with names and units.

use meissner_evaluate::metrics::largest;
use meissner_kernels::softmax;
use serde::Serialize;

use crate::run::json::Values;
use meissner_pipeline::provenance::ModelCard;

/// Most columns of values that a line of 80 characters has room for beside counts and times.
const MOST_COLUMNS: usize = 2;
/// Width of a column of values.
const WIDTH: usize = 11;

/// What the values of a network are called, and room for their probabilities.
#[derive(Default)]
pub(crate) struct Answers {
    headings: Vec<String>,
    classes: Option<Vec<String>>,
    probabilities: Vec<f32>,
}

/// What a prediction says; its keys stand beside `value`.
#[derive(Serialize)]
pub(crate) struct Answer<'a> {
    /// The most probable class.
    pub(crate) class: &'a str,
    /// Softmax of the values.
    pub(crate) probabilities: Values<'a>,
}

impl Answers {
    pub(crate) fn new(model: &ModelCard) -> Self {
        Self { headings: model.headings(), classes: model.classes.clone(), probabilities: Vec::new() }
    }

    /// Class and probabilities of `values`; `None` where they are not logits of classes.
    pub(crate) fn of(&mut self, values: &[f32]) -> Option<Answer<'_>> {
        let classes = self.classes.as_ref()?;
        if values.len() != classes.len() {
            return None;
        }
        self.probabilities.clear();
        self.probabilities.extend_from_slice(values);
        softmax(&mut self.probabilities);
        let class = largest(values)?;
        Some(Answer { class: &classes[class], probabilities: Values(&self.probabilities) })
    }

    /// The headings of [`Self::columns`], each after two spaces.
    pub(crate) fn headings(&self) -> String {
        if self.classes.is_some() {
            return format!("  {:>WIDTH$}  {:>WIDTH$}", "class", "probability");
        }
        let headings = self.headings.iter().take(MOST_COLUMNS);
        headings.map(|heading| format!("  {heading:>WIDTH$}")).collect::<Vec<_>>().concat()
    }

    /// What stands under the headings for `values`.
    pub(crate) fn columns(&mut self, values: &[f32]) -> String {
        if self.classes.is_none() {
            let values = values.iter().take(MOST_COLUMNS);
            return values.map(|value| format!("  {value:>WIDTH$.6}")).collect::<Vec<_>>().concat();
        }
        self.of(values).map_or_else(String::new, |Answer { class, probabilities }| {
            let probability = probabilities.0.iter().copied().fold(0.0, f32::max);
            format!("  {class:>WIDTH$}  {probability:>WIDTH$.4}")
        })
    }

    /// What is not shown to people, as a line; nothing where all is.
    pub(crate) fn left_out(&self) -> Option<String> {
        let all = self.headings.len();
        let some = self.classes.is_none() && all > MOST_COLUMNS;
        some.then(|| format!("({MOST_COLUMNS} of {all} outputs shown; --json has all of them)"))
    }
}
