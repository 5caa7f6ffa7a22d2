//! When predictions are read.
//!
//! Enters: the events. Leaves: for `--every Nus` the times at which a prediction is due before an event enters, for
//! `--every N` whether one is due after it. Both modes of running follow one schedule, and so does
//! every pass of a benchmark, so that they predict at the same moments.

use std::fmt;
use std::str::FromStr;

use meissner_engine::{Admission, Event, LatePolicy, Sensor};

use crate::time;

/// When a prediction is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// Once, at the end.
    End,
    /// After so many accepted events.
    Events(u64),
    /// After so many microseconds of stream time.
    StreamUs(i64),
}

impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "event" => Ok(Self::Events(1)),
            "end" => Ok(Self::End),
            _ => match text.parse() {
                Ok(events @ 1..) => Ok(Self::Events(events)),
                _ => time::span_us(text).map(Self::StreamUs).map_err(|_| {
                    format!("expected `event`, `end`, a number of events such as 100, or {}", time::FORMS)
                }),
            },
        }
    }
}

impl fmt::Display for Every {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::End => f.write_str("end"),
            Self::Events(1) => f.write_str("event"),
            Self::Events(events) => write!(f, "{events}"),
            Self::StreamUs(us) => f.write_str(&time::display(us)),
        }
    }
}

/// Decides when a prediction is read.
#[derive(Debug)]
pub struct Schedule {
    every: Every,
    /// Accepted events since the last prediction, for [`Every::Events`].
    accepted: u64,
    /// Knows which events will be accepted, and at what time: dropped ones must not move time on.
    gate: Admission,
    /// Next time of [`Every::StreamUs`], on the events' clock; none before the first event and beyond the clock's end.
    due_us: Option<i64>,
}

impl Schedule {
    /// The schedule of predictions `every` so often, for events of `sensor`.
    pub fn new(every: Every, sensor: Sensor, late: LatePolicy) -> Self {
        Self { every, accepted: 0, gate: Admission::new(sensor, late), due_us: None }
    }

    /// Goes on where another schedule was that had seen so many accepted events, from the time of the first to `now_us`:
    /// periods count from the first event, whatever was asked for then.
    pub fn resume(&mut self, first_us: i64, now_us: i64, accepted: u64) {
        self.gate.resume(first_us, now_us);
        match self.every {
            Every::End => {}
            Every::Events(events) => self.accepted = accepted % events,
            Every::StreamUs(period) => {
                self.due_us = first_us.checked_add(period);
                self.skip_to(now_us);
            }
        }
    }

    /// Looks at the next event, before it is pushed: the time at which it will enter, where stream time matters and the
    /// event will be accepted.
    pub fn arrival_us(&mut self, event: Event) -> Option<i64> {
        let Every::StreamUs(period) = self.every else { return None };
        let first = self.gate.epoch_us().is_none();
        let t_us = self.gate.admit(event).ok()?.t_us;
        if first {
            self.due_us = t_us.checked_add(period);
        }
        Some(t_us)
    }

    /// The next time due before `t_us`, which is then done. An event at the due time belongs to its window.
    pub fn due_before(&mut self, t_us: i64) -> Option<i64> {
        let Every::StreamUs(period) = self.every else { return None };
        let due = self.due_us.filter(|&due| due < t_us)?;
        self.due_us = due.checked_add(period);
        Some(due)
    }

    /// Leaves out the times before `t_us`: the window is empty until then.
    pub fn skip_to(&mut self, t_us: i64) {
        if let (Every::StreamUs(period), Some(due)) = (self.every, self.due_us)
            && due < t_us
        {
            // The difference can exceed an i64 where times span its whole range.
            let periods = (i128::from(t_us) - i128::from(due)).div_euclid(i128::from(period));
            let next = i128::from(due) + periods * i128::from(period);
            let next = if next < i128::from(t_us) { next + i128::from(period) } else { next };
            self.due_us = i64::try_from(next).ok();
        }
    }

    /// An event has been accepted; whether a prediction is due.
    pub fn is_due_after_event(&mut self) -> bool {
        let Every::Events(events) = self.every else { return false };
        self.accepted += 1;
        if self.accepted == events {
            self.accepted = 0;
        }
        self.accepted == 0
    }

    /// What is due after the last event.
    pub fn last(&self) -> Last {
        match self.every {
            Every::End => Last::Now,
            Every::Events(_) => Last::Nothing,
            // All times before the last event are done: this is the first one that covers it.
            Every::StreamUs(_) => self.due_us.map_or(Last::Nothing, Last::At),
        }
    }
}

/// What is due after the last event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Last {
    /// No prediction.
    Nothing,
    /// A prediction for the window as it is.
    Now,
    /// A prediction for the window at this time, in microseconds.
    At(i64),
}

#[cfg(test)]
mod tests {
    use super::{Every, Last, Schedule};
    use meissner_engine::{Event, LatePolicy, Sensor};

    fn schedule(every: Every) -> Schedule {
        Schedule::new(every, Sensor::new(4, 4), LatePolicy::Drop)
    }

    /// Due times before each of the events at `times`.
    fn due(schedule: &mut Schedule, times: &[i64]) -> Vec<Vec<i64>> {
        let before = |&t: &i64| {
            let arrival = schedule.arrival_us(Event::new(t, 0, 0, true));
            std::iter::from_fn(|| schedule.due_before(arrival?)).collect()
        };
        times.iter().map(before).collect()
    }

    #[test]
    fn periods_count_from_the_first_event_and_hold_the_event_at_their_end() {
        let mut schedule = schedule(Every::StreamUs(10));
        let due = due(&mut schedule, &[5, 15, 16, 40]);
        assert_eq!(due, [vec![], vec![], vec![15], vec![25, 35]]);
        assert_eq!(schedule.last(), Last::At(45));
    }

    #[test]
    fn a_skipped_gap_resumes_on_the_same_grid() {
        let mut schedule = schedule(Every::StreamUs(10));
        due(&mut schedule, &[5]);
        for (t, next) in [(15, 15), (16, 25), (1_000_000, 1_000_005)] {
            schedule.skip_to(t);
            assert_eq!(schedule.last(), Last::At(next));
        }
        schedule.skip_to(i64::MAX);
        assert_eq!(schedule.last(), Last::Nothing);
    }

    #[test]
    fn a_resumed_schedule_is_due_when_one_that_went_on_is() {
        for every in [Every::StreamUs(10), Every::Events(3)] {
            for cut in 1..7 {
                let times = [5, 6, 15, 15, 16, 40, 65];
                let (mut whole, mut resumed) = (schedule(every), schedule(every));
                due(&mut whole, &times[..cut]);
                for _ in 0..cut {
                    whole.is_due_after_event();
                }
                resumed.resume(5, times[cut - 1], cut as u64);
                for i in cut..7 {
                    assert_eq!(due(&mut resumed, &times[i..=i]), due(&mut whole, &times[i..=i]), "{cut} {i}");
                    assert_eq!(resumed.is_due_after_event(), whole.is_due_after_event(), "{cut} {i}");
                }
                assert_eq!(resumed.last(), whole.last());
            }
        }
    }

    #[test]
    fn a_dropped_event_does_not_move_time_on() {
        let mut schedule = schedule(Every::StreamUs(10));
        due(&mut schedule, &[0]);
        assert_eq!(schedule.arrival_us(Event::new(100, 4, 0, true)), None);
        assert_eq!(schedule.last(), Last::At(10));
    }

    #[test]
    fn events_are_counted_from_one_prediction_to_the_next() {
        let mut schedule = schedule(Every::Events(3));
        let due: Vec<bool> = (0..7).map(|_| schedule.is_due_after_event()).collect();
        assert_eq!(due, [false, false, true, false, false, true, false]);
        assert_eq!(schedule.last(), Last::Nothing);
    }
}
