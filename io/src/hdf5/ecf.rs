//! ECF, the compression of Prophesee's records.
//!
//! ```text
//! 4 * number of events + layout     u32
//! time of the first event           u64
//! times       byte: step (bits 7-4), events at the time (3-0; 15: the next u16); before it,
//!             bytes with bits 7-4 set have longer steps in bits 3-0, lowest four bits first
//! layout 2    four events of 24 bits in three u32: row (11), column (11), polarity
//! others      u16: row (bits 15-5), its events (bits 4-0; 31: the next u16)
//! layout 1    four events of 12 bits in three u16: column (11), polarity
//! layout 0    u16: column (bits 15-5), which of the next five follow (bits 4-0, nearest first);
//!             byte: polarity (bit 7), its events (bits 6-0; 127: the next u16)
//! ```
//!
//! Three words hold four events from the highest bit on; if an event lies in two words, the first
//! contains its low bits. All words begin with the least significant byte. A chunk unpacks to
//! records of 16 bytes: x and y (u16), p (i16), two bytes of padding, t (i64). Source: the vendor's
//! coder, <https://github.com/prophesee-ai/hdf5_ecf>. Invariant: a chunk has at most 65535 events.

use crate::bytes::Bytes;
use crate::error::IoError;

/// HDF5's number of the filter.
pub(super) const FILTER: u16 = 0x8ecf;

/// Maximum number of events of a chunk.
const MAX_EVENTS: usize = 65535;
/// Bytes of a record.
pub(crate) const RECORD: usize = 16;

/// The records of `chunk`.
pub(crate) fn decode(chunk: &[u8]) -> Result<Vec<u8>, IoError> {
    let mut input = Input { chunk: Bytes::file("ECF", chunk), at: 0 };
    let header = input.u32()?;
    let count = (header >> 2) as usize;
    if count > MAX_EVENTS {
        return Err(input.chunk.malformed("number of events", 0, format!("at most {MAX_EVENTS}"), count));
    }
    let times = input.times(count)?;
    let (mut pixels, mut rows) = (Vec::with_capacity(count + 5), Vec::new());
    if header & 2 != 0 {
        while pixels.len() < count {
            let [a, b, c] = [input.u32()?, input.u32()?, input.u32()?];
            let words = [a >> 8, a & 0xff | b >> 16 << 8, b & 0xffff | c >> 24 << 16, c];
            pixels.extend(
                words.map(|word| ((word >> 12 & 0x7ff) as u16, (word >> 1 & 0x7ff) as u16, word & 1 != 0)),
            );
        }
    } else {
        input.runs(count, &mut rows, |input| {
            let word = input.u16()?;
            let run = word & 31;
            Ok((word >> 5, if run == 31 { input.u16()? } else { run }))
        })?;
        if header & 1 != 0 {
            while pixels.len() < count {
                let [a, b, c] = [input.u16()?, input.u16()?, input.u16()?].map(u32::from);
                let words = [a >> 4, a & 0xf | b >> 8 << 4, b & 0xff | c >> 12 << 8, c];
                pixels.extend(words.map(|word| (0, (word >> 1 & 0x7ff) as u16, word & 1 != 0)));
            }
        } else {
            while pixels.len() < count {
                let word = input.u16()?;
                let column = word >> 5;
                pixels.push((0, column, false));
                let after = (1..=5).filter(|&step| word >> (5 - step) & 1 != 0);
                pixels.extend(after.map(|step| (0, column + step, false)));
            }
            let mut polarities = Vec::new();
            input.runs(count, &mut polarities, |input| {
                let [byte] = input.array()?;
                let run = u16::from(byte & 127);
                Ok((byte >> 7 != 0, if run == 127 { input.u16()? } else { run }))
            })?;
            pixels.iter_mut().zip(polarities).for_each(|(pixel, on)| pixel.2 = on);
        }
        pixels.iter_mut().zip(rows).for_each(|(pixel, row)| pixel.0 = row);
    }
    let mut records = vec![0; count * RECORD];
    for ((record, (y, x, on)), t_us) in records.chunks_exact_mut(RECORD).zip(pixels).zip(times) {
        record[..2].copy_from_slice(&x.to_le_bytes());
        record[2..4].copy_from_slice(&y.to_le_bytes());
        record[4] = on.into();
        record[8..].copy_from_slice(&t_us.to_le_bytes());
    }
    Ok(records)
}

/// A chunk and the index of the next byte.
struct Input<'a> {
    chunk: Bytes<'a>,
    at: usize,
}

impl Input<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], IoError> {
        let bytes = self.chunk.array("events", self.at)?;
        self.at += N;
        Ok(bytes)
    }

    fn u16(&mut self) -> Result<u16, IoError> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, IoError> {
        self.array().map(u32::from_le_bytes)
    }

    /// The times of `count` events.
    fn times(&mut self, count: usize) -> Result<Vec<u64>, IoError> {
        let mut now = self.array().map(u64::from_le_bytes)?;
        let (mut step, mut bits) = (0_u64, 0);
        let mut times = Vec::with_capacity(count);
        self.runs(count, &mut times, |input| {
            let [byte] = input.array()?;
            let (high, low) = (byte >> 4, byte & 15);
            if high == 15 {
                if bits >= u64::BITS {
                    return Err(input.chunk.malformed(
                        "step of time",
                        input.at - 1,
                        "at most 64 bits",
                        bits + 4,
                    ));
                }
                step |= u64::from(low) << bits;
                bits += 4;
                return Ok((now, 0));
            }
            now = now.wrapping_add(step).wrapping_add(high.into());
            (step, bits) = (0, 0);
            Ok((now, if low == 15 { input.u16()? } else { low.into() }))
        })?;
        Ok(times)
    }

    /// Fills `values` with `count` values, from runs that `next` reads: value and length.
    fn runs<T: Copy>(
        &mut self,
        count: usize,
        values: &mut Vec<T>,
        mut next: impl FnMut(&mut Self) -> Result<(T, u16), IoError>,
    ) -> Result<(), IoError> {
        while values.len() < count {
            let at = self.at;
            let (value, run) = next(self)?;
            let rest = count - values.len();
            if usize::from(run) > rest {
                return Err(self.chunk.malformed("run", at, format!("at most {rest} events"), run));
            }
            values.resize(values.len() + usize::from(run), value);
        }
        Ok(())
    }
}
