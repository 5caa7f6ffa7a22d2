//! The part of `FlatBuffers` that AEDAT4 uses, with every offset checked.
//!
//! A buffer with its size before it: size u32, offset of the root table u32 (counted from itself), four
//! letters that name the type. A table starts with the i32 distance back to its vtable; the vtable holds its
//! own length, the table's, and for each field the u16 offset in the table, 0 where the field has its
//! default. Vectors and strings are a u32 offset (counted from itself) to a u32 count and the elements.
//! Source: the `FlatBuffers` internals page.

use crate::bytes::{Bytes, array};
use crate::error::IoError;

/// Bytes of the size before a buffer.
const PREFIX: usize = 4;

/// A table of a buffer.
#[derive(Clone, Copy)]
pub(super) struct Table<'a> {
    bytes: Bytes<'a>,
    what: &'static str,
    at: usize,
    vtable: usize,
    /// Length of the vtable in bytes.
    length: usize,
}

impl<'a> Table<'a> {
    /// The root table of the buffer `bytes`, which must have the given name and be as long as it says.
    pub(super) fn root(bytes: Bytes<'a>, what: &'static str, name: [u8; 4]) -> Result<Self, IoError> {
        let size = bytes.u32(what, 0)? as usize;
        if size != bytes.len() - PREFIX {
            let actual = (bytes.len() - PREFIX).to_string();
            return Err(bytes.malformed(what, 0, format!("a content of {size} bytes"), actual));
        }
        check_name(bytes, what, name)?;
        let at = PREFIX.saturating_add(bytes.u32(what, PREFIX)? as usize);
        let back = i64::from(bytes.i32(what, at)?);
        let vtable = usize::try_from(at as i64 - back).map_err(|_| {
            bytes.malformed(what, at, "a table description inside of the content", "one before it")
        })?;
        let length = usize::from(bytes.u16(what, vtable)?);
        bytes.get(what, vtable, length)?;
        Ok(Self { bytes, what, at, vtable, length })
    }

    /// Where field `index` is, or `None` where it has its default.
    fn field(&self, index: usize) -> Result<Option<usize>, IoError> {
        let entry = 4 + 2 * index;
        if entry + 2 > self.length {
            return Ok(None);
        }
        let offset = usize::from(self.bytes.u16(self.what, self.vtable + entry)?);
        Ok((offset != 0).then_some(self.at + offset))
    }

    /// A field of 32 bits.
    pub(super) fn i32(&self, index: usize, default: i32) -> Result<i32, IoError> {
        self.field(index)?.map_or(Ok(default), |at| self.bytes.i32(self.what, at))
    }

    /// A field of 64 bits.
    pub(super) fn i64(&self, index: usize, default: i64) -> Result<i64, IoError> {
        self.field(index)?.map_or(Ok(default), |at| self.bytes.i64(self.what, at))
    }

    /// A vector of elements of `stride` bytes: where it starts, and its bytes. Empty where the field is
    /// missing.
    pub(super) fn vector(&self, index: usize, stride: usize) -> Result<(usize, &'a [u8]), IoError> {
        let Some(at) = self.field(index)? else { return Ok((0, &[])) };
        let start = at.saturating_add(self.bytes.u32(self.what, at)? as usize);
        let count = self.bytes.u32(self.what, start)? as usize;
        let elements = self.bytes.get(self.what, start + 4, count.saturating_mul(stride))?;
        Ok((start + 4, elements))
    }
}

/// Refuses a buffer whose four letters are others.
pub(super) fn check_name(bytes: Bytes<'_>, what: &'static str, name: [u8; 4]) -> Result<(), IoError> {
    let at = PREFIX + 4;
    let actual: [u8; 4] = array(bytes.get(what, at, 4)?);
    if actual == name {
        return Ok(());
    }
    let shown = |name: &[u8]| format!("`{}`", name.escape_ascii());
    Err(bytes.malformed(what, at, shown(&name), shown(&actual)))
}
