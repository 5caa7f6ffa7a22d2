//! How often frames are made of what others run.

use std::time::{Duration, Instant};

/// Least time between two frames.
const FRAME: Duration = Duration::from_millis(50);
/// Frames take at most one part in so many of the time.
const SHARE: u32 = 100;

/// When the next frame may be made.
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
    /// Whether a frame may be made; if so, it begins now.
    pub(crate) fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let is_due = now >= self.next;
        if is_due {
            self.begun = now;
        }
        is_due
    }

    /// The next frame comes as soon as one may follow the last.
    pub(crate) fn hurry(&mut self) {
        self.next = self.next.min(self.begun + FRAME);
    }

    /// The frame that began is made.
    pub(crate) fn done(&mut self) {
        self.next = self.begun + FRAME.max(self.begun.elapsed() * SHARE);
    }
}
