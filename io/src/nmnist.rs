//! N-MNIST: the bytes of one digit in, its events out.
//!
//! Five bytes an event, no header, 34 x 34 pixels always: byte 0 the column x, byte 1 the row y, then 24 bits
//! of which the first is the polarity and the other 23 are microseconds, most significant first. Source:
//! Orchard, Jayawant, Cohen and Thakor, "Converting static image datasets to spiking neuromorphic datasets
//! using saccades", 2015, and the readme of the data set. The format has no magic, so that "five bytes an
//! event, each on the sensor" is all that tells it: [`crate::detect()`] tries it last.

use meissner_engine::{Event, Sensor};

use crate::bytes::{array, units};
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::Recording;

/// Columns and rows.
const SIDE: u8 = 34;
/// Bytes of an event.
const STRIDE: usize = 5;

/// Events that tell the format of a file whose last event is not whole: other bytes pass one in 57 times.
const ENOUGH: usize = 8;

/// Whether `bytes` can be N-MNIST: at least one event, every one on the sensor, and whole events only, or several and one that is cut short.
pub(crate) fn is_nmnist(bytes: &[u8]) -> bool {
    let least = if bytes.len().is_multiple_of(STRIDE) { 1 } else { ENOUGH };
    let events = bytes.chunks_exact(STRIDE);
    events.len() >= least && events.into_iter().all(|e| e[0] < SIDE && e[1] < SIDE)
}

/// The events of `bytes`.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Nmnist;
    let sensor = Sensor::new(u16::from(SIDE), u16::from(SIDE));
    let (chunks, salvaged) = units(format, "the last event", bytes, 0, STRIDE, salvage)?;
    let mut events = Vec::with_capacity(chunks.len());
    for (index, chunk) in chunks.enumerate() {
        let [x, y, high, middle, low] = array(chunk);
        if x >= SIDE || y >= SIDE {
            let place = Place::Byte((index * STRIDE) as u64);
            return Err(IoError::OutsideSensor { format, place, sensor, x: x.into(), y: y.into() });
        }
        let t_us = i64::from(u32::from_be_bytes([0, high & 0x7f, middle, low]));
        events.push(Event::new(t_us, x.into(), y.into(), high & 0x80 != 0));
    }
    Ok(Recording { format, sensor: Some(sensor), events, other_streams: Vec::new(), salvaged })
}
