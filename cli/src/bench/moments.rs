//! The moments at which a frame is taken and a prediction read, and the events that belong to each.
//!
//! Enters: events, and the time from frame to frame. Leaves: the accepted events, cut at the moments
//! `first + period, first + 2 period, ...` up to the first one that covers the last event. Every way of a comparison
//! follows them, so that all predict at the same moments about the same events. Silence has moments too.

use std::ops::Range;

use meissner_engine::{Admission, Event, EventCounters, LatePolicy, Sensor};

use crate::error::CliError;
use meissner_pipeline::text::grouped;

/// Most moments of a benchmark: nobody waits for the frames of more.
const MOST: i128 = 1_000_000;

/// Which events belong to a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// Those up to it, as in a window that slides.
    Included,
    /// Those before it, as in windows that follow one another.
    Excluded,
}

/// Events and moments.
#[derive(Debug)]
pub(super) struct Moments {
    /// The accepted events, at the times at which they enter.
    pub(super) events: Vec<Event>,
    pub(super) period_us: i64,
    /// What became of all events.
    pub(super) counters: EventCounters,
    /// The end of each moment's events in `events`.
    ends: Vec<usize>,
    first_us: i64,
}

/// A moment.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// Its events, those since the moment before.
    pub(super) events: Range<usize>,
    pub(super) t_us: i64,
}

impl Moments {
    /// The moments of `events`, as `sensor` and `late` accept them.
    pub(super) fn new(
        events: &[Event],
        (sensor, late): (Sensor, LatePolicy),
        period_us: i64,
        end: End,
    ) -> Result<Self, CliError> {
        let mut gate = Admission::new(sensor, late);
        let events: Vec<Event> = events.iter().filter_map(|&event| gate.admit(event).ok()).collect();
        let counters = *gate.counters();
        let (Some(first), Some(last)) = (events.first(), events.last()) else {
            return Ok(Self { events, period_us, counters, ends: Vec::new(), first_us: 0 });
        };
        let first_us = first.t_us;
        // Accepted events are in order, and the difference of any two fits.
        let count = count(last.t_us - first_us, period_us, end);
        if count > MOST || i128::from(first_us) + count * i128::from(period_us) > i128::from(i64::MAX) {
            return Err(CliError::Option {
                option: "--every",
                expected: format!("at most {} frames; --for takes a part", grouped(MOST as u64)),
                found: format!("{count} frames, one every {period_us} us"),
            });
        }
        let mut ends = Vec::with_capacity(count as usize);
        let mut next = 0;
        for index in 0..count as i64 {
            let t_us = first_us + (index + 1) * period_us;
            let belongs = |event: &Event| event.t_us < t_us || (end == End::Included && event.t_us == t_us);
            next += events[next..].iter().take_while(|event| belongs(event)).count();
            ends.push(next);
        }
        Ok(Self { events, period_us, counters, ends, first_us })
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Stream time from the first event to the last moment, in seconds.
    pub(super) fn stream_s(&self) -> f64 {
        self.count() as f64 * self.period_us as f64 / 1e6
    }

    /// All of them, in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = Moment> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins.zip(&self.ends).zip(1..).map(|((begin, &end), number)| Moment {
            events: begin..end,
            t_us: self.first_us + number * self.period_us,
        })
    }
}

/// Moments up to the first one that covers the last event, `span_us` after the first.
fn count(span_us: i64, period_us: i64, end: End) -> i128 {
    let (span, period) = (i128::from(span_us), i128::from(period_us));
    match end {
        End::Included => ((span + period - 1) / period).max(1),
        End::Excluded => span / period + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::{End, Moments};
    use meissner_engine::{Event, LatePolicy, Sensor};

    fn moments(times: &[i64], end: End) -> Moments {
        let events: Vec<Event> = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
        Moments::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, end).expect("there are few")
    }

    fn told(moments: &Moments) -> Vec<(i64, usize)> {
        moments.iter().map(|moment| (moment.t_us, moment.events.len())).collect()
    }

    #[test]
    fn an_event_at_a_moment_belongs_to_it_where_windows_slide_and_to_the_next_where_they_follow() {
        let times = [5, 15, 16, 40, 45];
        assert_eq!(told(&moments(&times, End::Included)), [(15, 2), (25, 1), (35, 0), (45, 2)]);
        assert_eq!(told(&moments(&times, End::Excluded)), [(15, 1), (25, 2), (35, 0), (45, 1), (55, 1)]);
    }

    #[test]
    fn one_event_has_one_moment_and_none_has_none() {
        for end in [End::Included, End::Excluded] {
            assert_eq!(told(&moments(&[7], end)), [(17, 1)]);
            assert!(told(&moments(&[], end)).is_empty());
        }
    }

    #[test]
    fn dropped_events_have_no_moments() {
        let moments = moments(&[100, 50, 101], End::Included);
        assert_eq!((told(&moments), moments.counters.late), (vec![(110, 2)], 1));
    }

    #[test]
    fn more_frames_than_anybody_waits_for_are_refused() {
        let events = [0, i64::MAX / 2].map(|t| Event::new(t, 0, 0, true));
        let refused = Moments::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, End::Included);
        let message = refused.expect_err("centuries of frames").to_string();
        assert!(message.contains("--for"), "{message}");
    }
}
