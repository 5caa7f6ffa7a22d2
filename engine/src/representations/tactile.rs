//! Tactile images and sequences: the input of the direction-of-slip networks.
//!
//! Input: readings of 24 electrodes. Output: sequences of readings or images of 12 x 11, scaled;
//! readings also scaled in two ways, side by side. The order: check, (scale the reading,) lay it
//! out, (scale the image,) collect.

use crate::representations::RepresentationError;

/// Electrodes of the sensor.
pub const ELECTRODES: usize = 24;
/// Rows of the image.
pub const TACTILE_ROWS: usize = 12;
/// Columns of the image.
pub const TACTILE_COLUMNS: usize = 11;
/// Cells of the image.
pub const TACTILE_CELLS: usize = TACTILE_ROWS * TACTILE_COLUMNS;

/// The row of each electrode (the slip paper's published preparation).
pub const ELECTRODE_ROWS: [usize; ELECTRODES] =
    [0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 2, 3, 3, 5];
/// The column of each electrode (the slip paper's published preparation).
pub const ELECTRODE_COLUMNS: [usize; ELECTRODES] =
    [1, 2, 0, 1, 3, 0, 1, 4, 2, 1, 9, 8, 10, 9, 7, 10, 9, 6, 8, 9, 5, 4, 6, 5];

const PASSES: usize = 2;

/// The lists of neighbours that turn 24 values into an image.
///
/// An electrode's value is in its cell; every other cell is the mean of its filled neighbours among
/// 8, in two passes (the slip paper's published preparation). The first pass sees the electrodes,
/// the second also the cells that the first filled (97 cells; 11 remain). A mean adds in f64 in
/// row-major order, divides by the number, and is rounded to f32 once.
#[derive(Clone, Debug)]
pub struct TactileLayout {
    /// Each cell between electrodes, and its filled neighbours.
    pub(crate) fills: Vec<(usize, Vec<usize>)>,
}

impl TactileLayout {
    /// Finds the filled neighbours of every cell, pass by pass.
    pub fn new() -> Self {
        let mut filled = [false; TACTILE_CELLS];
        cells_of_electrodes().for_each(|cell| filled[cell] = true);
        let mut fills = Vec::new();
        for _ in 0..PASSES {
            let before = filled;
            for cell in (0..TACTILE_CELLS).filter(|&cell| !before[cell]) {
                let neighbours: Vec<_> = around(cell).filter(|&neighbour| before[neighbour]).collect();
                if !neighbours.is_empty() {
                    fills.push((cell, neighbours));
                    filled[cell] = true;
                }
            }
        }
        Self { fills }
    }

    /// Lays the electrodes' `values` out as `image` (12, 11), row-major. 204 additions.
    pub fn image(&self, values: &[f32; ELECTRODES], image: &mut [f32; TACTILE_CELLS]) {
        for (cell, &value) in cells_of_electrodes().zip(values) {
            image[cell] = value;
        }
        for (cell, neighbours) in &self.fills {
            let sum: f64 = neighbours.iter().map(|&neighbour| f64::from(image[neighbour])).sum();
            image[*cell] = (sum / neighbours.len() as f64) as f32;
        }
    }
}

impl Default for TactileLayout {
    fn default() -> Self {
        Self::new()
    }
}

fn cells_of_electrodes() -> impl Iterator<Item = usize> {
    ELECTRODE_ROWS.iter().zip(ELECTRODE_COLUMNS).map(|(row, column)| row * TACTILE_COLUMNS + column)
}

/// The neighbours of a cell that are in the image, row by row.
fn around(cell: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (cell / TACTILE_COLUMNS, cell % TACTILE_COLUMNS);
    let near = |at: usize, extent: usize| at.saturating_sub(1)..(at + 2).min(extent);
    near(row, TACTILE_ROWS)
        .flat_map(move |r| near(column, TACTILE_COLUMNS).map(move |c| r * TACTILE_COLUMNS + c))
        .filter(move |&neighbour| neighbour != cell)
}

/// The minimum and maximum that are scaled to 0 and 1.
///
/// scaled = (value - minimum) / (maximum - minimum), in f64, rounded once; 0 if both are equal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scaling {
    /// The minimum and maximum of each image, after layout (the slip paper's published
    /// preparation). Without images, those of each reading: means lie between the values from which
    /// they are computed.
    #[default]
    PerImage,
    /// A fixed minimum and maximum, such as those of a training set (the slip paper's text), before
    /// layout. Values beyond them lie beyond 0 and 1.
    Range {
        /// Value that is scaled to 0.
        minimum: f32,
        /// Value that is scaled to 1.
        maximum: f32,
    },
    /// The minimum and maximum of the 24 electrodes of each reading, before it is laid out.
    PerReading,
    /// Both, for readings without layout: the 24 values by [`Self::PerReading`], then by
    /// [`Self::Range`]. The first half shows the distribution, the second also the strength.
    ReadingAndRange {
        /// Value that is scaled to 0 in the second half.
        minimum: f32,
        /// Value that is scaled to 1 in the second half.
        maximum: f32,
    },
}

impl Scaling {
    /// The range of all `readings`: scaling by the training set. `None` if the range has no extent.
    pub fn range_of<'a>(readings: impl IntoIterator<Item = &'a [f32; ELECTRODES]>) -> Option<Self> {
        let (minimum, maximum) = bounds(readings.into_iter().flatten());
        (minimum < maximum).then_some(Self::Range { minimum, maximum })
    }

    /// Number of values of a reading that is not laid out: 24, or 48 if each occurs twice.
    pub fn values(self) -> usize {
        match self {
            Self::PerImage | Self::Range { .. } | Self::PerReading => ELECTRODES,
            Self::ReadingAndRange { .. } => 2 * ELECTRODES,
        }
    }

    pub(crate) fn check(self) -> Result<(), RepresentationError> {
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
pub(crate) fn by_own_range(values: &mut [f32]) {
    let (minimum, maximum) = bounds(&*values);
    values.iter_mut().for_each(|value| *value = scaled(*value, minimum, maximum));
}

/// `value` scaled so that `minimum` becomes 0 and `maximum` 1.
fn scaled(value: f32, minimum: f32, maximum: f32) -> f32 {
    let [value, minimum, maximum] = [value, minimum, maximum].map(f64::from);
    if minimum == maximum { 0.0 } else { ((value - minimum) / (maximum - minimum)) as f32 }
}

fn bounds<'a>(values: impl IntoIterator<Item = &'a f32>) -> (f32, f32) {
    let all = (f32::INFINITY, f32::NEG_INFINITY);
    values.into_iter().fold(all, |(minimum, maximum), &value| (minimum.min(value), maximum.max(value)))
}

/// The readings that form a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Windows of consecutive readings that do not overlap: one decision per `steps` readings.
    #[default]
    Consecutive,
    /// The last `steps` readings: one decision per reading, once there are `steps` readings.
    Sliding,
    /// Every `stride`th reading from the first on, in disjoint windows; others are skipped.
    Step {
        /// Distance from one used reading to the next.
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
    /// Index of the last reading among all readings since the last reset, counted from 0.
    pub reading: u64,
}

/// Collects readings into windows.
///
/// A reading costs O(1): 204 additions for an image, and for sliding windows a move of `steps`
/// images. Nothing is allocated later.
///
/// Invariant: `values` begins with the `filled` readings or images of the open window.
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
    /// A value that is not finite, or that a fixed range makes not finite. The reading is not
    /// taken.
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

    /// The reading, scaled if scaling precedes layout; of two scalings, by the second. A range is
    /// the same for all cells, so a value that it makes infinite is found before it enters a mean.
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
