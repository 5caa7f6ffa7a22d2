//! Prophesee DAT, version 2: events from and to 8 bytes each.
//!
//! After the text header ([`crate::prophesee`]) stand two bytes, the type of the events (0x0C, in old files
//! 0x00) and their size (8); then for each event two words of 32 bits, least significant byte first: the time
//! in microseconds, and bits 13-0 x, 27-14 y, 31-28 polarity (0 or 1). Source: the vendor's page "DAT File
//! Format". Invariant: the 32-bit time wraps where it falls by 2^31 or more; a smaller step back is a step
//! back. Version 1 packs x and y otherwise and is refused. A reader of our own, because it is eight bytes an
//! event.

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array, units};
use crate::check::{Held, cannot_hold};
use crate::error::{IoError, Place, beginning};
use crate::evt2::outside;
use crate::format::Format;
use crate::prophesee::Header;
use crate::recording::Recording;

/// Bytes of an event.
const STRIDE: usize = 8;
/// Coordinates have 14 bits.
pub(crate) const SIDE: u16 = 1 << 14;
/// The types of events that are brightness changes.
const CHANGES: [u8; 2] = [0x0c, 0x00];
/// Times count to here, and wrap.
const TIME_RANGE: i64 = 1 << 32;

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Dat;
    let header = Header::parse(format, bytes)?;
    // A file without a version is older than version 2 and packs its pixels otherwise.
    if header.version.as_deref() != Some("2") {
        let actual = header
            .version
            .map_or("no version".to_owned(), |version| format!("version {}", beginning(&version, 40)));
        return Err(IoError::Unsupported { expected: "DAT of version 2", actual });
    }
    let sensor = header.sensor(format, SIDE)?;
    let file = Bytes::new(format, bytes, Place::Byte(0));
    let [kind, size] = array(file.get("type and size of the events", header.end, 2)?);
    if !CHANGES.contains(&kind) || usize::from(size) != STRIDE {
        let expected = "type 0x0c or 0x00 and 8 bytes an event";
        let actual = format!("type {kind:#04x} and {size} bytes");
        return Err(file.malformed("type and size of the events", header.end, expected, actual));
    }

    let start = header.end + 2;
    let (chunks, salvaged) = units(format, "the last event", bytes, start, STRIDE, salvage)?;
    let mut events = Vec::with_capacity(chunks.len());
    let (mut wrapped_us, mut newest) = (0, 0);
    for (index, chunk) in chunks.enumerate() {
        let both = u64::from_le_bytes(array(chunk));
        let (time, pixel) = (i64::from(both as u32), (both >> 32) as u32);
        let (x, y) = ((pixel & 0x3fff) as u16, (pixel >> 14 & 0x3fff) as u16);
        let at = start + index * STRIDE;
        if let Some(sensor) = sensor.filter(|s| !s.contains(x, y)) {
            return Err(outside(format, file.place(at), sensor, x.into(), y.into()));
        }
        if pixel >> 29 != 0 {
            return Err(file.malformed("polarity", at, "0 or 1", (pixel >> 28).to_string()));
        }
        if newest - time >= TIME_RANGE / 2 {
            wrapped_us += TIME_RANGE;
        }
        newest = time;
        events.push(Event::new(wrapped_us + time, x, y, pixel >> 28 == 1));
    }
    Ok(Recording { format, sensor, events, other_streams: Vec::new(), salvaged })
}

/// Refuses the events that the format cannot hold.
pub(crate) fn check(events: &[Event]) -> Result<(), IoError> {
    let held = Held { format: Format::Dat, most_t_us: TIME_RANGE - 1, side: SIDE };
    let mut newest_us = 0;
    for (index, event) in events.iter().enumerate() {
        held.check(index, event)?;
        if newest_us - event.t_us >= TIME_RANGE / 2 {
            let expected = "in order, or less than 2^31 us earlier";
            let actual = format!("{} after {newest_us}", event.t_us);
            return Err(cannot_hold(Format::Dat, index, "t_us", expected, actual));
        }
        newest_us = event.t_us;
    }
    Ok(())
}

/// Writes the header and `events`, which [`check`] has passed.
pub(crate) fn encode(sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "% Data file containing CD events.\n% Version 2")?;
    if let Some(Sensor { width, height }) = sensor {
        writeln!(out, "% Height {height}\n% Width {width}")?;
    }
    out.write_all(&[CHANGES[0], STRIDE as u8])?;
    for event in events {
        let pixel = u32::from(event.x) | u32::from(event.y) << 14 | u32::from(event.on) << 28;
        out.write_all(&(u64::from(event.t_us as u32) | u64::from(pixel) << 32).to_le_bytes())?;
    }
    Ok(())
}
