//! Signed frames over consecutive windows.

use crate::representations::consecutive::Windows;
use crate::representations::{Completed, Consecutive, EventFrame, RepresentationError, SignedRule};
use crate::{Event, EventCounters, Outcome, Sensor};

/// Signed frames over consecutive windows.
///
/// A push costs O(1), a frame O(pixels touched in it and in the frame before); nothing is allocated after construction.
#[derive(Clone, Debug)]
pub struct SignedWindows {
    windows: Windows,
}

impl SignedWindows {
    /// Frames over the windows of `options`.
    ///
    /// # Errors
    /// A crop outside `sensor`, a period below 1 us.
    pub fn new(sensor: Sensor, options: Consecutive, rule: SignedRule) -> Result<Self, RepresentationError> {
        Ok(Self { windows: Windows::new(sensor, options, rule.into(), 1.0)? })
    }

    /// The shape of every frame: (1, height, width).
    pub fn shape(&self) -> [usize; 3] {
        self.windows.shape()
    }

    /// Takes `event` in; before that, hands the windows that its time completes to `sink`, in order. At most two calls:
    /// one frame, and one run of empty ones.
    ///
    /// An event outside the crop is accepted: it moves time on, and counts as [`Self::outside_crop`].
    pub fn push(&mut self, event: Event, sink: impl FnMut(Completed<'_>)) -> Outcome {
        self.windows.push(event, sink)
    }

    /// Moves time on to `t_us`, and hands the windows that this completes to `sink`. Earlier times change nothing, nor
    /// does any time before the first event where no start was given.
    pub fn advance(&mut self, t_us: i64, sink: impl FnMut(Completed<'_>)) {
        self.windows.advance(t_us, sink);
    }

    /// The window that is still open, as far as it has come; `None` where there is no time yet. O(touched pixels).
    pub fn open(&mut self) -> Option<EventFrame<'_>> {
        self.windows.open()
    }

    /// Forgets time and all events; the frame before the next is all 0. Counters go on.
    pub fn reset(&mut self) {
        self.windows.reset();
    }

    /// What became of the events so far.
    pub fn counters(&self) -> &EventCounters {
        self.windows.counters()
    }

    /// Accepted events outside the crop.
    pub fn outside_crop(&self) -> u64 {
        self.windows.outside_crop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representations::Crop;

    fn frame(rule: SignedRule) -> (Vec<f32>, Vec<u32>) {
        let sensor = Sensor::new(3, 1);
        let mut signed =
            SignedWindows::new(sensor, Consecutive::new(Crop::whole(sensor)), rule).expect("admissible");
        let events =
            [(0, 0, true), (1, 0, true), (2, 0, false), (3, 1, true), (4, 1, false), (9_999, 2, false)];
        for (t, x, on) in events {
            signed.push(Event::new(t, x, 0, on), |_| unreachable!("the window is open"));
        }
        let mut out = (vec![], vec![]);
        signed.advance(10_000, |completed| {
            let Completed::Frame(frame) = completed else { unreachable!("it has events") };
            assert_eq!((frame.shape, frame.events, frame.touched.len()), ([1, 1, 3], [3, 3], 3));
            out = (frame.values.to_vec(), frame.changed.to_vec());
        });
        out
    }

    #[test]
    fn a_sum_adds_polarities_and_may_come_back_to_zero() {
        assert_eq!(frame(SignedRule::Sum), (vec![1.0, 0.0, -1.0], vec![0, 2]));
    }

    #[test]
    fn the_latest_polarity_stands() {
        assert_eq!(frame(SignedRule::Latest), (vec![-1.0, -1.0, -1.0], vec![0, 1, 2]));
    }
}
