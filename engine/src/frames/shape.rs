//! Shapes of frames and of the outputs of layers.

/// Shape of a layer's input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameShape {
    /// A vector with this many values.
    Vector(usize),
    /// Channels, then rows, then columns.
    Image {
        /// Channels.
        channels: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
}

impl FrameShape {
    /// Number of values; [`usize::MAX`] if it overflows, which no network reaches.
    pub fn values(self) -> usize {
        self.sides().into_iter().fold(1, usize::saturating_mul)
    }

    /// Channels, rows and columns; the values of a vector are channels of one pixel.
    pub(super) fn sides(self) -> [usize; 3] {
        match self {
            Self::Vector(values) => [values, 1, 1],
            Self::Image { channels, height, width } => [channels, height, width],
        }
    }

    /// Number of pixels; 1 for a vector.
    pub(super) fn pixels(self) -> u64 {
        let [_, height, width] = self.sides();
        (height * width) as u64
    }

    /// Rows and columns of an image's change marks; a vector has none.
    pub(super) fn marks(self) -> [usize; 2] {
        match self {
            Self::Vector(_) => [0; 2],
            Self::Image { height, width, .. } => [height, width],
        }
    }
}

impl std::fmt::Display for FrameShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Vector(values) => write!(f, "{values} values"),
            Self::Image { channels, height, width } => write!(f, "{channels} x {height} x {width}"),
        }
    }
}
