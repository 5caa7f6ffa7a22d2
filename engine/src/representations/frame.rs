//! Frames of events, as representations deliver them.

/// A pixel's value in a signed frame, from its events (+1 ON, -1 OFF); 0 without events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SignedRule {
    /// The sum of the polarities, an integer.
    #[default]
    Sum,
    /// The polarity of the event that arrived last.
    Latest,
}

/// A frame, and the pixels of it that have events or changed.
///
/// Pixels are indices into one channel, row times width plus column, in no particular order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventFrame<'a> {
    /// Channels, rows, columns.
    pub shape: [usize; 3],
    /// Values, row-major.
    pub values: &'a [f32],
    /// When the frame's window begins, on the events' own clock, in microseconds.
    pub start_us: i64,
    /// Events inside by polarity: negative (OFF), positive (ON).
    pub events: [u64; 2],
    /// Pixels that have events. All others are 0 in every channel.
    pub touched: &'a [u32],
    /// Pixels of which a value differs from the frame before; before the first frame all are 0.
    pub changed: &'a [u32],
}

impl EventFrame<'_> {
    /// Whether no event is inside.
    pub fn is_empty(&self) -> bool {
        self.events == [0, 0]
    }
}

/// Consecutive frames without any event: all their values are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmptyRun<'a> {
    /// When the first of them begins, on the events' own clock, in microseconds.
    pub start_us: i64,
    /// From the begin of one to the begin of the next, in microseconds.
    pub period_us: i64,
    /// How many there are, at least 1.
    pub count: u64,
    /// Pixels in which the first frame differs from the one before; the others change nothing.
    pub changed: &'a [u32],
}

/// Frames that time has completed. However long a silence is, it is one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Completed<'a> {
    /// One frame, with at least one event.
    Frame(EventFrame<'a>),
    /// One or more empty frames.
    Empty(EmptyRun<'a>),
}

impl Completed<'_> {
    /// Number of frames.
    pub fn count(&self) -> u64 {
        match self {
            Self::Frame(_) => 1,
            Self::Empty(run) => run.count,
        }
    }
}
