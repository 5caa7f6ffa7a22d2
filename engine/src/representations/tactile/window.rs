//! Sequences of readings.
//!
//! Enters: a reading at a time. Leaves: complete windows of `steps` readings or images, oldest
//! first. Invariant: `values` begins with the `filled` ones of the open window.

use crate::representations::RepresentationError;
use crate::representations::tactile::layout::{
    ELECTRODES, TACTILE_CELLS, TACTILE_COLUMNS, TACTILE_ROWS, TactileLayout,
};
use crate::representations::tactile::scaling::{Scaling, by_own_range, scaled};

/// The readings that form a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Windows of consecutive readings that do not overlap: one decision per `steps` readings.
    #[default]
    Consecutive,
    /// The last `steps` readings: one decision per reading once there are as many.
    Sliding,
    /// Every `stride`th reading from the first on, in disjoint windows; others are skipped.
    Step {
        /// From one reading that is taken to the next.
        stride: usize,
    },
}

/// The form of a reading in a sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TactileForm {
    /// An image of 12 x 11.
    #[default]
    Image,
    /// The values as they are: 24, or 48 by [`Scaling::ReadingAndRange`].
    Reading,
}

/// A complete window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TactileSequence<'a> {
    /// (steps, 12, 11) for images, (steps, 1, 24) for readings, (steps, 1, 48) if scaled twice.
    pub shape: [usize; 3],
    /// Values, row-major, the oldest step first.
    pub values: &'a [f32],
    /// The place of the last reading among all since the last reset, counted from 0.
    pub reading: u64,
}

/// Collects readings into windows.
///
/// A reading costs O(1): 204 additions for an image, and for sliding windows a move of `steps`
/// images. Nothing is allocated later.
#[derive(Clone, Debug)]
pub struct TactileWindow {
    steps: usize,
    sampling: Sampling,
    scaling: Scaling,
    form: TactileForm,
    layout: TactileLayout,
    values: Vec<f32>,
    /// Steps of the open window.
    filled: usize,
    /// Readings since the last reset.
    readings: u64,
}

impl TactileWindow {
    /// Windows of `steps` readings, made into `form`.
    ///
    /// # Errors
    /// Steps not from 1 to 65,536, a stride of 0, an empty range, images scaled twice.
    pub fn new(
        steps: usize,
        sampling: Sampling,
        scaling: Scaling,
        form: TactileForm,
    ) -> Result<Self, RepresentationError> {
        if !(1..=1 << 16).contains(&steps) {
            return Err(RepresentationError::option("steps", "1 to 65536", steps));
        }
        if sampling == (Sampling::Step { stride: 0 }) {
            return Err(RepresentationError::option("stride", "at least 1", 0));
        }
        scaling.check()?;
        if form == TactileForm::Image && scaling.values() != ELECTRODES {
            let expected = "one that gives an image one value for each electrode";
            return Err(RepresentationError::option("scaling", expected, "both by reading and by range"));
        }
        let len = match form {
            TactileForm::Image => TACTILE_CELLS,
            TactileForm::Reading => scaling.values(),
        };
        Ok(Self {
            steps,
            sampling,
            scaling,
            form,
            layout: TactileLayout::new(),
            values: vec![0.0; steps * len],
            filled: 0,
            readings: 0,
        })
    }

    /// Takes the next reading, and returns the window that it completes, if it does.
    ///
    /// # Errors
    /// A value that is not finite, or becomes so by a fixed range. The reading is not taken.
    pub fn push(
        &mut self,
        reading: &[f32; ELECTRODES],
    ) -> Result<Option<TactileSequence<'_>>, RepresentationError> {
        let scaled = self.admit(reading)?;
        let place = self.readings;
        self.readings += 1;
        if let Sampling::Step { stride } = self.sampling
            && !place.is_multiple_of(stride as u64)
        {
            return Ok(None);
        }
        let len = self.values.len() / self.steps;
        if self.filled == self.steps {
            if self.sampling == Sampling::Sliding {
                self.values.copy_within(len.., 0);
                self.filled -= 1;
            } else {
                self.filled = 0;
            }
        }
        let step = &mut self.values[self.filled * len..][..len];
        match self.form {
            TactileForm::Reading => {
                let (own, last) = step.split_at_mut(len - ELECTRODES);
                last.copy_from_slice(&scaled);
                if !own.is_empty() {
                    own.copy_from_slice(reading);
                    by_own_range(own);
                }
            }
            // A step is one image.
            TactileForm::Image => {
                step.as_chunks_mut().0.iter_mut().for_each(|image| self.layout.image(&scaled, image));
            }
        }
        if self.scaling == Scaling::PerImage {
            by_own_range(step);
        }
        self.filled += 1;
        Ok((self.filled == self.steps).then(|| TactileSequence {
            shape: self.shape(),
            values: &self.values,
            reading: place,
        }))
    }

    /// The shape of every sequence, as [`TactileSequence::shape`].
    pub fn shape(&self) -> [usize; 3] {
        match self.form {
            TactileForm::Image => [self.steps, TACTILE_ROWS, TACTILE_COLUMNS],
            TactileForm::Reading => [self.steps, 1, self.scaling.values()],
        }
    }

    /// Forgets all readings: the next is the first of a window.
    pub fn reset(&mut self) {
        self.filled = 0;
        self.readings = 0;
    }

    /// The reading, scaled where that precedes layout; of two scalings by the second. A range is
    /// the same for all cells, and what it makes infinite is found before it enters a mean.
    fn admit(&self, reading: &[f32; ELECTRODES]) -> Result<[f32; ELECTRODES], RepresentationError> {
        if let Some(electrode) = reading.iter().position(|value| !value.is_finite()) {
            return Err(RepresentationError::Reading { electrode, value: reading[electrode] });
        }
        let mut out = *reading;
        match self.scaling {
            Scaling::PerImage => {}
            Scaling::PerReading => by_own_range(&mut out),
            Scaling::Range { minimum, maximum } | Scaling::ReadingAndRange { minimum, maximum } => {
                for (electrode, out) in out.iter_mut().enumerate() {
                    let value = *out;
                    *out = scaled(value, minimum, maximum);
                    if !out.is_finite() {
                        return Err(RepresentationError::Scaled { electrode, value, minimum, maximum });
                    }
                }
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Scaling = Scaling::Range { minimum: 0.0, maximum: 1.0 };

    /// The first value of each step of every window over readings 0, 1, 2, ...
    fn windows(steps: usize, sampling: Sampling, readings: u16) -> Vec<(u64, Vec<f32>)> {
        let mut window = TactileWindow::new(steps, sampling, UNIT, TactileForm::Reading).expect("admissible");
        let mut out = vec![];
        for i in 0..readings {
            if let Some(sequence) = window.push(&[f32::from(i); ELECTRODES]).expect("finite") {
                let firsts = sequence.values.iter().copied().step_by(ELECTRODES).collect();
                out.push((sequence.reading, firsts));
            }
        }
        out
    }

    #[test]
    fn consecutive_windows_do_not_overlap() {
        let expected = [(2, vec![0.0, 1.0, 2.0]), (5, vec![3.0, 4.0, 5.0])];
        assert_eq!(windows(3, Sampling::Consecutive, 8), expected);
    }

    #[test]
    fn a_sliding_window_decides_at_every_reading() {
        let expected = [(2, vec![0.0, 1.0, 2.0]), (3, vec![1.0, 2.0, 3.0]), (4, vec![2.0, 3.0, 4.0])];
        assert_eq!(windows(3, Sampling::Sliding, 5), expected);
        assert_eq!(windows(1, Sampling::Sliding, 2), [(0, vec![0.0]), (1, vec![1.0])]);
    }

    #[test]
    fn a_stride_passes_over_the_readings_between() {
        let expected = [(3, vec![0.0, 3.0]), (9, vec![6.0, 9.0])];
        assert_eq!(windows(2, Sampling::Step { stride: 3 }, 12), expected);
        assert_eq!(windows(2, Sampling::Step { stride: 1 }, 5), windows(2, Sampling::Consecutive, 5));
    }

    #[test]
    fn an_image_is_scaled_by_its_own_minimum_and_maximum() {
        let mut window = TactileWindow::new(1, Sampling::Sliding, Scaling::PerImage, TactileForm::Image);
        let window = window.as_mut().expect("admissible");
        let reading: [f32; ELECTRODES] = std::array::from_fn(|i| 100.0 + i as f32);
        let sequence = window.push(&reading).expect("finite").expect("one step");
        assert_eq!(sequence.shape, [1, 12, 11]);
        assert_eq!(sequence.values[1], 0.0);
        assert_eq!(sequence.values[5 * TACTILE_COLUMNS + 5], 1.0);
        assert!(sequence.values.iter().all(|value| (0.0..=1.0).contains(value)));
        let sequence = window.push(&[0.1; ELECTRODES]).expect("finite").expect("one step");
        assert_eq!(sequence.values, [0.0; TACTILE_CELLS]);
    }

    #[test]
    fn values_beyond_a_range_lie_beyond_0_and_1() {
        let range = Scaling::Range { minimum: 100.0, maximum: 300.0 };
        let mut window =
            TactileWindow::new(1, Sampling::Sliding, range, TactileForm::Reading).expect("admissible");
        let mut reading = [200.0; ELECTRODES];
        (reading[0], reading[1]) = (0.0, 500.0);
        let sequence = window.push(&reading).expect("finite").expect("one step");
        assert_eq!((sequence.shape, &sequence.values[..3]), ([1, 1, 24], &[-0.5, 2.0, 0.5][..]));
    }

    #[test]
    fn a_reading_scaled_twice_shows_its_own_range_and_then_the_fixed_one() {
        let both = Scaling::ReadingAndRange { minimum: 100.0, maximum: 300.0 };
        let mut window =
            TactileWindow::new(2, Sampling::Sliding, both, TactileForm::Reading).expect("admissible");
        let mut reading = [150.0; ELECTRODES];
        (reading[0], reading[1]) = (100.0, 200.0);
        assert_eq!(window.push(&reading), Ok(None));
        let sequence = window.push(&[200.0; ELECTRODES]).expect("finite").expect("two steps");
        assert_eq!(sequence.shape, [2, 1, 48]);
        let (first, second) = sequence.values.split_at(48);
        assert_eq!((&first[..3], &first[24..27]), (&[0.0, 1.0, 0.5][..], &[0.0, 0.5, 0.25][..]));
        assert_eq!(second, [[0.0; 24], [0.5; 24]].concat());
    }

    #[test]
    fn an_image_cannot_be_scaled_twice() {
        let both = Scaling::ReadingAndRange { minimum: 0.0, maximum: 1.0 };
        let error = TactileWindow::new(1, Sampling::Sliding, both, TactileForm::Image).expect_err("an image");
        assert_eq!(
            error.to_string(),
            "scaling: expected one that gives an image one value for each electrode, found both by reading and by range"
        );
    }

    #[test]
    fn a_reading_that_is_not_finite_is_refused_and_not_taken() {
        let narrow = Scaling::Range { minimum: 0.0, maximum: 1e-30 };
        let mut window =
            TactileWindow::new(2, Sampling::Consecutive, narrow, TactileForm::Image).expect("admissible");
        assert_eq!(window.push(&[0.0; ELECTRODES]), Ok(None));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            let mut reading = [0.0; ELECTRODES];
            reading[7] = bad;
            let error = window.push(&reading).expect_err("not finite");
            assert!(error.to_string().starts_with("electrode 7: expected a "), "{error}");
        }
        let sequence = window.push(&[1e-30; ELECTRODES]).expect("finite").expect("the second step");
        assert_eq!((sequence.reading, sequence.values[0], sequence.values[TACTILE_CELLS]), (1, 0.0, 1.0));
    }

    #[test]
    fn options_out_of_range_are_refused() {
        for (steps, sampling) in
            [(0, Sampling::Sliding), (1 << 17, Sampling::Sliding), (5, Sampling::Step { stride: 0 })]
        {
            assert!(TactileWindow::new(steps, sampling, UNIT, TactileForm::Image).is_err());
        }
    }
}
