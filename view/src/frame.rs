//! The bytes of a frame.
//!
//! A frame is a picture of one moment and needs no frame before it, so a dropped frame does no
//! harm. All numbers are little-endian; every section starts at a multiple of 4 bytes, so that a
//! reader may lay arrays of 32 bits over it. `page/frame.js` is the decoder of the page.
//!
//! ```text
//! frame     "MSN1", then sections until the end
//! section   tag: 4 letters; n: u32; n bytes, a multiple of 4
//! ```
//!
//! A reader skips tags that it does not know. `(...)` repeats to the end of the section or as often
//! as stated; an *index of an event* counts the events of EVNT.
//!
//! - `FACT` JSON that seldom changes ([`Facts`]), padded with spaces.
//! - `INFO` JSON of small changing things ([`Info`]), padded with spaces.
//! - `TIME` f64 time of the cursor, f64 end of the input, both in us from the first event; f64
//!   events taken, f64 events of the input; f32 speed; u32 flags: 1 playing, 2 at the end, 4 live,
//!   8 seeking.
//! - `EVNT` the window, oldest first: (u16 x, u16 y, u32 2 x age in us + 1 if on). Ages stop at
//!   2^31 - 1.
//! - `NEAR` neighbours of the newest event, nearest first: (u32 index of an event).
//! - `WAVE` u32 layers; for each (u32 level, u32 rows of the level, u32 of these computed); then,
//!   layer by layer, the computed rows (u32 2 x row + 1 if it changed). Rows of level 0 are indices
//!   of events, those of other levels of cells in CELL.
//! - `CELL` u32 levels above the events; for each u32 cells along x, u32 along y, u32 count, then
//!   (u16 x, u16 y, u32 age in cells, f32 root mean square of its channels).
//! - `READ` u32 grids, newest first, u32 columns, u32 rows; then for each cell, row by row, (f32
//!   root mean square of its channels).
//! - `LAYR` of frame networks, for the newest prediction: u32 layers; for each (u32 pixels
//!   computed, u32 kept, u32 taken from the output for zeros).
//! - `DIFF` pixels in which the newest frame differs from the one before: u32 columns, u32 rows;
//!   then one bit each, row by row, the first in the lowest bit of a u32.
//! - `PICT` the newest picture: u32 columns, u32 rows, then u8 red, green, blue.
//! - `FORC` the predicted forces: u32 columns, u32 rows, f32 column and f32 row of the contact's
//!   centre (NaN: no contact), f32 force in N on a pixel above which it is in contact, f32 area of
//!   a pixel in mm^2; then f32 N on each pixel.
//! - `ELEC` the newest readings, oldest first: u32 readings; for each (u32 1 if it follows none,
//!   then f32 for each electrode).
//! - `SPAR` the newest frame of events: u32 channels, u32 rows, u32 columns; then the values that
//!   are not 0: (u32 index in channels, rows, columns; f32 value).
//! - `TIPS` of several sensors: u32 sensors, u32 selected, u32 outputs; for each (u32 0 fresh, 1
//!   behind, 2 old; f32 p50, f32 p99, f32 newest latency in us; f64 events taken, f64 dropped by
//!   the queue, f64 by the engine; for each output f32; u32 events shown, then these as in EVNT).
//!   The other sections are about the selected one.
//! - `PRED` u32 outputs, u32 events in the window, f32 unlike (NaN: not known), f32 time of the
//!   newest push and prediction in us (NaN: not measured); for each output (f32 value), then for
//!   each (f32 truth; NaN: there is none).
//! - `SERS` predictions over time: u32 outputs, u32 points; for each point (f32 time in ms from the
//!   first event, for each output f32).
//! - `LATE` f64 measured so far, f32 p50, f32 p99, f32 p99.9, f32 largest, f32 events a second;
//!   u32 buckets, then (u32 count): of the newest, those below 0.1 us x 2^((i + 1) / 4) and in no
//!   earlier bucket; the last bucket has the rest.
//! - `WORK` since the start: u32 layers, for each (f64 rows computed, f64 of these unchanged, f64
//!   of these within the tolerance, f64 kept); f64 predictions, f64 of these reused, f64 readout
//!   cells computed, f64 of these unchanged, f64 neighbourhoods checked, f64 of these unchanged.

#[cfg(doc)]
use crate::facts::{Facts, Info};

/// The first bytes of a frame.
pub const MAGIC: [u8; 4] = *b"MSN1";

/// Flag of the section TIME: the session plays.
pub const PLAYING: u32 = 1;
/// Flag of the section TIME: more events may come.
pub const LIVE: u32 = 4;

/// Writes a frame, section by section.
///
/// ```
/// use meissner_view::frame::FrameWriter;
///
/// let mut frame = FrameWriter::new();
/// frame.section(*b"NEAR", |bytes| bytes.u32(7));
/// assert_eq!(frame.finish(), b"MSN1NEAR\x04\0\0\0\x07\0\0\0");
/// ```
#[derive(Debug)]
pub struct FrameWriter(Vec<u8>);

impl Default for FrameWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameWriter {
    /// A frame without sections.
    pub fn new() -> Self {
        Self(MAGIC.to_vec())
    }

    /// Appends a section with the bytes that `write` writes, padded to a multiple of 4 bytes with
    /// spaces.
    pub fn section(&mut self, tag: [u8; 4], write: impl FnOnce(&mut Bytes<'_>)) {
        self.0.extend_from_slice(&tag);
        let length = self.0.len();
        self.0.extend_from_slice(&[0; 4]);
        write(&mut Bytes(&mut self.0));
        while !self.0.len().is_multiple_of(4) {
            self.0.push(b' ');
        }
        let bytes = (self.0.len() - length - 4) as u32;
        self.0[length..length + 4].copy_from_slice(&bytes.to_le_bytes());
    }

    /// Appends a section with `value` as JSON.
    pub fn json(&mut self, tag: [u8; 4], value: &impl serde::Serialize) {
        // Numbers, texts and lists of them always serialise.
        let text = serde_json::to_string(value).unwrap_or_default();
        self.section(tag, |bytes| bytes.bytes(text.as_bytes()));
    }

    /// The bytes.
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// The content of a section, little-endian.
#[derive(Debug)]
pub struct Bytes<'a>(&'a mut Vec<u8>);

/// A method for each type of number.
macro_rules! numbers {
    ($($name:ident),*) => {$(
        #[doc = concat!("Appends a ", stringify!($name), ".")]
        pub fn $name(&mut self, value: $name) {
            self.0.extend_from_slice(&value.to_le_bytes());
        }
    )*};
}

impl Bytes<'_> {
    numbers!(u16, u32, f32, f64);

    /// Appends a count as a u32; a larger count becomes the largest u32.
    pub fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).unwrap_or(u32::MAX));
    }

    /// Appends bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// Appends values.
    pub fn f32s(&mut self, values: &[f32]) {
        values.iter().for_each(|&value| self.f32(value));
    }
}

/// The sections of `frame` with their tags; `None` if they are not those of a frame.
pub fn sections(frame: &[u8]) -> Option<Vec<([u8; 4], &[u8])>> {
    let mut rest = frame.strip_prefix(&MAGIC)?;
    let mut sections = Vec::new();
    while !rest.is_empty() {
        let (tag, after) = rest.split_first_chunk::<4>()?;
        let (length, after) = after.split_first_chunk::<4>()?;
        let (content, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        sections.push((*tag, content));
        rest = after;
    }
    Some(sections)
}
