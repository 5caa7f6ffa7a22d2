//! What a network or an engine has to be warned of, for the log and for calls that return it.

use std::ffi::c_char;
use std::time::{Duration, Instant};

use meissner::{EventCounters, Sensor};

use crate::arguments::{place, room};
use crate::log;
use crate::status::Failure;

/// Time between two warnings of losses of an engine.
const PERIOD: Duration = Duration::from_secs(1);

/// Reasons for which more than one of a hundred events was dropped, with the likely cause, and restarts of the clock.
pub(crate) fn of_losses(events: &EventCounters, sensor: Sensor) -> Vec<String> {
    let outside = format!(
        "outside the sensor of {sensor} pixels: the size of the sensor may not be that of the events"
    );
    let late = "earlier than one before them: the events may not be sorted by time, or the clock of the sensor went back";
    let outlier = "far ahead of those before and after them: their times are probably damaged";
    let range =
        "too far in time from the first one: times may not be in microseconds, or the first one is wrong";
    let counts = [
        (events.outside_sensor, &*outside),
        (events.late, late),
        (events.time_out_of_range, range),
        (events.outliers, outlier),
    ];
    let is_large = |count: u64| u128::from(count) * 100 > u128::from(events.pushed);
    let large = counts.into_iter().filter(|&(count, _)| is_large(count));
    let mut found: Vec<String> =
        large.map(|(count, why)| format!("{count} of {} events are dropped, {why}", events.pushed)).collect();
    if events.restarts > 0 {
        let times = if events.restarts == 1 { String::new() } else { format!(" {} times", events.restarts) };
        found.push(format!(
            "the clock of the sensor has restarted{times}: the network began anew, without the events before"
        ));
    }
    found
}

/// When the losses of an engine were last looked at.
#[derive(Clone, Debug, Default)]
pub(crate) struct LossWatch {
    last: Option<Instant>,
}

impl LossWatch {
    /// Whether it is time to tell losses, of which there are new ones. Nothing is allocated for a log that nobody reads.
    pub(crate) fn is_due(&mut self) -> bool {
        if !log::is_read() || self.last.is_some_and(|last| last.elapsed() < PERIOD) {
            return false;
        }
        self.last = Some(Instant::now());
        true
    }
}

/// Writes `lines` as a text to `text`, which has room for `capacity` bytes, and their number to `length`.
///
/// # Safety
/// As [`room`] and [`place`].
pub(crate) unsafe fn write(
    text: *mut c_char,
    capacity: usize,
    length: *mut usize,
    lines: impl FnOnce() -> Result<Vec<String>, Failure>,
) -> Result<(), Failure> {
    // SAFETY: the caller's.
    let (text, length) = unsafe { (room(text.cast::<u8>(), capacity, "text")?, place(length, "length")?) };
    // The names in it are of files: a NUL would end it.
    let lines = lines()?.iter().flat_map(|line| [line, "\n"]).collect::<String>().replace('\0', " ") + "\0";
    length.write(lines.len());
    text.copy(lines.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::of_losses;
    use meissner::{EventCounters, Sensor};

    #[test]
    fn more_than_a_hundredth_is_warned_of_and_a_hundredth_is_not() {
        let events = EventCounters { pushed: 1000, outside_sensor: 10, late: 11, ..EventCounters::default() };
        let found = of_losses(&events, Sensor::new(4, 4));
        assert!(
            found.len() == 1 && found[0].starts_with("11 of 1000 events are dropped, earlier"),
            "{found:?}"
        );
        assert!(of_losses(&EventCounters::default(), Sensor::new(4, 4)).is_empty());
        let events = EventCounters { pushed: 1000, restarts: 2, outliers: 11, ..EventCounters::default() };
        let found = of_losses(&events, Sensor::new(4, 4));
        assert!(
            found.len() == 2 && found[0].starts_with("11 of 1000 events are dropped, far ahead"),
            "{found:?}"
        );
        assert!(found[1].starts_with("the clock of the sensor has restarted 2 times"), "{found:?}");
    }
}
