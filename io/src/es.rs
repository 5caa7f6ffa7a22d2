//! Event Stream 2 (`.es`), changes of brightness: events from and to five bytes each.
//!
//! ```text
//! Event Stream               12 bytes
//! 2 0 0                      version: major, minor, patch
//! 1                          type of the stream; 1: changes of brightness
//! width, height              u16 each, least significant byte first
//! events                     one byte, then x and y (u16 each, least significant byte first)
//! ```
//!
//! The first byte of an event has the polarity in bit 0, and in bits 7-1 the microseconds since the
//! event before it (first: since 0), at most 126. A byte 0xff before an event adds 127; 0xfe is a
//! reset, which has no meaning here. Rows count from the bottom; in the decoded events, they count
//! from the top. Source: <https://github.com/neuromorphic-paris/event_stream>, version 2; for the
//! rows, its author's `faery`. Invariant: times never go back.

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::PassedOver;
use crate::options::ReadOptions;
use crate::recording::{Capacity, Recording};

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"Event Stream";
/// The only type of stream that is read.
const CHANGES: u8 = 1;
/// Bytes of the header.
const HEADER: usize = 20;
/// Bytes of an event.
const STRIDE: usize = 5;
/// The byte that adds [`OVERFLOW_US`].
const OVERFLOW: u8 = 0xff;
const OVERFLOW_US: i64 = 127;
/// Overflow bytes that are written at once.
const OVERFLOWS: [u8; 4096] = [OVERFLOW; 4096];
/// The reset byte, which has no meaning here.
const RESET: u8 = 0xfe;
/// Latest time that is written: 2.4 hours; such a file starts with 65 MiB of overflows.
const LATEST_US: i64 = (1 << 33) - 1;

/// The events that the format can hold.
pub(crate) const CAPACITY: Capacity = Capacity {
    times: 0..=LATEST_US,
    side: 1 << 16,
    sensor: "a sensor of 1 to 65535 pixels a side",
    steps: "in order",
    is_wrap: |newest_us, t_us| t_us < newest_us,
};

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let format = Format::Es;
    let file = Bytes::file(format.name(), bytes);
    file.magic(MAGIC)?;
    let [major, minor, patch] = file.array("version", MAGIC.len())?;
    if major != 2 {
        let actual = format!("version {major}.{minor}.{patch}");
        return Err(IoError::Unsupported { expected: "Event Stream of version 2", actual });
    }
    let [kind] = file.array("type of the stream", 15)?;
    if kind != CHANGES {
        let name =
            ["generic events", "", "ATIS events", "display events", "colour events"].get(usize::from(kind));
        let actual = format!("type {kind} ({})", name.copied().unwrap_or("unknown"));
        return Err(IoError::Unsupported { expected: "Event Stream of DVS events (type 1)", actual });
    }
    let sensor = Sensor::new(file.u16("sensor width", 16)?, file.u16("sensor height", 18)?);
    if sensor.width == 0 || sensor.height == 0 {
        return Err(file.malformed("sensor", 16, "1 to 65535 pixels a side", sensor));
    }

    let mut events = Vec::with_capacity((bytes.len() - HEADER) / STRIDE);
    let mut passed = PassedOver::new(options.strict);
    let (mut t_us, mut at, mut salvaged) = (0, HEADER, None);
    while let Some(&first) = bytes.get(at) {
        match first {
            RESET => at += 1,
            OVERFLOW => {
                let run = overflows(&bytes[at..]);
                t_us += OVERFLOW_US * run as i64;
                at += run;
            }
            _ if options.salvage && bytes.len() - at < STRIDE => {
                salvaged = Some(file.salvage("the last event", at));
                break;
            }
            _ => {
                let [first, x0, x1, y0, y1] = file.array("the last event", at)?;
                let (x, y) = (u16::from_le_bytes([x0, x1]), u16::from_le_bytes([y0, y1]));
                t_us += i64::from(first >> 1);
                if file.is_inside(Some(sensor), x, y, at, &mut passed)? {
                    events.push(Event::new(t_us, x, sensor.height - 1 - y, first & 1 == 1));
                }
                at += STRIDE;
            }
        }
    }
    let left_out = passed.end();
    Ok(Recording { left_out, salvaged, ..Recording::of_events(format, Some(sensor), events) })
}

/// Number of bytes at the start of `bytes` that are overflows: minutes of silence have millions.
fn overflows(bytes: &[u8]) -> usize {
    let (blocks, _) = bytes.as_chunks::<64>();
    let whole = 64 * blocks.iter().take_while(|&block| block == &OVERFLOWS[..64]).count();
    whole + bytes[whole..].iter().take_while(|&&byte| byte == OVERFLOW).count()
}

/// Writes the header and `events`, which [`CAPACITY`] allows.
pub(crate) fn encode(sensor: Sensor, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    out.write_all(MAGIC)?;
    out.write_all(&[2, 0, 0, CHANGES])?;
    out.write_all(&sensor.width.to_le_bytes())?;
    out.write_all(&sensor.height.to_le_bytes())?;
    let mut newest_us = 0;
    for event in events {
        let mut step = event.t_us - newest_us;
        newest_us = event.t_us;
        while step >= OVERFLOW_US {
            let run = (step / OVERFLOW_US).min(OVERFLOWS.len() as i64);
            out.write_all(&OVERFLOWS[..run as usize])?;
            step -= run * OVERFLOW_US;
        }
        let ([x0, x1], [y0, y1]) = (event.x.to_le_bytes(), (sensor.height - 1 - event.y).to_le_bytes());
        out.write_all(&[(step as u8) << 1 | u8::from(event.on), x0, x1, y0, y1])?;
    }
    Ok(())
}
