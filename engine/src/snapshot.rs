//! The format of snapshots: little-endian bytes, written and read by hand.
//!
//! ```text
//! "MEISSNER"   8 bytes
//! version      u32
//! kind         u32    1 an engine over events, 2 a frame engine
//! length       u64    of the whole, checksum included
//! content             engine/stored.rs, frames/step/stored.rs
//! note                bytes of whoever asked for the snapshot
//! its length   u64
//! checksum     u64    FNV-1a of all before it
//! ```
//!
//! The checksum finds what happens to files by accident, and every change of a single byte. A content that was made up,
//! with a checksum that fits, is checked as if there were none: counts against what is left of the bytes and against what
//! the engine can hold, before anything is allocated; sizes against those of the network; nothing that is read is an index.

mod reader;
mod writer;

pub use reader::snapshot_note;
pub(crate) use reader::{Reader, differs};
pub(crate) use writer::Writer;

const MAGIC: [u8; 8] = *b"MEISSNER";
/// Goes up with every change of the format, or of the order in which an engine computes.
const VERSION: u32 = 1;
/// Bytes before the content.
const HEADER: usize = 24;
/// Bytes behind it.
const CHECKSUM: usize = 8;
/// Counts are below this, so that they can go on, and be summed over layers, for as long as any engine runs: two thousand
/// years at a million a second.
const COUNT_LIMIT: u64 = 1 << 56;

/// What a snapshot is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Events = 1,
    Frames = 2,
}

impl Kind {
    fn name(code: u32) -> String {
        match code {
            1 => "an engine over events".to_owned(),
            2 => "a frame engine".to_owned(),
            other => format!("kind {other}"),
        }
    }
}
