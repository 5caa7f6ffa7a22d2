//! The content of one packet in, its events appended, or its elements counted.

use meissner_engine::{Event, Sensor};

use super::flat::{Table, check_name};
use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::evt2::outside;
use crate::recording::StreamKind;

/// Bytes of an event: time, x, y, polarity and three of padding.
const STRIDE: usize = 16;

/// Appends the events of a packet EVTS to `events`.
pub(super) fn append(
    content: Bytes<'_>,
    sensor: Option<Sensor>,
    events: &mut Vec<Event>,
) -> Result<(), IoError> {
    let (start, elements) = Table::root(content, "packet of events", *b"EVTS")?.vector(0, STRIDE)?;
    events.reserve(elements.len() / STRIDE);
    for (index, element) in elements.chunks_exact(STRIDE).enumerate() {
        let t_us = i64::from_le_bytes(array(element));
        let (x, y) = (i16::from_le_bytes(array(&element[8..])), i16::from_le_bytes(array(&element[10..])));
        let at = start + index * STRIDE;
        let (Ok(x), Ok(y)) = (u16::try_from(x), u16::try_from(y)) else {
            return Err(content.malformed(
                "pixel",
                at + 8,
                "x and y of 0 and above",
                format!("x = {x}, y = {y}"),
            ));
        };
        if let Some(sensor) = sensor.filter(|s| !s.contains(x, y)) {
            return Err(outside(content.format, content.place(at + 8), sensor, x.into(), y.into()));
        }
        let on = match element[12] {
            0 => false,
            1 => true,
            other => return Err(content.malformed("polarity", at + 12, "0 or 1", other.to_string())),
        };
        events.push(Event { t_us, x, y, on });
    }
    Ok(())
}

/// How many elements a packet of `kind` holds.
pub(super) fn count(content: Bytes<'_>, kind: StreamKind) -> Result<u64, IoError> {
    // Samples and triggers are tables, which a vector holds as offsets of four bytes.
    let (name, stride) = match kind {
        StreamKind::Events => (*b"EVTS", STRIDE),
        StreamKind::Imu => (*b"IMUS", 4),
        StreamKind::Triggers => (*b"TRIG", 4),
        StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => return Ok(1),
    };
    let (_, elements) = Table::root(content, "packet", name)?.vector(0, stride)?;
    Ok((elements.len() / stride) as u64)
}

/// Refuses a packet table that is none, of which `start` is the start.
pub(super) fn check_table(start: Bytes<'_>) -> Result<(), IoError> {
    check_name(start, "packet table", *b"FTAB")
}
