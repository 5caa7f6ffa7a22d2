//! The moments at which a frame is taken and a prediction is read, and the events of each.
//!
//! Enters: events, and the time from frame to frame. Leaves: the accepted events, cut at the
//! moments `first + period, first + 2 period, ...` up to the first one that covers the last event.
//! All networks of a comparison predict at these moments, from the same events. Silence also has
//! moments.

use std::ops::Range;

use meissner_engine::{Admission, Event, EventCounters, LatePolicy, Sensor};

use crate::error::RunError;
use crate::schedule::{Every, Last, Schedule, times_before};

/// Largest number of moments in a benchmark. The frames of more would take too long.
const MAX: u64 = 1_000_000;

/// The rule for the events that belong to a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// Events up to and at the moment, as in a sliding window.
    Included,
    /// Events before the moment, as in consecutive windows.
    Excluded,
}

/// Events and moments.
#[derive(Debug)]
pub(super) struct PredictionTimes {
    /// The accepted events, with the times at which they enter.
    pub(super) events: Vec<Event>,
    pub(super) period_us: i64,
    /// Counts of all events.
    pub(super) counters: EventCounters,
    /// Each moment's time, and the end of its events in `events`.
    ends: Vec<(i64, usize)>,
}

/// A moment.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// The events since the moment before.
    pub(super) events: Range<usize>,
    pub(super) t_us: i64,
}

impl PredictionTimes {
    /// The moments of those `events` that `sensor` and `late` accept.
    pub(super) fn new(
        events: &[Event],
        (sensor, late): (Sensor, LatePolicy),
        period_us: i64,
        end: End,
    ) -> Result<Self, RunError> {
        let mut gate = Admission::new(sensor, late);
        let events: Vec<Event> = events.iter().filter_map(|&event| gate.admit(event).ok()).collect();
        let mut moments = Self { events, period_us, counters: *gate.counters(), ends: Vec::new() };
        let (Some(first), Some(last)) = (moments.events.first(), moments.events.last()) else {
            return Ok(moments);
        };
        let found = times_before(first.t_us, last.t_us, period_us).max(1);
        if found > MAX {
            return Err(RunError::ManyFrames { most: MAX, found, period_us });
        }
        let mut schedule = Schedule::new(Every::StreamUs(period_us));
        schedule.begin(first.t_us);
        for (index, event) in moments.events.iter().enumerate() {
            // A moment that is due before an event ends a window without the event.
            let t_us = match end {
                End::Included => event.t_us,
                End::Excluded => event.t_us.saturating_add(1),
            };
            moments.ends.extend(std::iter::from_fn(|| schedule.due_before(t_us)).map(|due| (due, index)));
        }
        // There is no moment beyond the end of the clock.
        let Last::At(last_us) = schedule.last() else {
            return Err(RunError::ManyFrames { most: MAX, found, period_us });
        };
        moments.ends.push((last_us, moments.events.len()));
        Ok(moments)
    }

    /// The number of moments.
    pub(super) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Stream time from the first event to the last moment, in seconds.
    pub(super) fn stream_s(&self) -> f64 {
        self.count() as f64 * self.period_us as f64 / 1e6
    }

    /// All moments, in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = Moment> {
        let begins = std::iter::once(0).chain(self.ends.iter().map(|&(_, end)| end));
        begins.zip(&self.ends).map(|(begin, &(t_us, end))| Moment { events: begin..end, t_us })
    }
}

#[cfg(test)]
mod tests {
    use super::{End, PredictionTimes};
    use crate::error::RunError;
    use meissner_engine::{Event, LatePolicy, Sensor};

    fn moments(times: &[i64], end: End) -> PredictionTimes {
        let events: Vec<Event> = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
        PredictionTimes::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, end).expect("there are few")
    }

    fn counted(moments: &PredictionTimes) -> Vec<(i64, usize)> {
        moments.iter().map(|moment| (moment.t_us, moment.events.len())).collect()
    }

    #[test]
    fn an_event_at_a_moment_belongs_to_it_if_windows_slide_and_to_the_next_if_they_are_consecutive() {
        let times = [5, 15, 16, 40, 45];
        assert_eq!(counted(&moments(&times, End::Included)), [(15, 2), (25, 1), (35, 0), (45, 2)]);
        assert_eq!(counted(&moments(&times, End::Excluded)), [(15, 1), (25, 2), (35, 0), (45, 1), (55, 1)]);
    }

    #[test]
    fn one_event_has_one_moment_and_none_has_none() {
        for end in [End::Included, End::Excluded] {
            assert_eq!(counted(&moments(&[7], end)), [(17, 1)]);
            assert!(counted(&moments(&[], end)).is_empty());
        }
    }

    #[test]
    fn dropped_events_have_no_moments() {
        let moments = moments(&[100, 50, 101], End::Included);
        assert_eq!((counted(&moments), moments.counters.late), (vec![(110, 2)], 1));
    }

    #[test]
    fn more_frames_than_anybody_waits_for_are_refused() {
        let events = [0, i64::MAX / 2].map(|t| Event::new(t, 0, 0, true));
        let refused = PredictionTimes::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, End::Included);
        assert!(matches!(refused, Err(RunError::ManyFrames { most: 1_000_000, .. })), "{refused:?}");
    }
}
