//! Scaling of readings to the range from 0 to 1.
//!
//! scaled = (value - minimum) / (maximum - minimum), in f64, rounded once; 0 where both are equal.

use crate::representations::RepresentationError;
use crate::representations::tactile::layout::ELECTRODES;

/// Which minimum and maximum become 0 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scaling {
    /// Those of each image, after layout (the slip paper's published preparation). Without images
    /// those of each reading: means lie between the values that they are taken of.
    #[default]
    PerImage,
    /// Fixed ones, such as a training set's (the slip paper's text), before layout. Values beyond
    /// them lie beyond 0 and 1.
    Range {
        /// What becomes 0.
        minimum: f32,
        /// What becomes 1.
        maximum: f32,
    },
    /// Those of the 24 electrodes of each reading, before it is laid out.
    PerReading,
    /// Both, for readings without layout: the 24 values by [`Self::PerReading`], then by
    /// [`Self::Range`]. The first show the distribution, the second also the strength.
    ReadingAndRange {
        /// What becomes 0 in the second half.
        minimum: f32,
        /// What becomes 1 in the second half.
        maximum: f32,
    },
}

impl Scaling {
    /// The range of all `readings`: scaling by the training set. `None` where it has no extent.
    pub fn range_of<'a>(readings: impl IntoIterator<Item = &'a [f32; ELECTRODES]>) -> Option<Self> {
        let (minimum, maximum) = bounds(readings.into_iter().flatten());
        (minimum < maximum).then_some(Self::Range { minimum, maximum })
    }

    /// Number of values of a reading that is not laid out: 24, or 48 where each is there twice.
    pub fn values(self) -> usize {
        match self {
            Self::PerImage | Self::Range { .. } | Self::PerReading => ELECTRODES,
            Self::ReadingAndRange { .. } => 2 * ELECTRODES,
        }
    }

    pub(super) fn check(self) -> Result<(), RepresentationError> {
        match self {
            Self::Range { minimum, maximum } | Self::ReadingAndRange { minimum, maximum }
                if !(minimum.is_finite() && maximum.is_finite() && minimum < maximum) =>
            {
                let found = format!("{minimum} to {maximum}");
                Err(RepresentationError::option("range", "a finite minimum below a finite maximum", found))
            }
            _ => Ok(()),
        }
    }
}

/// Scales `values` by their own minimum and maximum.
pub(super) fn by_own_range(values: &mut [f32]) {
    let (minimum, maximum) = bounds(&*values);
    values.iter_mut().for_each(|value| *value = scaled(*value, minimum, maximum));
}

/// `value`, where `minimum` becomes 0 and `maximum` 1.
pub(super) fn scaled(value: f32, minimum: f32, maximum: f32) -> f32 {
    let [value, minimum, maximum] = [value, minimum, maximum].map(f64::from);
    if minimum == maximum { 0.0 } else { ((value - minimum) / (maximum - minimum)) as f32 }
}

fn bounds<'a>(values: impl IntoIterator<Item = &'a f32>) -> (f32, f32) {
    let all = (f32::INFINITY, f32::NEG_INFINITY);
    values.into_iter().fold(all, |(minimum, maximum), &value| (minimum.min(value), maximum.max(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_value_becomes_0_and_the_largest_1() {
        let mut values = [3.0, -1.0, 7.0, 1.0];
        by_own_range(&mut values);
        assert_eq!(values, [0.5, 0.0, 1.0, 0.25]);
        let mut values = [f32::MAX, f32::MIN];
        by_own_range(&mut values);
        assert_eq!(values, [1.0, 0.0]);
    }

    #[test]
    fn equal_values_become_0() {
        let mut values = [42.0; 5];
        by_own_range(&mut values);
        assert_eq!(values, [0.0; 5]);
    }

    #[test]
    fn the_range_of_a_training_set_spans_all_its_readings() {
        let mut readings = [[5.0; ELECTRODES], [7.0; ELECTRODES]];
        readings[1][3] = -2.0;
        assert_eq!(Scaling::range_of(&readings), Some(Scaling::Range { minimum: -2.0, maximum: 7.0 }));
        assert_eq!(Scaling::range_of(&readings[..1]), None);
        assert_eq!(Scaling::range_of([]), None);
    }

    #[test]
    fn a_range_without_extent_is_refused() {
        for (minimum, maximum) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)] {
            assert!(Scaling::Range { minimum, maximum }.check().is_err());
            assert!(Scaling::ReadingAndRange { minimum, maximum }.check().is_err());
        }
    }
}
