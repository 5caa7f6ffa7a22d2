//! The result of a case, and the promises that it breaks.

use meissner_engine::EngineError;
use meissner_reference::Difference;
use meissner_run::error::chain;
use serde::Serialize;

/// Largest relative error of a prediction against f64, unless a case states another.
pub(super) const WITHIN: f64 = 1e-4;

/// How long cases are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) events: usize,
    pub(super) frames: u64,
    /// Passes of timing.
    pub(super) passes: usize,
}

/// The values that a case must produce.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Expect {
    /// Finite values.
    Finite,
    /// Values beyond f32: infinite predictions, or a layer that reports NaN.
    Overflow,
}

/// Differences of predictions from f64.
#[derive(Clone, Debug, Serialize)]
pub struct Errors {
    /// Largest.
    pub absolute: f64,
    /// Largest, as a share of the largest magnitude.
    pub relative: f64,
    /// Root mean square.
    pub rms: f64,
}

impl From<&Difference> for Errors {
    fn from(difference: &Difference) -> Self {
        Self { absolute: difference.absolute, relative: difference.relative(), rms: difference.rms() }
    }
}

/// A layer and the largest difference of its values from f64, as a share of its largest magnitude.
#[derive(Clone, Debug, Serialize)]
pub struct LayerError {
    /// The layer.
    pub layer: String,
    /// The share.
    pub relative: f64,
}

/// The result of a case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CaseResult {
    /// Group of the case.
    pub group: &'static str,
    /// Name of the case.
    pub case: &'static str,
    /// The network.
    pub network: String,
    /// Events that entered, or frames.
    pub steps: u64,
    /// Predictions that were compared with those of a full recomputation.
    pub compared: u64,
    /// Of these, those with other bits or another error.
    pub different: u64,
    /// Predictions that were refused because a layer computed NaN.
    pub refused: u64,
    /// The first reason for which a prediction was refused.
    pub refusal: Option<String>,
    /// Values of predictions that are NaN.
    pub not_numbers: u64,
    /// Values of predictions that are infinite.
    pub infinite: u64,
    /// Values of layers that are infinite where a prediction was given.
    pub infinite_inside: u64,
    /// Differences of predictions from f64; `None` without predictions.
    pub prediction: Option<Errors>,
    /// The layer with the largest relative difference, of networks over events.
    pub layer: Option<LayerError>,
    /// Largest finite magnitude of any activation.
    pub largest_activation: f64,
    /// Microseconds of an event or a frame with its prediction.
    pub us: Option<f64>,
    /// The same as a multiple of the ordinary case's.
    pub times_ordinary: Option<f64>,
    /// Promises that are broken.
    pub broken: Vec<String>,
}

impl CaseResult {
    /// Counts a prediction and the one of a full recomputation: they are equal if their bits or their errors are.
    pub(super) fn compare(
        &mut self,
        got: &Result<Vec<f32>, EngineError>,
        want: &Result<Vec<f32>, EngineError>,
    ) {
        self.compared += 1;
        self.different += u64::from(crate::Difference::of_predictions(got, want).is_err());
        match got {
            Ok(values) => {
                self.not_numbers += values.iter().filter(|v| v.is_nan()).count() as u64;
                self.infinite += values.iter().filter(|v| v.is_infinite()).count() as u64;
            }
            Err(error) => {
                self.refused += 1;
                self.refusal.get_or_insert_with(|| chain(error));
            }
        }
    }

    /// The same with the promises that are broken. The relative error against f64 may be `within`.
    pub(super) fn judge(mut self, expect: Expect, within: f64) -> Self {
        let mut broken = Vec::new();
        if self.different > 0 {
            broken.push(format!(
                "{} of {} predictions are not those of a full recomputation",
                self.different, self.compared
            ));
        }
        if self.not_numbers > 0 {
            broken.push(format!("{} predicted values are NaN", self.not_numbers));
        }
        let overflowed = self.refused + self.infinite + self.infinite_inside > 0;
        match expect {
            Expect::Finite if overflowed => {
                let why = self.refusal.clone().unwrap_or_else(|| "infinite values".to_owned());
                broken.push(format!("finite predictions were expected: {why}"));
            }
            Expect::Overflow if !overflowed => broken.push("an overflow was expected".to_owned()),
            _ => {}
        }
        if expect == Expect::Finite && self.compared == 0 {
            broken.push("nothing was compared".to_owned());
        }
        if expect == Expect::Finite
            && let Some(errors) = &self.prediction
            && (errors.relative > within || errors.relative.is_nan())
        {
            broken.push(format!("relative error {:.1e}, expected at most {within:.0e}", errors.relative));
        }
        self.broken = broken;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(got: &[f32], want: &[f32]) -> CaseResult {
        let mut result = CaseResult::default();
        result.compare(&Ok(got.to_vec()), &Ok(want.to_vec()));
        result
    }

    #[test]
    fn other_bits_break_a_promise() {
        assert!(result(&[1.0], &[1.0]).judge(Expect::Finite, 1.0).broken.is_empty());
        assert_eq!(result(&[0.0], &[-0.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
        assert_eq!(result(&[1.0], &[1.0, 1.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
    }

    #[test]
    fn infinite_values_must_be_expected() {
        let infinite = || result(&[f32::INFINITY], &[f32::INFINITY]);
        assert_eq!(infinite().judge(Expect::Finite, 1.0).broken.len(), 1);
        assert!(infinite().judge(Expect::Overflow, 1.0).broken.is_empty());
        assert_eq!(result(&[1.0], &[1.0]).judge(Expect::Overflow, 1.0).broken.len(), 1);
    }

    #[test]
    fn a_predicted_nan_breaks_a_promise_even_where_an_overflow_is_expected() {
        assert_eq!(result(&[f32::NAN], &[f32::NAN]).judge(Expect::Overflow, 1.0).broken.len(), 2);
    }

    #[test]
    fn an_error_beyond_the_bound_breaks_a_promise() {
        let mut result = result(&[1.0], &[1.0]);
        result.prediction = Some(Errors { absolute: 1e-3, relative: 1e-3, rms: 1e-3 });
        assert!(result.clone().judge(Expect::Finite, 1e-2).broken.is_empty());
        assert_eq!(result.judge(Expect::Finite, 1e-4).broken.len(), 1);
    }
}
