//! `NumPy` structured arrays of one dimension: events from and to `.npy`.
//!
//! The bytes `\x93NUMPY`, the version (two bytes), the length of the header (16 bits in version 1, 32 in 2
//! and 3), the header, and the records. The header is the text of a Python dictionary with the keys `descr`,
//! a list of the fields' names and types, `fortran_order` and `shape`. Source: the documentation of
//! `numpy.lib.format`.
//!
//! Read are the fields t (microseconds), x, y and p or `on`, found by name, in any order, of integers of any
//! width and byte order, p also as booleans, 0/1 or -1/+1; other fields and padding are passed over. Written
//! is `[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')]`. The header has no place for the geometry.
//!
//! Our own in place of `npyz`, which reads such arrays right but parses the dictionary with a grammar library
//! of twenty crates and a native stack guard; the dictionary of an event array needs a page, and gives errors
//! with places.

mod header;
mod read;
mod scan;
mod write;

pub(crate) use read::decode;
pub(crate) use write::encode;

const MAGIC: &[u8] = b"\x93NUMPY";

/// Whether `bytes` start as such a file does.
pub(crate) fn has_magic(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}
