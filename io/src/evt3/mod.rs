//! Prophesee EVT 3.0: events from and to words of 16 bits.
//!
//! After the text header ([`crate::prophesee`]) the file is words, least significant byte first, that change
//! a state of time, row and column; only what changed is sent:
//!
//! | bits 15-12 | word | bits 11-0 |
//! |---|---|---|
//! | 0x0 | row | bit 11: which camera of a pair; 10-0: y |
//! | 0x2 | event at this column | bit 11: polarity; 10-0: x |
//! | 0x3 | base column of the vectors that follow | bit 11: their polarity; 10-0: x |
//! | 0x4 | 12 pixels: an event at base + i where bit i is set; the base moves on by 12 | bits |
//! | 0x5 | 8 pixels, likewise; the base moves on by 8 | 7-0: bits |
//! | 0x6 | time, bits 11-0 | microseconds |
//! | 0x8 | time, bits 23-12 | 4096 microseconds |
//! | 0xA | external trigger | 11-8: channel; 0: edge |
//! | 0xE, 0x7, 0xF | vendor's own, and its continuations | |
//!
//! Source: the vendor's page "EVT 3.0 Format". Invariants:
//!
//! - The 24-bit time wraps where word 0x8 falls by half its range or more, and nowhere else. Sensors under
//!   load step back a few microseconds within word 0x6: that is a step back, not 4 ms that passed.
//! - Where word 0x8 changes, the lower bits are 0 until word 0x6 says them: keeping the old ones would date
//!   an event up to 4 ms ahead.
//!
//! Our own, because it is ten kinds of word: the `evt3` crate passes over words that cannot be, and the others
//! bring a hundred crates.

mod read;
mod write;

pub(crate) use read::decode;
pub(crate) use write::{check, encode};

/// Coordinates have 11 bits.
pub(crate) const SIDE: u16 = 2048;
/// Bits of the time in each of its two words.
const TIME_BITS: u32 = 12;
/// The upper word counts to here, and wraps.
const HIGH_RANGE: u16 = 1 << TIME_BITS;

/// Bits 15-12 of the words.
mod word {
    pub(super) const Y: u16 = 0x0;
    pub(super) const X: u16 = 0x2;
    pub(super) const BASE: u16 = 0x3;
    pub(super) const VECTOR_12: u16 = 0x4;
    pub(super) const VECTOR_8: u16 = 0x5;
    pub(super) const TIME_LOW: u16 = 0x6;
    pub(super) const CONTINUED_4: u16 = 0x7;
    pub(super) const TIME_HIGH: u16 = 0x8;
    pub(super) const TRIGGER: u16 = 0xa;
    pub(super) const VENDOR: u16 = 0xe;
    pub(super) const CONTINUED_12: u16 = 0xf;
}
