//! When predictions are read: every N events, every period of stream time, or at the end.
//!
//! Input: the times of accepted events, or of frames. Output: the times at which a prediction is
//! due before an event enters, and whether one is due after it; the same for all readers.

use std::fmt;
use std::str::FromStr;

use crate::text::{TIME_FORMS, display_us, span_us};

/// When a prediction is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// Once, at the end.
    End,
    /// After this many accepted events.
    Events(u64),
    /// After this many microseconds of stream time.
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
                _ => span_us(text).map(Self::StreamUs).map_err(|_| {
                    format!("expected `event`, `end`, a number of events such as 100, or {TIME_FORMS}")
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
            Self::StreamUs(us) => f.write_str(&display_us(us)),
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    every: Every,
    /// Accepted events since the last prediction, for [`Every::Events`].
    since: u64,
    /// Whether an event has been accepted.
    has_begun: bool,
    /// Next time of [`Every::StreamUs`], after the first event and within the clock.
    due_us: Option<i64>,
}

impl Schedule {
    pub(crate) fn new(every: Every) -> Self {
        Self { every, since: 0, has_begun: false, due_us: None }
    }

    /// Continues a schedule that has seen `accepted` events, from the time of the first to
    /// `now_us`. Periods count from the first event, even if the other schedule had another period.
    pub(crate) fn resume(&mut self, first_us: i64, now_us: i64, accepted: u64) {
        self.begin(first_us);
        self.skip_to(now_us);
        if let Every::Events(events) = self.every {
            self.since = accepted % events;
        }
    }

    /// Forgets the clock; the next event starts a new one. The count of events continues.
    pub(crate) fn restart(&mut self) {
        (self.has_begun, self.due_us) = (false, None);
    }

    /// Starts at the first event, accepted at `t_us`. Later calls have no effect.
    pub(crate) fn begin(&mut self, t_us: i64) {
        if let (Every::StreamUs(period), false) = (self.every, self.has_begun) {
            self.due_us = t_us.checked_add(period);
        }
        self.has_begun = true;
    }

    /// The time at which the next event will enter, if stream time matters. Calls `arrival_us` for
    /// it; a dropped event has no such time and does not advance the clock.
    pub(crate) fn arrival_us(&mut self, arrival_us: impl FnOnce() -> Option<i64>) -> Option<i64> {
        let Every::StreamUs(_) = self.every else { return None };
        let t_us = arrival_us()?;
        self.begin(t_us);
        Some(t_us)
    }

    /// Takes the next time due before `t_us`: an event at a due time belongs to its window.
    pub(crate) fn due_before(&mut self, t_us: i64) -> Option<i64> {
        let due = self.due_us.filter(|&due| due < t_us)?;
        self.due_us = due.checked_add(self.period_us()?);
        Some(due)
    }

    /// Calls `read` with each time due before `t_us`. `read` returns the number of events in the
    /// window. If it returns 0, the window stays empty, and the other times are skipped.
    pub(crate) fn each_due_before<E>(
        &mut self,
        t_us: i64,
        mut read: impl FnMut(i64) -> Result<usize, E>,
    ) -> Result<(), E> {
        while let Some(due_us) = self.due_before(t_us) {
            if read(due_us)? == 0 {
                self.skip_to(t_us);
            }
        }
        Ok(())
    }

    /// Skips the times before `t_us`, and returns their number.
    pub(crate) fn skip_to(&mut self, t_us: i64) -> u64 {
        let Some((due, period)) = self.due_us.zip(self.period_us()) else { return 0 };
        let count = times_before(due, t_us, period);
        self.due_us = i64::try_from(i128::from(due) + i128::from(count) * i128::from(period)).ok();
        count
    }

    /// Counts an accepted event, and returns whether a prediction is due.
    pub(crate) fn is_due_after_event(&mut self) -> bool {
        let Every::Events(events) = self.every else { return false };
        self.since += 1;
        if self.since == events {
            self.since = 0;
        }
        self.since == 0
    }

    pub(crate) fn since(&self) -> u64 {
        self.since
    }

    pub(crate) fn period_us(&self) -> Option<i64> {
        if let Every::StreamUs(period) = self.every { Some(period) } else { None }
    }

    /// The prediction that is due after the last event.
    pub(crate) fn last(&self) -> Last {
        match self.every {
            Every::End => Last::Now,
            Every::Events(_) => Last::Nothing,
            // All times before the last event are done, so this is the first time that covers it.
            Every::StreamUs(_) => self.due_us.map_or(Last::Nothing, Last::At),
        }
    }
}

/// The number of the times `first`, `first + period`, ... before `end`.
pub(crate) fn times_before(first: i64, end: i64, period: i64) -> u64 {
    // The difference can exceed an i64 if times span its whole range.
    let (span, period) = (i128::from(end) - i128::from(first), i128::from(period));
    u64::try_from((span + period - 1).div_euclid(period)).unwrap_or(0)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Last {
    /// No prediction.
    Nothing,
    /// A prediction for the window as it is.
    Now,
    /// A prediction for the window at this time, in microseconds.
    At(i64),
}
