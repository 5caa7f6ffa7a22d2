//! Readings into the windows that a network is trained and judged on.
//!
//! Enters: readings that follow each other. Leaves: the frames of windows of `steps` readings, made as the network's
//! `[input]` says, but always consecutive and without overlap, as the paper cuts them, whatever sampling a running network
//! has. Readings at the end that fill no window are left out.

use meissner_engine::representations::{
    ELECTRODES, Sampling, Scaling, TACTILE_COLUMNS, TACTILE_ROWS, TactileForm, TactileWindow,
};

use super::{SlipError, classes};
use crate::{FrameDescription, FrameSource};

/// Cuts windows for one network.
#[derive(Clone, Debug)]
pub struct SlipWindows {
    window: TactileWindow,
    form: TactileForm,
    scaling: Scaling,
    steps: usize,
}

impl SlipWindows {
    /// Windows as `description` reads them.
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
        classes::check(description)?;
        let window = TactileWindow::new(readings.steps, Sampling::Consecutive, readings.scaling, form)?;
        Ok(Self { window, form, scaling: readings.scaling, steps: readings.steps })
    }

    /// Readings of a window.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Shape of a frame: (1, 12, 11) for images, (24) for readings, (48) for readings that are scaled twice.
    pub fn frame_shape(&self) -> &'static [usize] {
        match (self.form, self.scaling) {
            (TactileForm::Image, _) => &[1, TACTILE_ROWS, TACTILE_COLUMNS],
            (TactileForm::Reading, Scaling::ReadingAndRange { .. }) => &[2 * ELECTRODES],
            (TactileForm::Reading, _) => &[ELECTRODES],
        }
    }

    /// Values of a frame.
    pub fn frame_len(&self) -> usize {
        self.frame_shape().iter().product()
    }

    /// Appends the windows of `stretch` to `frames`, (windows, steps, frame), and returns how many they are:
    /// `stretch.len() / steps`. Window k holds the readings from k `steps` on.
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
mod tests {
    use super::SlipWindows;
    use crate::FrameDescription;

    fn windows(network: &str) -> SlipWindows {
        SlipWindows::new(&FrameDescription::shipped(network).expect("shipped")).expect("over readings")
    }

    #[test]
    fn windows_do_not_overlap_and_what_fills_none_is_left_out() {
        let readings: Vec<[f32; 24]> =
            (0..13).map(|i| std::array::from_fn(|e| (i * 100 + e) as f32)).collect();
        let mut frames = Vec::new();
        let mut windows = windows("slip-lstm");
        // A part of a window before, as a stretch leaves it, does not reach into the next stretch.
        assert_eq!(windows.cut(&readings[..3], &mut frames), Ok(0));
        assert_eq!(windows.cut(&readings, &mut frames), Ok(2));
        assert_eq!((frames.len(), frames[0], frames[23]), (2 * 5 * 24, 0.0, 1.0));
    }

    #[test]
    fn sampling_of_a_running_network_does_not_count() {
        let text = include_str!("../../../networks/slip-lstm.toml").replace("\"consecutive\"", "\"sliding\"");
        let sliding = FrameDescription::parse(&text).expect("consistent");
        let mut windows = SlipWindows::new(&sliding).expect("over readings");
        assert_eq!(windows.cut(&[[1.0; 24]; 10], &mut Vec::new()), Ok(2));
    }

    #[test]
    fn frames_have_the_shape_of_the_networks_input() {
        assert_eq!(windows("slip-lstm").frame_shape(), [24]);
        assert_eq!(windows("slip-tuned").frame_shape(), [1, 12, 11]);
        assert_eq!(windows("slip-tuned").frame_len(), 132);
    }

    #[test]
    fn readings_that_are_scaled_twice_fill_48_values() {
        let text = include_str!("../../../networks/slip-lstm.toml")
            .replace("values = 24", "values = 48")
            .replace("scaling = \"reading\"", "scaling = [\"reading\", [0, 4]]");
        let both = FrameDescription::parse(&text).expect("consistent");
        let mut windows = SlipWindows::new(&both).expect("over readings");
        assert_eq!((windows.frame_shape(), windows.frame_len()), (&[48][..], 48));
        let mut frames = Vec::new();
        assert_eq!(windows.cut(&[[3.0; 24]; 5], &mut frames), Ok(1));
        assert_eq!(frames, [[0.0; 24], [0.75; 24]].concat().repeat(5));
    }

    #[test]
    fn networks_of_other_systems_are_refused() {
        let description = FrameDescription::shipped("force-lstm").expect("shipped");
        let error = SlipWindows::new(&description).unwrap_err().to_string();
        assert!(error.contains("force-lstm") && error.contains("\"event-counts\""), "{error}");
        let text =
            include_str!("../../../networks/slip-lstm.toml").replace("\"aw\", \"cw\"", "\"cw\", \"aw\"");
        let swapped = FrameDescription::parse(&text).expect("consistent");
        assert!(SlipWindows::new(&swapped).unwrap_err().to_string().contains("found cw, aw"));
    }
}
