//! ECF, the compression of Prophesee's records.
//!
//! ```text
//! 4 * number of events + layout     u32; layout 2: pixels and polarities together; 1: columns and polarities together; 0: apart
//! time of the first event           u64
//! times                             bytes of a step (bits 7-4) and how many events have the time (bits 3-0; 15: the next u16).
//!                                   Before them, bytes with bits 7-4 set have longer steps in bits 3-0, lowest four bits first
//! layout 2: four events of 24 bits in three u32: row (11), column (11), polarity
//! others:   rows                    u16: row (bits 15-5) and its events (bits 4-0; 31: the next u16)
//! layout 1: four events of 12 bits in three u16: column (11), polarity
//! layout 0: columns                 u16: column (bits 15-5), and the five columns after it that follow (bits 4-0, nearest first)
//!           polarities              byte: polarity (bit 7) and its events (bits 6-0; 127: the next u16)
//! ```
//!
//! Three words hold four events from the highest bit on; of an event in two words, the low bits are in the first one. All words begin
//! with the least significant byte. A chunk unpacks to records of 16 bytes: x and y (u16), p (i16), two bytes of padding,
//! t (i64). Source: the vendor's coder, <https://github.com/prophesee-ai/hdf5_ecf>. Invariant: a chunk has at most 65535 events, and no
//! more than it says.

use crate::bytes::Bytes;
use crate::error::IoError;

/// HDF5's number of the filter.
pub(super) const FILTER: u16 = 0x8ecf;

/// Most events of a chunk.
const MAX_EVENTS: usize = 65535;
/// Bytes of a record.
const RECORD: usize = 16;

/// The records of `chunk`.
pub(super) fn decode(chunk: &[u8]) -> Result<Vec<u8>, IoError> {
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

/// A chunk and the place of the next byte.
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

    /// Fills `values` with `count` values, from runs that `next` reads: a value and how often it stands.
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{RECORD, decode};

    /// The values of `values` in runs.
    fn runs<T: PartialEq>(values: &[T]) -> impl Iterator<Item = (&T, u16)> {
        values.chunk_by(PartialEq::eq).map(|run| (&run[0], run.len() as u16))
    }

    /// The chunk of `events` (t, x, y, on) in order of time, with this layout, as the vendor's coder writes it.
    fn encoded(events: &[(u64, u16, u16, bool)], layout: u32) -> Vec<u8> {
        let mut chunk = ((events.len() as u32) << 2 | layout).to_le_bytes().to_vec();
        let times: Vec<_> = events.iter().map(|event| event.0).collect();
        let mut now = times.first().copied().unwrap_or(0);
        chunk.extend(now.to_le_bytes());
        for (&t_us, run) in runs(&times) {
            let mut step = t_us - now;
            now = t_us;
            if step >= 15 {
                while step > 0 {
                    chunk.push(0xf0 | (step & 15) as u8);
                    step >>= 4;
                }
            }
            chunk.push((step as u8) << 4 | run.min(15) as u8);
            if run >= 15 {
                chunk.extend(run.to_le_bytes());
            }
        }
        if layout == 2 {
            let mut words: Vec<_> = events
                .iter()
                .map(|&(_, x, y, on)| u32::from(y) << 12 | u32::from(x) << 1 | u32::from(on))
                .collect();
            words.resize(words.len().next_multiple_of(4), 0);
            for four in words.as_chunks().0 {
                let &[a, b, c, d] = four;
                let three = [a << 8 | b & 0xff, b >> 8 << 16 | c & 0xffff, c >> 16 << 24 | d];
                chunk.extend(three.iter().flat_map(|word| word.to_le_bytes()));
            }
            return chunk;
        }
        let rows: Vec<_> = events.iter().map(|event| event.2).collect();
        for (row, run) in runs(&rows) {
            chunk.extend((row << 5 | run.min(31)).to_le_bytes());
            if run >= 31 {
                chunk.extend(run.to_le_bytes());
            }
        }
        if layout == 1 {
            let mut words: Vec<_> = events.iter().map(|&(_, x, _, on)| x << 1 | u16::from(on)).collect();
            words.resize(words.len().next_multiple_of(4), 0);
            for four in words.as_chunks().0 {
                let &[a, b, c, d] = four;
                let three = [a << 4 | b & 0xf, b >> 4 << 8 | c & 0xff, c >> 8 << 12 | d];
                chunk.extend(three.iter().flat_map(|word| word.to_le_bytes()));
            }
            return chunk;
        }
        let mut columns = events.iter().map(|event| event.1).peekable();
        while let Some(column) = columns.next() {
            let mut word = column << 5;
            for step in 1..=5 {
                if columns.next_if_eq(&(column + step)).is_some() {
                    word |= 1 << (5 - step);
                }
            }
            chunk.extend(word.to_le_bytes());
        }
        let polarities: Vec<_> = events.iter().map(|event| event.3).collect();
        for (&on, run) in runs(&polarities) {
            chunk.push(u8::from(on) << 7 | run.min(127) as u8);
            if run >= 127 {
                chunk.extend(run.to_le_bytes());
            }
        }
        chunk
    }

    fn records(events: &[(u64, u16, u16, bool)]) -> Vec<u8> {
        let record = |&(t_us, x, y, on): &(u64, u16, u16, bool)| {
            let mut record = [0; RECORD];
            record[..2].copy_from_slice(&x.to_le_bytes());
            record[2..4].copy_from_slice(&y.to_le_bytes());
            record[4] = on.into();
            record[8..].copy_from_slice(&t_us.to_le_bytes());
            record
        };
        events.iter().flat_map(record).collect()
    }

    proptest! {
        /// Steps of time around the lengths that are written otherwise, runs of all lengths, and neighbours in a row.
        #[test]
        fn every_layout_comes_back(
            bursts in prop::collection::vec(
                (
                    prop_oneof![0..20_u64, Just(1 << 40), 0..100_000_u64],
                    0..2048_u16, 0..2048_u16, any::<bool>(),
                    prop_oneof![1..7_usize, 1..200_usize],
                    0..4_u16,
                ),
                0..20,
            ),
            begin in 0..1_u64 << 62,
        ) {
            let mut now = begin;
            let mut events = Vec::new();
            for (step, x, y, on, length, gap) in bursts {
                now += step;
                let column = |i: usize| (x + gap * i as u16) % 2048;
                events.extend((0..length).map(|i| (now, column(i), y, on)));
            }
            for layout in 0..3 {
                prop_assert_eq!(decode(&encoded(&events, layout)).unwrap(), records(&events), "layout {}", layout);
            }
        }

        #[test]
        fn any_bytes_give_records_or_an_error(chunk in prop::collection::vec(any::<u8>(), 0..80), count in 0..40_u32) {
            let chunk = [&((count << 2) | (count % 3)).to_le_bytes()[..], &chunk].concat();
            if let Ok(records) = decode(&chunk) {
                prop_assert_eq!(records.len(), count as usize * RECORD);
            }
        }
    }
}
