//! AEDAT4, iniVation's container: a file's bytes in, the events of its first event stream out, the other
//! streams counted.
//!
//! ```text
//! #!AER-DAT4.0\r\n
//! header    FlatBuffer IOHE with its size before it: compression, position of the packet table, XML of the streams
//! packets   { stream: i32, size: i32 } and `size` bytes: one compressed FlatBuffer with its size before it
//! table     compressed FlatBuffer FTAB: where each packet is; missing where the recording was not closed (position -1)
//! ```
//!
//! A packet's buffer is named by four letters: EVTS holds a vector of events of 16 bytes (time i64 in
//! microseconds, x and y i16, polarity one byte), FRME one frame, IMUS a vector of samples, TRIG a vector of
//! triggers. Compression is none, an LZ4 frame or a Zstandard frame, per packet. Source: iniVation's pages on
//! the AEDAT file formats and the schemas of its `dv-processing`.
//!
//! Invariants: packets fill the space between header and table exactly, every offset in a buffer is checked
//! against its packet, and a packet's content is as long as its size prefix says (that is also what finds an
//! LZ4 frame that was cut at the end of a block, which its decoder passes). Frames are counted and not
//! decompressed.
//!
//! Our own container over `lz4_flex`, `ruzstd` and `roxmltree` (five small crates with what they need): of the
//! crates that read AEDAT4 whole, `eventcv-core` brings 150 others and loads truncated files in part without an
//! error, and `aedat` is dormant and brings 50.

mod events;
mod flat;
mod header;
mod inflate;
mod read;
mod streams;

pub(crate) use read::decode;

const MAGIC: &[u8] = b"#!AER-DAT4.0\r\n";

/// Whether `bytes` start as such a file does.
pub(crate) fn has_magic(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}
