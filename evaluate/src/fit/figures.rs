//! Errors of predictions for held-out presses, and the advice that follows from them.

use libm::{exp, log};
use meissner_kernels::random::Random;
use serde::Serialize;

use super::heads::Choice;

/// Number of resamples for an interval.
const RESAMPLES: usize = 1_000;
/// Number of groups of ages.
const AGES: usize = 8;
/// A smaller relative gain is not worth more presses.
const WORTH: f64 = 0.03;

/// A mean over presses, with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The mean.
    pub mean: f64,
    /// The interval that contains it in 95 % of resamples of the presses.
    pub interval: [f64; 2],
}

/// Errors of heads that were fitted to some of the presses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct CurvePoint {
    /// Number of presses that a head was fitted to; the rest was held out.
    pub presses: usize,
    pub error: Figure,
}

/// Errors at ages of a press.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct AgeFigure {
    /// From this time since the first event of a press.
    pub from_us: i64,
    /// To this time, inclusive.
    pub until_us: i64,
    pub instants: usize,
    pub error: f64,
}

/// Figures of an output, or of all classes together.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct OutputFigures {
    pub name: String,
    /// Unit of the errors; "share" for classes, whose error is the share of wrong ones.
    pub unit: String,
    /// Relative strength of the regularisation.
    pub strength: f64,
    /// Factor of the products of modes; 0 for none.
    pub products: f64,
    /// Width of a Gaussian kernel of the modes; 0 for none.
    pub width: f64,
    /// Mean absolute error at the ends of presses that were held out.
    pub error: Figure,
    /// The same of the mean of the labels, or of the most frequent class.
    pub constant: Figure,
    /// The same of the original network, if it predicts this output.
    pub before: Option<Figure>,
    /// By how much the error is below that of the constant.
    pub gain: Figure,
    /// Whether the whole interval of the gain is above 0.
    pub in_events: bool,
    /// A quarter, a half, and all presses.
    pub curve: Vec<CurvePoint>,
    /// The expected error with twice as many presses; `None` if it cannot be estimated.
    pub error_with_twice: Option<f64>,
    /// Errors by age.
    pub ages: Vec<AgeFigure>,
    /// The advice that follows, in a sentence.
    pub advice: String,
}

/// The errors of an output at the ends, by presses.
pub(super) struct Errors {
    pub(super) own: Vec<f64>,
    pub(super) constant: Vec<f64>,
    pub(super) before: Option<Vec<f64>>,
    /// Number of presses and errors of the heads that were fitted to fewer presses.
    pub(super) fewer: Vec<(usize, Vec<f64>)>,
    /// Presses that the heads were fitted to.
    pub(super) presses: usize,
    /// Age and error at all instants.
    pub(super) at: Vec<(i64, f64)>,
}

impl Figure {
    /// The mean of `values`, at least one; `seed` chooses the resamples.
    pub(super) fn of(values: &[f64], seed: u64) -> Self {
        let count = values.len() as f64;
        let mut random = Random::new(seed);
        let mut means: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                let drawn = values.iter().map(|_| values[random.below(values.len() as u64) as usize]);
                drawn.sum::<f64>() / count
            })
            .collect();
        means.sort_by(f64::total_cmp);
        let tail = RESAMPLES / 40;
        Self {
            mean: values.iter().sum::<f64>() / count,
            interval: [means[tail], means[RESAMPLES - 1 - tail]],
        }
    }
}

impl OutputFigures {
    pub(super) fn new((name, unit): (&str, &str), choice: Choice, errors: &Errors, seed: u64) -> Self {
        let difference = |from: &[f64], of: &[f64]| -> Vec<f64> {
            from.iter().zip(of).map(|(from, of)| from - of).collect()
        };
        let error = Figure::of(&errors.own, seed);
        let gain = Figure::of(&difference(&errors.constant, &errors.own), seed);
        let fewer = errors.fewer.iter();
        let mut curve: Vec<CurvePoint> = fewer
            .map(|(presses, of)| CurvePoint { presses: *presses, error: Figure::of(of, seed) })
            .collect();
        curve.push(CurvePoint { presses: errors.presses, error });
        let halved = errors.fewer.last().map(|(presses, of)| {
            let falls = Figure::of(&difference(of, &errors.own), seed).interval[0] > 0.0;
            (*presses, of.iter().sum::<f64>() / of.len() as f64, falls)
        });
        // A power of the number of presses, through the last two points.
        let error_with_twice =
            halved.filter(|(_, half, _)| *half > 0.0 && error.mean > 0.0).map(|(presses, half, _)| {
                let power = log(error.mean / half) / log(errors.presses as f64 / presses as f64);
                error.mean * exp(power * log(2.0))
            });
        let in_events = gain.interval[0] > 0.0;
        let falls = halved.is_some_and(|(.., falls)| falls);
        let advice = advice(
            name,
            unit,
            in_events,
            falls.then_some(error_with_twice).flatten(),
            error.mean,
            halved.is_some(),
        );
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            strength: choice.strength,
            products: choice.products,
            width: choice.width,
            error,
            constant: Figure::of(&errors.constant, seed),
            before: errors.before.as_ref().map(|of| Figure::of(of, seed)),
            gain,
            in_events,
            curve,
            error_with_twice,
            ages: ages(&errors.at),
            advice,
        }
    }
}

/// `twice` is the error with twice as many presses, if it falls.
fn advice(name: &str, unit: &str, in_events: bool, twice: Option<f64>, error: f64, known: bool) -> String {
    let more = match twice {
        Some(twice) if twice < (1.0 - WORTH) * error => {
            format!("more presses would help: twice as many would give about {twice:.3} {unit}")
        }
        _ if known => "twice as many presses would help little".to_owned(),
        _ => "there are too few presses to say whether more would help".to_owned(),
    };
    if in_events {
        format!("{name}: {more}")
    } else {
        format!("{name} is not in the events, or not in the readout: no better than a constant; {more}")
    }
}

/// Mean errors of up to [`AGES`] groups of as many instants each, by age.
fn ages(at: &[(i64, f64)]) -> Vec<AgeFigure> {
    let mut at = at.to_vec();
    at.sort_by_key(|(age, _)| *age);
    let of_group = |group: &[(i64, f64)]| AgeFigure {
        from_us: group[0].0,
        until_us: group[group.len() - 1].0,
        instants: group.len(),
        error: group.iter().map(|(_, error)| error).sum::<f64>() / group.len() as f64,
    };
    at.chunks(at.len().div_ceil(AGES).max(1)).map(of_group).collect()
}
