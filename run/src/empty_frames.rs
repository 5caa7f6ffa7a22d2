//! How many empty frames of a silence a network takes.
//!
//! Enters: runs of empty frames, and frames with events. Leaves: how many of the empty ones the
//! network takes, and whether its state is reset after them. Invariant: of a silence, a network
//! takes at most the longest number of frames; the next one resets its state, once.

/// The default for the largest number of consecutive empty frames that a network takes.
const MAX: u64 = 6000;

/// Counts the empty frames since the last frame with events.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmptyFrameLimit {
    longest: u64,
    frames: u64,
}

/// What becomes of a run of empty frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EmptyFrames {
    /// Frames that the network takes.
    pub(crate) taken: u64,
    /// Frames after them that it does not.
    pub(crate) left_out: u64,
    /// Whether the network's state is reset after the frames that it takes.
    pub(crate) resets: bool,
}

impl EmptyFrameLimit {
    /// A silence of `frames` empty frames so far. `longest` replaces the default of 6000 frames.
    pub(crate) fn new(longest: Option<u64>, frames: u64) -> Self {
        Self { longest: longest.unwrap_or(MAX), frames }
    }

    /// Empty frames since the last one with events.
    pub(crate) fn frames(self) -> u64 {
        self.frames
    }

    /// A frame with events ends the silence.
    pub(crate) fn end(&mut self) {
        self.frames = 0;
    }

    /// Takes `count` empty frames.
    pub(crate) fn take(&mut self, count: u64) -> EmptyFrames {
        let taken = count.min(self.longest.saturating_sub(self.frames));
        let left_out = count - taken;
        // Once per silence, even if it consists of several runs of empty frames.
        let resets = left_out > 0 && self.frames <= self.longest;
        self.frames = self.frames.saturating_add(count);
        EmptyFrames { taken, left_out, resets }
    }
}

#[cfg(test)]
mod tests {
    use super::{EmptyFrameLimit, EmptyFrames};

    #[test]
    fn frames_beyond_the_longest_silence_are_left_out_and_the_first_of_them_resets() {
        let mut silence = EmptyFrameLimit::new(Some(5), 0);
        let taken = [3, 2, 1, 4, u64::MAX].map(|count| {
            let EmptyFrames { taken, left_out, resets } = silence.take(count);
            (taken, left_out, resets)
        });
        assert_eq!(taken, [(3, 0, false), (2, 0, false), (0, 1, true), (0, 4, false), (0, u64::MAX, false)]);
        silence.end();
        let taken = EmptyFrames { taken: 5, left_out: 1, resets: true };
        assert_eq!((silence.take(6), silence.frames()), (taken, 6));
    }
}
