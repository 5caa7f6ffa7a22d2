//! The rate of frames of engines that others run.

use std::time::{Duration, Instant};

/// Minimum time between two frames.
const FRAME: Duration = Duration::from_millis(50);
/// Frames take at most one part in so many of the time.
const SHARE: u32 = 100;

/// The time of the next frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    begun: Instant,
    next: Instant,
}

impl Default for Pace {
    fn default() -> Self {
        let now = Instant::now();
        Self { begun: now, next: now }
    }
}

impl Pace {
    /// Whether a frame is due; if so, it begins now.
    pub(crate) fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let is_due = now >= self.next;
        if is_due {
            self.begun = now;
        }
        is_due
    }

    /// The next frame comes after the minimum time.
    pub(crate) fn hurry(&mut self) {
        self.next = self.next.min(self.begun + FRAME);
    }

    /// The frame is finished.
    pub(crate) fn done(&mut self) {
        self.next = self.begun + FRAME.max(self.begun.elapsed() * SHARE);
    }
}
