//! Input that reaches no prediction without anybody having asked for that.
//!
//! Enters: counts. Leaves: a warning for each reason that more than [`PERCENT`] of the input was lost for, with what is
//! likely to help. What filters and queues drop was asked for, and is not counted. Of a live stream, it is told after a
//! thousand events, ten thousand and so on, since its end may be days away.

use meissner_engine::{EventCounters, Sensor};
use serde::Serialize;

use crate::refusals;
use crate::text::grouped;

/// Share of the input that may be lost without a warning.
const PERCENT: u64 = 1;

/// Lost input, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// As in the counts of the summary.
    pub reason: &'static str,
    /// How many.
    pub count: u64,
    /// Of so many.
    pub of: u64,
    /// The same as a sentence, with what is likely to help.
    pub message: String,
}

/// Tells what is lost, each reason once.
#[derive(Debug)]
pub struct Watch {
    /// Events before the next look, while the stream goes on.
    next: u64,
    told: Vec<&'static str>,
}

impl Watch {
    /// A watch over a stream, looking while it goes on where it is `live`.
    pub fn new(live: bool) -> Self {
        Self { next: if live { 1000 } else { u64::MAX }, told: Vec::new() }
    }

    /// So many events have been taken: tells what is `lost`, with the name of what is read, where it is time to look.
    pub fn look(&mut self, taken: u64, recording: &str, lost: impl FnOnce() -> Lost) {
        if taken >= self.next {
            self.next = self.next.saturating_mul(10);
            self.end(recording, lost());
        }
    }

    /// The stream has ended: tells what has not been told, and gives all warnings.
    pub fn end(&mut self, recording: &str, lost: Lost) -> Vec<Warning> {
        let warnings = lost.warnings();
        for Warning { reason, count, message, .. } in &warnings {
            // Of few lines, each has been told.
            let is_known = *reason == LINES && *count <= refusals::TOLD;
            if !is_known && !self.told.contains(reason) {
                log::warn!("{recording}: {message}");
                self.told.push(reason);
            }
        }
        warnings
    }
}

/// What may have been lost of a stream of events.
#[derive(Clone, Copy, Debug)]
pub struct Lost {
    /// What became of the events that reached the network.
    pub events: EventCounters,
    /// The sensor.
    pub sensor: Sensor,
    /// Accepted events that no frame shows.
    pub outside_crop: u64,
    /// Lines that were no events.
    pub lines_refused: u64,
}

impl Lost {
    /// The warnings, each also told on standard error, with the name of what was read.
    pub fn warn(self, recording: &str) -> Vec<Warning> {
        Watch::new(false).end(recording, self)
    }

    fn warnings(self) -> Vec<Warning> {
        let Self { events, sensor, outside_crop, lines_refused } = self;
        let outside = format!(
            "events are outside the sensor of {sensor} pixels and are dropped: \
             --sensor may not be that of the recording"
        );
        let late = "events are earlier than one before them and are dropped: the columns of a text may be in another \
                    order than t,x,y,p (a header names them), or the recording is not sorted by time (--late clamp lets \
                    such events in)";
        let range = "events are too far in time from the first one and are dropped: times may not be in microseconds, or \
                     the first one is wrong";
        let crop = "events are outside the part of the sensor that the network's frames show: the network may be made for \
                    another sensor (`meissner inspect` shows it)";
        let counts = [
            ("outside_sensor", events.outside_sensor, events.pushed, outside.as_str()),
            ("late", events.late, events.pushed, late),
            ("time_out_of_range", events.time_out_of_range, events.pushed, range),
            ("outside_crop", outside_crop, events.accepted, crop),
        ];
        let lost = counts.into_iter().filter_map(|(reason, count, of, why)| warning(reason, count, of, why));
        lost.chain(lines(lines_refused, events.pushed)).collect()
    }
}

/// Name of the reason that lines have.
const LINES: &str = "lines_refused";

/// The warning of lines that were refused, beside others that were `taken`.
pub fn lines(refused: u64, taken: u64) -> Option<Warning> {
    let why = "lines are refused: the first are named above; --strict makes the first an error";
    warning(LINES, refused, taken + refused, why)
}

fn warning(reason: &'static str, count: u64, of: u64, why: &str) -> Option<Warning> {
    (u128::from(count) * 100 > u128::from(of) * u128::from(PERCENT)).then(|| {
        let percent = count as f64 / of as f64 * 100.0;
        let message = format!("{} of {} ({percent:.1} %) {why}", grouped(count), grouped(of));
        Warning { reason, count, of, message }
    })
}

#[cfg(test)]
mod tests {
    use super::{Lost, Watch};
    use meissner_engine::{EventCounters, Sensor};

    fn reasons(events: EventCounters, outside_crop: u64, lines_refused: u64) -> Vec<&'static str> {
        let lost = Lost { events, sensor: Sensor::new(4, 4), outside_crop, lines_refused };
        lost.warnings().into_iter().map(|warning| warning.reason).collect()
    }

    #[test]
    fn a_live_stream_is_looked_at_after_a_thousand_events_and_then_ever_less_often() {
        let looks = |live| {
            let (mut watch, mut looks) = (Watch::new(live), Vec::new());
            for taken in 1..=200_000 {
                watch.look(taken, "stream", || {
                    looks.push(taken);
                    let (events, sensor) = (EventCounters::default(), Sensor::new(4, 4));
                    Lost { events, sensor, outside_crop: 0, lines_refused: 0 }
                });
            }
            looks
        };
        assert_eq!((looks(true), looks(false)), (vec![1000, 10_000, 100_000], vec![]));
    }

    #[test]
    fn more_than_a_hundredth_is_warned_of_and_a_hundredth_is_not() {
        let events = EventCounters { pushed: 1000, accepted: 500, late: 10, ..EventCounters::default() };
        assert!(reasons(events, 5, 10).is_empty());
        assert_eq!(reasons(EventCounters { late: 11, ..events }, 5, 0), ["late"]);
        assert_eq!(reasons(EventCounters { outside_sensor: 11, ..events }, 0, 0), ["outside_sensor"]);
        assert_eq!(reasons(EventCounters { time_out_of_range: 11, ..events }, 0, 0), ["time_out_of_range"]);
        assert_eq!(reasons(events, 6, 11), ["outside_crop", "lines_refused"]);
        assert!(reasons(EventCounters::default(), 0, 0).is_empty());
    }
}
