//! Cuts readings into the windows that a network is trained and evaluated on.
//!
//! Enters: readings. Leaves: the frames of windows of `steps`, as the network's `[input]` says.
//! Windows are consecutive and disjoint, as in the paper, whatever sampling runs use; readings at
//! the end that fill none are left out.

use meissner_engine::representations::{
    ELECTRODES, Sampling, Scaling, TACTILE_COLUMNS, TACTILE_ROWS, TactileForm, TactileWindow,
};

use super::{CLASSES, SlipError};
use crate::systems::check_outputs;
use crate::{FrameDescription, FrameSource};

/// Cuts windows for a network.
#[derive(Clone, Debug)]
pub struct SlipWindows {
    window: TactileWindow,
    steps: usize,
    shape: &'static [usize],
}

impl SlipWindows {
    /// Cuts windows as `description` reads them.
    ///
    /// # Errors
    /// [`SlipError::NotReadings`], [`SlipError::Outputs`] for a network of another system.
    pub fn new(description: &FrameDescription) -> Result<Self, SlipError> {
        let (form, readings) = match *description.source() {
            FrameSource::TactileImage(readings) => (TactileForm::Image, readings),
            FrameSource::Electrodes(readings) => (TactileForm::Reading, readings),
            other => {
                let (network, found) = (description.name().to_owned(), other.word());
                return Err(SlipError::NotReadings { network, found });
            }
        };
        check_outputs(description.name(), description.outputs().0, &CLASSES)?;
        let window = TactileWindow::new(readings.steps, Sampling::Consecutive, readings.scaling, form)?;
        let shape: &[usize] = match (form, readings.scaling) {
            (TactileForm::Image, _) => &[1, TACTILE_ROWS, TACTILE_COLUMNS],
            (TactileForm::Reading, Scaling::ReadingAndRange { .. }) => &[2 * ELECTRODES],
            (TactileForm::Reading, _) => &[ELECTRODES],
        };
        Ok(Self { window, steps: readings.steps, shape })
    }

    /// Number of readings in a window.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// A frame's shape: (1, 12, 11) for images, (24) for readings, (48) if scaled twice.
    pub fn frame_shape(&self) -> &'static [usize] {
        self.shape
    }

    /// Number of values of a frame.
    pub fn frame_len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Appends the windows of `stretch` to `frames`, (windows, steps, frame), window k from reading
    /// k `steps`; returns their number.
    ///
    /// # Errors
    /// [`SlipError::Reading`] for a reading that is not finite or that the scaling makes infinite.
    pub fn cut<'a>(
        &mut self,
        stretch: impl IntoIterator<Item = &'a [f32; ELECTRODES]>,
        frames: &mut Vec<f32>,
    ) -> Result<usize, SlipError> {
        self.window.reset();
        let mut windows = 0;
        for reading in stretch {
            if let Some(sequence) = self.window.push(reading)? {
                frames.extend_from_slice(sequence.values);
                windows += 1;
            }
        }
        Ok(windows)
    }
}

#[cfg(test)]
mod tests;
