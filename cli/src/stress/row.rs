//! What a case gave, and which promises it broke.

use meissner_engine::EngineError;
use meissner_reference::Difference;
use serde::Serialize;

use meissner_pipeline::error::chain;

/// What a case is meant to end in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Expect {
    /// Finite values.
    Finite,
    /// More than f32 holds: infinite predictions, or a layer that reports NaN.
    Overflow,
}

/// Differences from f64.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Errors {
    /// Largest.
    pub(super) absolute: f64,
    /// Largest, as a share of the largest magnitude.
    pub(super) relative: f64,
    /// Root mean square.
    pub(super) rms: f64,
}

impl From<&Difference> for Errors {
    fn from(difference: &Difference) -> Self {
        Self { absolute: difference.absolute, relative: difference.relative(), rms: difference.rms() }
    }
}

/// A layer and the largest difference of its values from f64, as a share of its largest magnitude.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LayerError {
    pub(super) layer: String,
    pub(super) relative: f64,
}

/// What a case gave.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) group: &'static str,
    pub(super) case: &'static str,
    pub(super) network: String,
    /// Events that entered, or frames.
    pub(super) steps: u64,
    /// Predictions that were compared with those of a full recomputation.
    pub(super) compared: u64,
    /// Of these, those with other bits or another error.
    pub(super) different: u64,
    /// Predictions that were refused because a layer computed NaN.
    pub(super) refused: u64,
    /// Why something was refused, the first time.
    pub(super) refusal: Option<String>,
    /// Values of predictions that are NaN.
    pub(super) not_numbers: u64,
    /// Values of predictions that are infinite.
    pub(super) infinite: u64,
    /// Values of layers that are infinite where a prediction was given.
    pub(super) infinite_inside: u64,
    /// Of predictions; none where no prediction was given.
    pub(super) prediction: Option<Errors>,
    /// The layer that is furthest off, of networks over events.
    pub(super) layer: Option<LayerError>,
    /// Largest finite magnitude of any activation.
    pub(super) largest_activation: f64,
    /// Microseconds of an event or a frame with its prediction.
    pub(super) us: Option<f64>,
    /// That, as a multiple of the ordinary case's.
    pub(super) times_ordinary: Option<f64>,
    /// Promises that are broken.
    pub(super) broken: Vec<String>,
}

impl Row {
    pub(super) fn new(group: &'static str, case: &'static str, network: impl Into<String>) -> Self {
        Self {
            group,
            case,
            network: network.into(),
            steps: 0,
            compared: 0,
            different: 0,
            refused: 0,
            refusal: None,
            not_numbers: 0,
            infinite: 0,
            infinite_inside: 0,
            prediction: None,
            layer: None,
            largest_activation: 0.0,
            us: None,
            times_ordinary: None,
            broken: Vec::new(),
        }
    }

    /// Counts a prediction beside that of a full recomputation: equal where the bits, or the errors, are.
    pub(super) fn compare(
        &mut self,
        got: &Result<Vec<f32>, EngineError>,
        want: &Result<Vec<f32>, EngineError>,
    ) {
        let equal = match (got, want) {
            (Ok(got), Ok(want)) => same_bits(got, want),
            (Err(got), Err(want)) => got == want,
            _ => false,
        };
        self.compared += 1;
        self.different += u64::from(!equal);
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

    /// Notes which promises are broken, where predictions may be `within` of f64.
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

/// Whether both are the same bits.
pub(super) fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(got: &[f32], want: &[f32]) -> Row {
        let mut row = Row::new("streams", "a case", "a network");
        row.compare(&Ok(got.to_vec()), &Ok(want.to_vec()));
        row
    }

    #[test]
    fn other_bits_break_a_promise() {
        assert!(row(&[1.0], &[1.0]).judge(Expect::Finite, 1.0).broken.is_empty());
        assert_eq!(row(&[0.0], &[-0.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
        assert_eq!(row(&[1.0], &[1.0, 1.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
    }

    #[test]
    fn what_is_not_finite_must_be_expected() {
        let infinite = || row(&[f32::INFINITY], &[f32::INFINITY]);
        assert_eq!(infinite().judge(Expect::Finite, 1.0).broken.len(), 1);
        assert!(infinite().judge(Expect::Overflow, 1.0).broken.is_empty());
        assert_eq!(row(&[1.0], &[1.0]).judge(Expect::Overflow, 1.0).broken.len(), 1);
    }

    #[test]
    fn a_predicted_nan_breaks_a_promise_even_where_an_overflow_is_expected() {
        assert_eq!(row(&[f32::NAN], &[f32::NAN]).judge(Expect::Overflow, 1.0).broken.len(), 2);
    }

    #[test]
    fn an_error_beyond_the_bound_breaks_a_promise() {
        let mut row = row(&[1.0], &[1.0]);
        row.prediction = Some(Errors { absolute: 1e-3, relative: 1e-3, rms: 1e-3 });
        assert!(row.clone().judge(Expect::Finite, 1e-2).broken.is_empty());
        assert_eq!(row.judge(Expect::Finite, 1e-4).broken.len(), 1);
    }
}
