//! N-MNIST: the bytes of one digit to events.
//!
//! Five bytes per event, no header, always 34 x 34 pixels: byte 0 is the column x, byte 1 the row
//! y; the first of the other 24 bits is the polarity, and 23 bits are microseconds, most
//! significant first. Source: Orchard, Jayawant, Cohen and Thakor, "Converting static image
//! datasets to spiking neuromorphic datasets using saccades", 2015, and the readme of the data set.
//! The format has no magic number and is only recognised by complete events on the sensor, so
//! [`crate::detect()`] tries it last.

use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::PassedOver;
use crate::options::ReadOptions;
use crate::recording::Recording;

/// Columns and rows.
const SIDE: u8 = 34;
/// Bytes of an event.
const STRIDE: usize = 5;
/// Minimum number of events of a file that is recognised although its last event is incomplete: one
/// event of random bytes is on the sensor once in 57 times.
const ENOUGH: usize = 8;

/// Whether `bytes` can be N-MNIST: events on the sensor, the last complete unless there are many.
pub(crate) fn is_nmnist(bytes: &[u8]) -> bool {
    let least = if bytes.len().is_multiple_of(STRIDE) { 1 } else { ENOUGH };
    let events = bytes.chunks_exact(STRIDE);
    events.len() >= least && events.into_iter().all(|e| e[0] < SIDE && e[1] < SIDE)
}

/// The events of `bytes`.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let format = Format::Nmnist;
    let sensor = Some(Sensor::new(SIDE.into(), SIDE.into()));
    let file = Bytes::file(format.name(), bytes);
    let (records, salvaged) = file.records("the last event", 0, options.salvage)?;
    let (mut events, mut passed) = (Vec::with_capacity(records.len()), PassedOver::new(options.strict));
    for (&[x, y, high, middle, low], at) in records.iter().zip((0..).step_by(STRIDE)) {
        if file.is_inside(sensor, x.into(), y.into(), at, &mut passed)? {
            let t_us = i64::from(u32::from_be_bytes([0, high & 0x7f, middle, low]));
            events.push(Event::new(t_us, x.into(), y.into(), high & 0x80 != 0));
        }
    }
    Ok(Recording { left_out: passed.end(), salvaged, ..Recording::of_events(format, sensor, events) })
}
