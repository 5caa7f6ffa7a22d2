//! The input of a batch, and the check that an engine could have accepted it.

use crate::{EngineError, Event, Sensor};

/// The input of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Stream<'a> {
    /// Accepted events in order of arrival. For `frozen` in-edges all since the last reset,
    /// otherwise at least those in the window.
    pub events: &'a [Event],
    /// Time of the first event since the reset.
    pub epoch_us: i64,
    /// Current time: that of the last event, or of a later `advance`.
    pub now_us: i64,
}

impl<'a> Stream<'a> {
    /// A stream of all events since a reset, at the time of the last one.
    pub fn new(events: &'a [Event]) -> Self {
        let time = |event: Option<&Event>| event.map_or(0, |e| e.t_us);
        Self { events, epoch_us: time(events.first()), now_us: time(events.last()) }
    }

    /// Refuses streams that no engine on `sensor` accepts. O(events).
    pub(super) fn check(&self, sensor: Sensor) -> Result<(), EngineError> {
        let Self { events, epoch_us, now_us } = *self;
        let ([first, ..], [.., last]) = (events, events) else { return Ok(()) };
        if let Some((i, event)) = events.iter().enumerate().find(|(_, e)| !sensor.contains(e.x, e.y)) {
            let expected = format!("a pixel of {sensor}");
            return Err(refused("pixel", expected, format!("({}, {}) of event {i}", event.x, event.y)));
        }
        if let Some(i) = (1..events.len()).find(|&i| events[i].t_us < events[i - 1].t_us) {
            let [before, after] = [i - 1, i].map(|i| events[i].t_us);
            return Err(refused(
                "times",
                "none to descend",
                format!("{after} us after {before} us at event {i}"),
            ));
        }
        if first.t_us < epoch_us {
            return Err(refused("first event", format!("not before the epoch, {epoch_us} us"), first.t_us));
        }
        if last.t_us > now_us {
            return Err(refused(
                "newest time",
                format!("not before the last event, {} us", last.t_us),
                now_us,
            ));
        }
        if now_us.checked_sub(epoch_us).is_none() {
            let expected = format!("at most 2^63 - 1 us after the epoch, {epoch_us} us");
            return Err(refused("newest time", expected, now_us));
        }
        Ok(())
    }
}

fn refused(what: &'static str, expected: impl ToString, found: impl ToString) -> EngineError {
    EngineError::Stream { what, expected: expected.to_string(), found: found.to_string() }
}
