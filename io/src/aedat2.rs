//! AEDAT 2.0, the format of jAER: the bytes of a file to events.
//!
//! After the text header each record has 8 bytes: an address and a time in
//! microseconds, both 32 bits, most significant byte first. The header's line `# AEChip: CLASS`
//! names the chip, which gives the layout of the address:
//!
//! | chip | not a change of brightness | row | column | rise |
//! |---|---|---|---|---|
//! | DVS128 | bit 15: external event | bits 14-8 | bits 7-1 | bit 0: 0 |
//! | DAVIS | bit 31: frame or IMU; bit 10: external event | bits 30-22 | bits 21-12 | bit 11: 1 |
//!
//! Columns count from the right and rows from the bottom; the decoded events count from the left
//! and the top, as in the other formats. Files from before 2014 and files of v2e name no chip, but
//! the caller can name it ([`ReadOptions::chip`], or [`ReadOptions::sensor`] with a size that only
//! one chip has). Otherwise, if every address has at most 16 bits, the chip is assumed to be a
//! DVS128, and the recording states this assumption ([`Recording::assumed`]). Events outside the
//! chip, which some sensors send, are left out and counted unless the reader is strict. Source:
//! iniVation's page on AEDAT 2.0; for the mirrored column, and for the DVS128's polarity (the page
//! has it the other way round), the extractors of jAER and the parser of `dv-processing`, which
//! agree.
//!
//! Invariant: the 32-bit time wraps if it falls by 2^31 or more; a smaller fall is a step back.

mod chip;

use meissner_engine::Event;

use crate::bytes::{Bytes, array};
use crate::error::{IoError, shown};
use crate::format::Format;
use crate::left_out::{LeftOutKind, PassedOver};
use crate::limits::JAER_HEADER_BYTES;
use crate::options::ReadOptions;
use crate::prophesee::WrappingClock;
use crate::recording::{Recording, StreamKind, StreamSummary};
use crate::seek::Records;
pub use chip::Chip;
use chip::NAMES;
pub(crate) use chip::sensor_of;

/// Bytes of a record.
const STRIDE: usize = 8;
/// Times count from 0 to this value - 1, and wrap.
const TIME_RANGE: i64 = 1 << 32;

/// The assumption about a file that names no chip.
const ASSUMED: &str = "the header names no AEChip: a DVS128 of 128 x 128 pixels is assumed, because no address has more than its 16 bits";

impl Records for Header {
    const PERIOD: Option<i64> = Some(TIME_RANGE);

    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let asked = options.chip;
        let of_sensor = || options.sensor.and_then(Chip::of_sensor);
        file.magic(MAGIC)?;
        let mut header = Self { end: 0, chip: None, is_empty: true, strict: options.strict };
        let mut is_ended = false;
        while let Some(line) = line(&file.data[header.end..]).filter(|_| !is_ended) {
            let start = header.end;
            header.end += line.len();
            if header.end as u64 > JAER_HEADER_BYTES {
                return Err(file.too_large("header", 0, JAER_HEADER_BYTES, header.end as u64, true));
            }
            let text = String::from_utf8_lossy(&line[1..]);
            let text = text.trim();
            is_ended = text.eq_ignore_ascii_case("End of ASCII Header");
            if let Some(class) = text.strip_prefix("AEChip:") {
                let class = class.trim();
                let name = class.rsplit('.').next().unwrap_or_default();
                header.chip = asked.or_else(|| Chip::of_class(name)).or_else(of_sensor);
                if header.chip.is_none() {
                    return Err(file.malformed("AEChip", start, NAMES, shown(class.as_bytes())));
                }
            }
        }
        header.chip = header.chip.or(asked).or_else(of_sensor);
        let tail = &file.data[header.end..];
        header.is_empty = tail.len() < STRIDE;
        if header.end == 0 || (!is_ended && is_cut(tail)) {
            let what = "the header's last line, which has no line feed,";
            return Err(file.truncated(what, header.end, tail.len() as u64 + 1, false));
        }
        Ok(header)
    }

    fn start(&self) -> usize {
        self.end
    }

    fn stride(&self) -> usize {
        STRIDE
    }

    fn clock(&self, record: &[u8]) -> Option<i64> {
        Some(u32::from_be_bytes(array(&record[4..])).into())
    }

    fn decode(&self, records: Bytes<'_>, clock: WrappingClock, salvage: bool) -> Result<Recording, IoError> {
        let (all, salvaged) = records.records("the last event", 0, salvage)?;
        let mut decoder = Decoder::new(records, self, clock);
        for (record, at) in all.iter().zip((0..).step_by(STRIDE)) {
            decoder.push(*record, at)?;
        }
        // Without a record, there is no evidence that an unnamed chip is a DVS128.
        let sensor = match self.chip {
            None if self.is_empty => None,
            chip => Some(chip.unwrap_or(Chip::DVS128).sensor),
        };
        let Decoder { events, external, frames, imu, passed, .. } = decoder;
        let (other_streams, left_out) = (StreamSummary::present([external, frames, imu]), passed.end());
        let assumed = if self.chip.is_none() && sensor.is_some() { vec![ASSUMED] } else { Vec::new() };
        let plain = Recording::of_events(Format::Aedat2, sensor, events);
        Ok(Recording { other_streams, left_out, assumed, salvaged, ..plain })
    }
}

/// The state of a reader.
struct Decoder<'a> {
    records: Bytes<'a>,
    chip: Option<Chip>,
    clock: WrappingClock,
    events: Vec<Event>,
    external: StreamSummary,
    frames: StreamSummary,
    imu: StreamSummary,
    passed: PassedOver,
}

/// The meaning of an address.
enum Word {
    /// Column from the right, row from the bottom, and whether brightness rose.
    Change(u16, u16, bool),
    External,
    Frame,
    Imu,
}

impl<'a> Decoder<'a> {
    fn new(records: Bytes<'a>, header: &Header, clock: WrappingClock) -> Self {
        Self {
            records,
            chip: header.chip,
            passed: PassedOver::new(header.strict),
            clock,
            events: Vec::with_capacity(records.len() / STRIDE),
            external: StreamSummary::new("external events", StreamKind::Triggers),
            frames: StreamSummary::new("values of frames", StreamKind::Other),
            imu: StreamSummary::new("values of the IMU", StreamKind::Other),
        }
    }

    /// Takes the record at byte `at` of the records.
    #[inline]
    fn push(&mut self, record: [u8; STRIDE], at: usize) -> Result<(), IoError> {
        let (address, time) = (u32::from_be_bytes(array(&record)), u32::from_be_bytes(array(&record[4..])));
        let t_us = self.clock.advance(time.into());
        let sensor = self.chip.map_or(Chip::DVS128.sensor, |chip| chip.sensor);
        let word = match self.chip {
            Some(Chip { is_davis: true, .. }) => davis(address),
            _ => match self.dvs128(address, at) {
                Ok(word) => word,
                // One odd address of a DVS128 is noise or, if no chip is named, the address of a
                // different chip.
                Err(error) if self.chip.is_some() => {
                    return self.passed.pass(LeftOutKind::OtherWords, 1, error);
                }
                Err(error) => return Err(error),
            },
        };
        match word {
            Word::Change(x, y, on) if sensor.contains(x, y) => {
                self.events.push(Event::new(t_us, sensor.width - 1 - x, sensor.height - 1 - y, on));
            }
            Word::Change(x, y, _) => {
                let error = self.records.outside(sensor, x.into(), y, at);
                self.passed.pass(LeftOutKind::OutsideSensor, 1, error)?;
            }
            Word::External => self.external.add(1),
            Word::Frame => self.frames.add(1),
            Word::Imu => self.imu.add(1),
        }
        Ok(())
    }

    /// The word of a DVS128 at byte `at` of the records.
    #[inline]
    fn dvs128(&self, address: u32, at: usize) -> Result<Word, IoError> {
        match address >> 15 {
            0 => {
                Ok(Word::Change((address >> 1 & 0x7f) as u16, (address >> 8 & 0x7f) as u16, address & 1 == 0))
            }
            1 => Ok(Word::External),
            _ => {
                let expected = match self.chip {
                    Some(_) => "16 bits for a DVS128",
                    None => "the 16 bits of a DVS128, or a header or an option that names the chip",
                };
                Err(self.records.malformed("address", at, expected, format!("{address:#010x}")))
            }
        }
    }
}

/// The word of a DAVIS.
#[inline]
fn davis(address: u32) -> Word {
    match (address >> 31, address >> 10 & 3) {
        (0, 0 | 2) => {
            let (x, y) = ((address >> 12 & 0x3ff) as u16, (address >> 22 & 0x1ff) as u16);
            Word::Change(x, y, address >> 11 & 1 == 1)
        }
        (0, _) => Word::External,
        (_, 3) => Word::Imu,
        _ => Word::Frame,
    }
}

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT2.0";

/// Largest number of remaining bytes that are examined as a line of the header.
const LINE_BYTES: usize = 1 << 16;

/// The content and the end of a header.
#[derive(Debug)]
pub(crate) struct Header {
    /// First byte after the header.
    end: usize,
    /// The chip; `None`: neither the header nor the caller names one.
    chip: Option<Chip>,
    /// Whether no record follows.
    is_empty: bool,
    strict: bool,
}

/// The first line of `bytes` with its line feed, if it is one of a header.
fn line(bytes: &[u8]) -> Option<&[u8]> {
    if !bytes.starts_with(b"#") {
        return None;
    }
    let end = bytes.iter().position(|&b| b < b' ' && b != b'\t')?;
    match &bytes[end..] {
        [b'\n', ..] => Some(&bytes[..=end]),
        [b'\r', b'\n', ..] => Some(&bytes[..end + 2]),
        _ => None,
    }
}

/// Whether `tail`, the bytes of a file after the last complete line, is the beginning of a line.
fn is_cut(tail: &[u8]) -> bool {
    tail.starts_with(b"#") && tail.len() < LINE_BYTES && !tail.iter().any(u8::is_ascii_control)
}
