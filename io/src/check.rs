//! What a format can hold, asked of every event before the first byte is written.

use meissner_engine::{Event, Sensor};

use crate::error::IoError;
use crate::format::Format;
use crate::{dat, evt3};

/// Refuses events that `format` cannot hold, or that lie beside `sensor`; also formats that are only read.
pub(crate) fn check(format: Format, sensor: Option<Sensor>, events: &[Event]) -> Result<(), IoError> {
    if !format.is_writable() {
        return Err(IoError::Unsupported {
            expected: "CSV, npy, DAT or EVT3 to be written",
            actual: format.to_string(),
        });
    }
    if let Some(sensor) = sensor {
        let (expected, most) = match format {
            Format::Evt3 => ("a sensor of 1 to 2048 pixels a side", evt3::SIDE),
            Format::Dat => ("a sensor of 1 to 16384 pixels a side", dat::SIDE),
            _ => ("a sensor of 1 to 65535 pixels a side", u16::MAX),
        };
        if !(1..=most).contains(&sensor.width) || !(1..=most).contains(&sensor.height) {
            return Err(IoError::Unsupported { expected, actual: format!("{sensor} for {format}") });
        }
        check_sensor(format, sensor, events)?;
    }
    match format {
        Format::Evt3 => evt3::check(events),
        Format::Dat => dat::check(events),
        _ => Ok(()),
    }
}

fn check_sensor(format: Format, sensor: Sensor, events: &[Event]) -> Result<(), IoError> {
    let Some(index) = events.iter().position(|e| !sensor.contains(e.x, e.y)) else {
        return Ok(());
    };
    let (field, side, actual) = match events[index] {
        Event { x, .. } if x >= sensor.width => ("x", sensor.width, x),
        Event { y, .. } => ("y", sensor.height, y),
    };
    Err(cannot_hold(format, index, field, format!("below {side}, the sensor's"), actual.to_string()))
}

/// The ranges of a binary format.
pub(crate) struct Held {
    pub(crate) format: Format,
    /// Latest time; the earliest is 0.
    pub(crate) most_t_us: i64,
    /// One past the last column and row.
    pub(crate) side: u16,
}

impl Held {
    pub(crate) fn check(&self, index: usize, event: &Event) -> Result<(), IoError> {
        let &Self { format, most_t_us, side } = self;
        let &Event { t_us, x, y, .. } = event;
        if !(0..=most_t_us).contains(&t_us) {
            return Err(cannot_hold(format, index, "t_us", format!("0 to {most_t_us}"), t_us.to_string()));
        }
        let beyond = [("x", x), ("y", y)].into_iter().find(|&(_, value)| value >= side);
        beyond.map_or(Ok(()), |(field, value)| {
            Err(cannot_hold(format, index, field, format!("below {side}"), value.to_string()))
        })
    }
}

pub(crate) fn cannot_hold(
    format: Format,
    index: usize,
    field: &'static str,
    expected: impl Into<String>,
    actual: String,
) -> IoError {
    IoError::CannotHold { format, index, field, expected: expected.into(), actual }
}
