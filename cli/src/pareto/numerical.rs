//! How far an approximation's values are from the exact ones.
//!
//! ```text
//! max = max |a - e|     rms = sqrt(mean (a - e)^2)     relative rms = rms / sqrt(mean e^2)
//! ```
//!
//! over all values a of an approximation and e of the exact network at the same moments, summed in f64 in the order of the
//! moments, and the first two for each tenth of a stream, too: an error that grows with time shows in the last.

use serde::{Deserialize, Serialize};

/// Parts into which each stream is cut.
pub(super) const PARTS: usize = 10;

/// The differences so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Differences {
    parts: [Sum; PARTS],
    /// Sum of the squares of the exact values.
    exact: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u64,
    squares: f64,
    max: f64,
}

/// What they come to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Numerical {
    pub(super) max: f64,
    pub(super) rms: f64,
    /// `rms` as a share of the exact values' own; none where these are all 0.
    pub(super) relative_rms: Option<f64>,
    /// Of each tenth of a stream; none of one without values.
    pub(super) max_by_tenth: Vec<Option<f64>>,
    pub(super) rms_by_tenth: Vec<Option<f64>>,
}

impl Differences {
    /// The values `found` and `exact` at moment `place` of the `count` of a stream.
    pub(super) fn add(&mut self, (place, count): (usize, usize), exact: &[f32], found: &[f32]) {
        let part = &mut self.parts[place * PARTS / count];
        for (&exact, &found) in exact.iter().zip(found) {
            let difference = f64::from(found) - f64::from(exact);
            part.count += 1;
            part.squares += difference * difference;
            part.max = part.max.max(difference.abs());
            self.exact += f64::from(exact) * f64::from(exact);
        }
    }

    pub(super) fn finish(&self) -> Numerical {
        let all = self.parts.iter().fold(Sum::default(), |all, part| Sum {
            count: all.count + part.count,
            squares: all.squares + part.squares,
            max: all.max.max(part.max),
        });
        let seen = |part: &&Sum| part.count > 0;
        Numerical {
            max: all.max,
            rms: all.rms(),
            relative_rms: (self.exact > 0.0).then(|| (all.squares / self.exact).sqrt()),
            max_by_tenth: self
                .parts
                .iter()
                .map(|part| Some(part).filter(seen).map(|part| part.max))
                .collect(),
            rms_by_tenth: self.parts.iter().map(|part| Some(part).filter(seen).map(Sum::rms)).collect(),
        }
    }
}

impl Sum {
    fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.squares / self.count as f64).sqrt() }
    }
}

impl Numerical {
    /// The one figure by which settings without labels are compared.
    pub(super) fn compared(&self) -> f64 {
        self.relative_rms.unwrap_or(self.rms)
    }
}

#[cfg(test)]
mod tests {
    use super::Differences;

    #[test]
    fn equal_values_have_no_error() {
        let mut differences = Differences::default();
        (0..7).for_each(|place| differences.add((place, 7), &[1.5, -2.0], &[1.5, -2.0]));
        let numerical = differences.finish();
        assert_eq!((numerical.max, numerical.rms, numerical.relative_rms), (0.0, 0.0, Some(0.0)));
    }

    #[test]
    fn an_error_shows_in_its_tenth_of_the_stream() {
        let mut differences = Differences::default();
        (0..20).for_each(|place| {
            let found = if place == 19 { 5.0 } else { 2.0 };
            differences.add((place, 20), &[2.0], &[found]);
        });
        let numerical = differences.finish();
        assert_eq!(numerical.max, 3.0);
        assert!((numerical.rms - (9.0_f64 / 20.0).sqrt()).abs() < 1e-12);
        assert!((numerical.compared() - (9.0_f64 / 80.0).sqrt()).abs() < 1e-12);
        assert_eq!(numerical.max_by_tenth[..9], [Some(0.0); 9]);
        assert!(numerical.rms_by_tenth[9].is_some_and(|rms| (rms - 4.5_f64.sqrt()).abs() < 1e-12));
    }

    #[test]
    fn a_share_of_nothing_is_none_and_a_tenth_without_values_too() {
        let mut differences = Differences::default();
        differences.add((0, 1), &[0.0], &[0.5]);
        let numerical = differences.finish();
        assert_eq!((numerical.relative_rms, numerical.compared()), (None, 0.5));
        assert_eq!(numerical.rms_by_tenth[1..], [None; 9]);
    }
}
