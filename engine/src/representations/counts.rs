//! Two-channel event counts over consecutive windows: the input of the contact-force networks.
//!
//! Enters: events. Leaves: frames of shape (2, height, width), channel 0 negative (OFF), channel 1 positive (ON):
//! value(p, y, x) = number of events of polarity p at pixel (x, y) in the window / maximum (the force paper, Eq. 1).
//! Counts are integers and divided in f32, once a value.

use crate::representations::consecutive::{Rule, Windows};
use crate::representations::{Completed, Consecutive, EventFrame, RepresentationError};
use crate::{Event, EventCounters, Outcome, Sensor};

/// Counts events by pixel and polarity over consecutive windows.
///
/// A push costs O(1), a frame O(pixels touched in it and in the frame before); nothing is allocated after construction.
#[derive(Clone, Debug)]
pub struct EventCounts {
    windows: Windows,
}

impl EventCounts {
    /// Counts over the windows of `options`, divided by `maximum`. Counts above `maximum` give values above 1.
    ///
    /// # Errors
    /// A crop outside `sensor`, a period below 1 us, a maximum that is not finite or below 1.
    pub fn new(sensor: Sensor, options: Consecutive, maximum: f32) -> Result<Self, RepresentationError> {
        if !maximum.is_finite() || maximum < 1.0 {
            return Err(RepresentationError::option("maximum count", "a finite number from 1 on", maximum));
        }
        Ok(Self { windows: Windows::new(sensor, options, Rule::Count, maximum)? })
    }

    /// The shape of every frame: (2, height, width).
    pub fn shape(&self) -> [usize; 3] {
        self.windows.shape()
    }

    /// Counts `event`; before that, hands the windows that its time completes to `sink`, in order. At most two calls:
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
    use crate::DropReason;
    use crate::representations::Crop;

    /// Two columns, one row, windows of 10 us, a maximum of 4.
    fn small(start_us: Option<i64>) -> EventCounts {
        let options = Consecutive { crop: Crop::new(1, 0, 2, 1), period_us: 10, start_us };
        EventCounts::new(Sensor::new(4, 1), options, 4.0).expect("admissible")
    }

    /// What comes out, in words: begin, values, touched, changed; or begin and number of empty frames.
    fn told(completed: Completed<'_>) -> String {
        match completed {
            Completed::Frame(f) => {
                format!(
                    "{}: {:?} {:?} touched {:?} changed {:?}",
                    f.start_us, f.values, f.events, f.touched, f.changed
                )
            }
            Completed::Empty(run) => {
                format!("{}: {} empty, changed {:?}", run.start_us, run.count, run.changed)
            }
        }
    }

    fn push(counts: &mut EventCounts, t_us: i64, x: u16, on: bool) -> Vec<String> {
        let mut out = vec![];
        counts.push(Event::new(t_us, x, 0, on), |completed| out.push(told(completed)));
        out
    }

    fn advance(counts: &mut EventCounts, t_us: i64) -> Vec<String> {
        let mut out = vec![];
        counts.advance(t_us, |completed| out.push(told(completed)));
        out
    }

    #[test]
    fn negative_events_count_in_channel_0_and_positive_ones_in_channel_1() {
        let mut counts = small(None);
        for (t, x, on) in [(100, 1, false), (101, 2, true), (109, 2, true)] {
            assert!(push(&mut counts, t, x, on).is_empty());
        }
        assert_eq!(
            push(&mut counts, 110, 1, true),
            ["100: [0.25, 0.0, 0.0, 0.5] [1, 2] touched [0, 1] changed [0, 1]"]
        );
        assert_eq!(counts.shape(), [2, 1, 2]);
    }

    #[test]
    fn a_frame_tells_what_differs_from_the_frame_before() {
        let mut counts = small(None);
        push(&mut counts, 0, 1, true);
        push(&mut counts, 0, 2, true);
        push(&mut counts, 10, 1, true);
        assert_eq!(advance(&mut counts, 20), ["10: [0.0, 0.0, 0.25, 0.0] [0, 1] touched [0] changed [1]"]);
        assert_eq!(advance(&mut counts, 40), ["20: 2 empty, changed [0]"]);
        assert_eq!(advance(&mut counts, 50), ["40: 1 empty, changed []"]);
    }

    #[test]
    fn a_silence_of_a_thousand_years_is_one_run() {
        let mut counts = small(None);
        push(&mut counts, 5, 1, true);
        let late = 5 + 31_556_952_000_000_000;
        assert_eq!(
            push(&mut counts, late, 1, true),
            [
                "5: [0.0, 0.0, 0.25, 0.0] [0, 1] touched [0] changed [0]",
                "15: 3155695199999999 empty, changed [0]"
            ]
        );
    }

    #[test]
    fn times_at_both_ends_of_the_clock_do_not_overflow() {
        let mut counts = small(None);
        push(&mut counts, i64::MAX - 1, 1, true);
        assert!(advance(&mut counts, i64::MAX).is_empty());
        assert_eq!(counts.open().expect("time runs").start_us, i64::MAX - 1);
        let mut counts = small(Some(i64::MIN));
        let far = counts.push(Event::new(0, 1, 0, true), |_| unreachable!("time stands"));
        assert_eq!(far, Outcome::Dropped(DropReason::TimeOutOfRange));
        assert_eq!(push(&mut counts, -1, 1, true).len(), 1);
    }

    #[test]
    fn events_before_a_given_start_are_late() {
        let mut counts = small(Some(100));
        push(&mut counts, 99, 1, true);
        assert_eq!(counts.counters().late, 1);
        let mut at_once = small(Some(100));
        push(&mut at_once, 100, 1, true);
        assert_eq!((at_once.counters().late, at_once.counters().accepted), (0, 1));
        assert_eq!(advance(&mut counts, 120), ["100: 2 empty, changed []"]);
        push(&mut counts, 119, 1, true);
        assert_eq!(counts.counters().late, 2);
        assert!(counts.open().expect("time runs").is_empty());
    }

    #[test]
    fn an_event_outside_the_crop_moves_time_on_and_is_not_counted() {
        let mut counts = small(None);
        push(&mut counts, 0, 0, true);
        assert_eq!(push(&mut counts, 10, 3, true), ["0: 1 empty, changed []"]);
        push(&mut counts, 90, 4, true);
        assert_eq!((counts.outside_crop(), counts.counters().outside_sensor), (2, 1));
        assert_eq!(counts.open().expect("time runs").start_us, 10);
    }

    #[test]
    fn after_a_reset_everything_is_as_at_first() {
        let mut counts = small(None);
        push(&mut counts, 0, 1, true);
        push(&mut counts, 10, 2, true);
        counts.reset();
        assert!(counts.open().is_none() && advance(&mut counts, 1_000).is_empty());
        push(&mut counts, 7, 1, false);
        assert_eq!(advance(&mut counts, 17), ["7: [0.25, 0.0, 0.0, 0.0] [1, 0] touched [0] changed [0]"]);
        assert_eq!(counts.counters().pushed, 3);
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let sensor = Sensor::new(4, 1);
        let options = Consecutive::new(Crop::whole(sensor));
        for maximum in [0.0, 0.5, -1.0, f32::NAN, f32::INFINITY] {
            assert!(EventCounts::new(sensor, options, maximum).is_err(), "{maximum}");
        }
        let error = EventCounts::new(sensor, Consecutive { period_us: 0, ..options }, 1.0);
        assert_eq!(error.expect_err("no period").to_string(), "period: expected at least 1 us, found 0");
    }
}
