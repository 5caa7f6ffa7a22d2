//! Prophesee DAT, version 2: events from and to 8 bytes each.
//!
//! Two bytes follow the text header ([`crate::prophesee`]): the type of the events (0x0C, in old
//! files 0x00) and their size (8). Each event has two words of 32 bits, least significant byte
//! first: the time in microseconds, and bits 13-0 x, 27-14 y, 31-28 polarity (0 or 1). Source: the
//! vendor's page "DAT File Format". Invariant: the 32-bit time wraps if it falls by 2^31 or more.
//! Events outside the sensor or with another polarity are left out and counted, unless the reader
//! is strict. Version 1 is refused because it has a different layout.

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::{Format, beginning};
use crate::left_out::{LeftOutKind, PassedOver};
use crate::options::ReadOptions;
use crate::prophesee::{Header, WrappingClock};
use crate::recording::{Capacity, Recording};
use crate::seek::Records;

/// Bytes of an event.
const STRIDE: usize = 8;
/// Coordinates have 14 bits.
const SIDE: u16 = 1 << 14;
/// The types of events that are brightness changes.
const CHANGES: [u8; 2] = [0x0c, 0x00];
/// Times count from 0 to this value - 1, and wrap.
const TIME_RANGE: i64 = 1 << 32;

/// The events that the format can hold.
pub(crate) const CAPACITY: Capacity = Capacity {
    times: 0..=TIME_RANGE - 1,
    side: SIDE as u32,
    sensor: "a sensor of 1 to 16384 pixels a side",
    steps: "in order, or less than 2^31 us earlier",
    is_wrap: |newest_us, t_us| newest_us - t_us >= TIME_RANGE / 2,
};

/// The content of the header.
pub(crate) struct Layout {
    sensor: Option<Sensor>,
    /// First byte of the first event.
    start: usize,
    strict: bool,
}

impl Records for Layout {
    const PERIOD: Option<i64> = Some(TIME_RANGE);

    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let header = Header::parse(file)?;
        // A file without a version is older than version 2 and has another layout.
        if header.version.as_deref() != Some("2") {
            let version = |version: String| format!("version {}", beginning(&version, 40));
            let actual = header.version.map_or("no version".to_owned(), version);
            return Err(IoError::Unsupported { expected: "DAT of version 2", actual });
        }
        let sensor = header.sensor(file, SIDE)?;
        let what = "type and size of the events";
        let [kind, size] = file.array(what, header.end)?;
        if !CHANGES.contains(&kind) || usize::from(size) != STRIDE {
            let expected = "type 0x0c or 0x00 and 8 bytes an event";
            let actual = format!("type {kind:#04x} and {size} bytes");
            return Err(file.malformed(what, header.end, expected, actual));
        }
        Ok(Self { sensor, start: header.end + 2, strict: options.strict })
    }

    fn start(&self) -> usize {
        self.start
    }

    fn stride(&self) -> usize {
        STRIDE
    }

    fn clock(&self, record: &[u8]) -> Option<i64> {
        Some(u32::from_le_bytes(array(record)).into())
    }

    fn decode(
        &self,
        records: Bytes<'_>,
        mut clock: WrappingClock,
        salvage: bool,
    ) -> Result<Recording, IoError> {
        let sensor = self.sensor;
        let (all, salvaged) = records.records("the last event", 0, salvage)?;
        let (mut events, mut passed) = (Vec::with_capacity(all.len()), PassedOver::new(self.strict));
        for (record, at) in all.iter().zip((0..).step_by(STRIDE)) {
            let both = u64::from_le_bytes(*record);
            let (time, pixel) = (i64::from(both as u32), (both >> 32) as u32);
            let (x, y) = ((pixel & 0x3fff) as u16, (pixel >> 14 & 0x3fff) as u16);
            let t_us = clock.advance(time);
            if pixel >> 29 != 0 {
                let error = records.malformed("polarity", at, "0 or 1", pixel >> 28);
                passed.pass(LeftOutKind::Malformed, 1, error)?;
            } else if records.is_inside(sensor, x, y, at, &mut passed)? {
                events.push(Event::new(t_us, x, y, pixel >> 28 == 1));
            }
        }
        let left_out = passed.end();
        Ok(Recording { left_out, salvaged, ..Recording::of_events(Format::Dat, sensor, events) })
    }
}

/// Writes the header and `events`, which [`CAPACITY`] allows.
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
