//! A simulated press that the crate holds, with the truth about it along time: what a network should say.
//!
//! Enters: nothing. Leaves: a source of events, and the angles of the plane that the dome is pressed on. `pipeline/assets/README.md`
//! says how it was made.

use meissner_io::{IoError, decode};

use crate::error::PipelineError;
use crate::source::Source;

/// The network that is trained for this press.
pub const NETWORK: &str = "tactigraph-past";

const EVENTS: &[u8] = include_bytes!("../assets/dome_press.evt3");
const TRUTH: &str = include_str!("../assets/dome_press.csv");
const NAME: &str = "dome_press.evt3 (embedded; simulated, not a real sensor)";

/// The press.
pub struct Press {
    /// Its events.
    pub source: Source,
    /// Time of the first event, in microseconds.
    pub first_us: i64,
    /// Time of the contact, in microseconds.
    pub contact_us: i64,
    /// The last time of the truth, in microseconds.
    pub end_us: i64,
    /// Angles of the plane about x and y in radians. They are those of the whole press.
    pub angles: [f64; 2],
}

impl Press {
    /// The embedded press.
    ///
    /// # Errors
    /// Never: a test reads it.
    pub fn embedded() -> Result<Self, PipelineError> {
        let recording = decode(EVENTS).map_err(|error: IoError| PipelineError::recording(NAME, error))?;
        let first_us = recording.events.first().map_or(0, |event| event.t_us);
        let rows = truth();
        let contact = rows.iter().rposition(|row| row[1] <= 0.0).unwrap_or(0);
        let last = rows.last().copied().unwrap_or_default();
        Ok(Self {
            source: Source::embedded(recording, NAME),
            first_us,
            contact_us: rows[contact][0] as i64,
            end_us: last[0] as i64,
            angles: [last[2], last[3]],
        })
    }
}

/// Time in microseconds, depth in mm, roll and pitch in radians.
fn truth() -> Vec<[f64; 4]> {
    let number = |text: &str| text.parse().expect("the file has numbers");
    let row = |line: &str| {
        let mut values = line.split(',').map(number);
        std::array::from_fn(|_| values.next().expect("a line has four values"))
    };
    TRUTH.lines().skip(1).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::{Press, truth};

    #[test]
    fn the_embedded_press_has_events_from_contact_to_its_end_and_constant_angles() {
        let press = Press::embedded().expect("it can be read");
        let events: Vec<_> = press.source.map(|event| event.expect("it can be read")).collect();
        assert!((10_000..20_000).contains(&events.len()), "{}", events.len());
        assert_eq!(events[0].t_us, press.first_us);
        let span = press.contact_us..=press.end_us + 1_000;
        let during = events.iter().filter(|event| span.contains(&event.t_us)).count();
        assert!(during * 100 > events.len() * 99, "{during} of {}", events.len());
        let tilt = press.angles[0].hypot(press.angles[1]).to_degrees();
        assert!((tilt - 6.0).abs() < 0.01, "{tilt}");
        let rows = truth();
        assert!(rows.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1]));
        assert!(rows.iter().all(|row| row[2..] == press.angles));
    }
}
