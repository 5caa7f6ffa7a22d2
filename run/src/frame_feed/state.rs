//! The state of a feed between two inputs: its clock, and the events that later frames will cover.

use meissner_engine::Sensor;
use serde::{Deserialize, Serialize};

/// The state of a feed between two inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FeedState {
    /// Time of the first accepted event.
    pub(crate) epoch_us: i64,
    /// The newest time.
    pub(crate) now_us: i64,
    /// Accepted events so far.
    pub(super) accepted: u64,
    /// Start of the open window, if windows are consecutive.
    pub(super) open_us: Option<i64>,
    /// Time, column, row, polarity of the events of the open window or of the span.
    pub(super) events: Vec<(i64, u16, u16, bool)>,
    /// The same of events that wait until it is clear whether the clock has restarted.
    #[serde(default)]
    pub(super) held: Vec<(i64, u16, u16, bool)>,
}

impl FeedState {
    /// The first field that a feed on `sensor` cannot have written, if there is one: its name, the
    /// expected value and the actual value.
    pub(crate) fn fault(&self, sensor: Sensor) -> Option<(&'static str, String, String)> {
        let &Self { epoch_us, now_us, accepted, open_us, .. } = self;
        if now_us.checked_sub(epoch_us).is_none_or(|span_us| span_us < 0) {
            let expected = format!("from {epoch_us} to 2^63 after it");
            return Some(("newest time in the note", expected, now_us.to_string()));
        }
        if let Some(open_us) = open_us.filter(|open_us| !(epoch_us..=now_us).contains(open_us)) {
            let expected = format!("from {epoch_us} to {now_us}");
            return Some(("open window in the note", expected, open_us.to_string()));
        }
        if accepted < self.events.len() as u64 {
            let expected = format!("at least {}, the events that are kept", self.events.len());
            return Some(("accepted events in the note", expected, accepted.to_string()));
        }
        if let Some((_, x, y, _)) = self.held.iter().find(|&&(_, x, y, _)| !sensor.contains(x, y)) {
            return Some(("held event in the note", format!("a pixel of {sensor}"), format!("({x}, {y})")));
        }
        let mut least_us = open_us.unwrap_or(epoch_us);
        for &(t_us, x, y, _) in &self.events {
            if !(least_us..=now_us).contains(&t_us) || !sensor.contains(x, y) {
                let expected = format!("from {least_us} to {now_us} us on {sensor}");
                return Some(("kept event in the note", expected, format!("{t_us} us at ({x}, {y})")));
            }
            least_us = t_us;
        }
        None
    }
}
