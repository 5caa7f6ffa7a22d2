//! Zip archives of stored entries, as `torch.save` writes them: no compression, no encryption, one volume.
//!
//! Enters: the archive's bytes. Leaves: names and slices of these bytes, so nothing is allocated by a size that the
//! archive claims. Invariant: every slice lies inside the archive and has the CRC-32 that the directory states, and all of them
//! together are no longer than the archive.
//!
//! Layout (PKWARE's APPNOTE 6.3): local header and data of each entry, the central directory, its end record; 64-bit
//! forms of both where a 32-bit field is saturated. Sizes come from the directory: local headers may leave them out.

use std::collections::BTreeMap;

use super::FormatError;
use super::format::quoted;

/// How an archive starts: a local header.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";
const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
const END_64: &[u8] = b"PK\x06\x06";
const LOCATOR_64: &[u8] = b"PK\x06\x07";
/// Fixed parts of the records.
const LOCAL_SIZE: usize = 30;
const CENTRAL_SIZE: usize = 46;
const END_SIZE: usize = 22;
const LOCATOR_64_SIZE: usize = 20;

/// An archive's entries by name.
#[derive(Debug)]
pub(super) struct Archive<'a> {
    entries: BTreeMap<&'a str, Entry<'a>>,
}

#[derive(Clone, Copy, Debug)]
struct Entry<'a> {
    data: &'a [u8],
    crc: u32,
}

impl<'a> Archive<'a> {
    /// Reads the directory of an archive.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, FormatError> {
        let (count, start, size) = directory(bytes)?;
        let end = start.checked_add(size);
        let mut rest = end.and_then(|end| bytes.get(start..end)).ok_or_else(|| {
            refuse("directory", format!("within {} bytes", bytes.len()), format!("{size} bytes at {start}"))
        })?;
        let mut entries = BTreeMap::new();
        let mut left = bytes.len();
        for _ in 0..count {
            let (name, entry, length) = central(bytes, rest)?;
            // Entries that share bytes would be checked once for each: time that grows with the square of the archive.
            left = left.checked_sub(entry.data.len()).ok_or_else(|| {
                let expected = format!("entries that share no bytes: at most {left} more");
                refuse(name, expected, format!("{} bytes", entry.data.len()))
            })?;
            if entries.insert(name, entry).is_some() {
                return Err(refuse(name, "one entry of a name", "two"));
            }
            rest = &rest[length..];
        }
        Ok(Self { entries })
    }

    /// Names, in order.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a str> {
        self.entries.keys().copied()
    }

    /// The bytes of entry `name`, checked; `None` where there is no such entry.
    pub(super) fn get(&self, name: &str) -> Result<Option<&'a [u8]>, FormatError> {
        let Some(entry) = self.entries.get(name) else { return Ok(None) };
        let found = crc32(entry.data);
        if found == entry.crc {
            Ok(Some(entry.data))
        } else {
            Err(refuse(name, format!("CRC-32 {:#010x}", entry.crc), format!("{found:#010x}: damaged data")))
        }
    }
}

fn refuse(what: &str, expected: impl Into<String>, found: impl Into<String>) -> FormatError {
    FormatError::Zip { what: quoted(what), expected: expected.into(), found: found.into() }
}

fn truncated(what: &str) -> FormatError {
    refuse(what, "a whole record", "the end of its bytes")
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

/// A 64-bit field as a place in memory.
fn u64_at(bytes: &[u8], at: usize) -> Option<usize> {
    let value = u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?);
    usize::try_from(value).ok()
}

/// Number of entries, start and size of the central directory.
fn directory(bytes: &[u8]) -> Result<(usize, usize, usize), FormatError> {
    let missing = || refuse("end record", "one in the last 64 KiB", "none: not an archive, or cut short");
    // A comment of up to 64 KiB may follow the record.
    let first = bytes.len().saturating_sub(END_SIZE + usize::from(u16::MAX));
    let last = bytes.len().checked_sub(END_SIZE).ok_or_else(missing)?;
    let at = (first..=last).rev().find(|&at| bytes[at..].starts_with(END)).ok_or_else(missing)?;
    let field = |offset| u16_at(bytes, at + offset).map(usize::from);
    let wide = |offset| u32_at(bytes, at + offset).map(|v| v as usize);
    let record = (field(4), field(10), wide(12), wide(16));
    let (Some(disk), Some(count), Some(size), Some(start)) = record else { return Err(missing()) };
    let saturated = count == 0xffff || size == 0xffff_ffff || start == 0xffff_ffff;
    if !saturated {
        if disk != 0 {
            return Err(refuse("end record", "one volume", format!("volume {disk}")));
        }
        return Ok((count, start, size));
    }
    let wide_record = || {
        let locator = at.checked_sub(LOCATOR_64_SIZE).filter(|&at| bytes[at..].starts_with(LOCATOR_64))?;
        let record = bytes.get(u64_at(bytes, locator + 8)?..)?;
        if !record.starts_with(END_64) {
            return None;
        }
        Some((u64_at(record, 32)?, u64_at(record, 48)?, u64_at(record, 40)?))
    };
    wide_record().ok_or_else(|| refuse("end record", "a 64-bit end record before it", "none"))
}

/// Name and entry of the directory's record at the start of `rest`, and the record's length.
fn central<'a>(bytes: &'a [u8], rest: &'a [u8]) -> Result<(&'a str, Entry<'a>, usize), FormatError> {
    let header = rest.get(..CENTRAL_SIZE).filter(|h| h.starts_with(CENTRAL));
    let header = header.ok_or_else(|| truncated("directory"))?;
    let field = |at| u16_at(header, at).map_or(0, usize::from);
    let long = |at| u32_at(header, at).unwrap_or(0);
    let (flags, method, crc) = (field(8), field(10), long(16));
    let [mut stored, mut size, mut local] = [20, 24, 42].map(|at| long(at) as usize);
    let (name_length, extra_length, comment_length) = (field(28), field(30), field(32));
    let length = CENTRAL_SIZE + name_length + extra_length + comment_length;
    let record = rest.get(..length).ok_or_else(|| truncated("directory"))?;
    let (name, extra) = record[CENTRAL_SIZE..].split_at(name_length);
    let name = std::str::from_utf8(name).map_err(|_| refuse("directory", "names in UTF-8", "other bytes"))?;
    // Only saturated fields have a 64-bit form, in this order.
    let mut wide = extra_field(&extra[..extra_length], 1).unwrap_or(&[]);
    for value in [&mut size, &mut stored, &mut local].into_iter().filter(|v| **v == 0xffff_ffff) {
        *value = u64_at(wide, 0).ok_or_else(|| refuse(name, "its sizes in 64 bits", "none"))?;
        wide = &wide[8..];
    }
    if flags & 1 != 0 {
        return Err(refuse(name, "no encryption", "an encrypted entry"));
    }
    if method != 0 || stored != size {
        let found = format!("method {method}, {stored} bytes for {size}");
        return Err(refuse(name, "a stored entry, as torch.save writes it", found));
    }
    let data = local_data(bytes, local, size).ok_or_else(|| {
        refuse(name, format!("{size} bytes after a local header at {local}"), "no header, or fewer bytes")
    })?;
    Ok((name, Entry { data, crc }, length))
}

/// The bytes of an extra field by its number.
fn extra_field(mut extra: &[u8], number: u16) -> Option<&[u8]> {
    loop {
        let (found, length) = (u16_at(extra, 0)?, usize::from(u16_at(extra, 2)?));
        let field = extra.get(4..4 + length)?;
        if found == number {
            return Some(field);
        }
        extra = &extra[4 + length..];
    }
}

fn local_data(bytes: &[u8], at: usize, size: usize) -> Option<&[u8]> {
    let header = bytes.get(at..)?;
    if !header.starts_with(MAGIC) {
        return None;
    }
    let start = LOCAL_SIZE + usize::from(u16_at(header, 26)?) + usize::from(u16_at(header, 28)?);
    header.get(start..start.checked_add(size)?)
}

/// CRC-32 as zip has it (reflected polynomial 0xedb88320).
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut i = 0;
        while i < 256 {
            let mut value = i as u32;
            let mut bit = 0;
            while bit < 8 {
                value = if value & 1 == 1 { value >> 1 ^ 0xedb8_8320 } else { value >> 1 };
                bit += 1;
            }
            table[i] = value;
            i += 1;
        }
        table
    };
    !bytes.iter().fold(!0, |crc, &b| crc >> 8 ^ TABLE[((crc ^ u32::from(b)) & 0xff) as usize])
}

#[cfg(test)]
mod tests {
    #[test]
    fn crc32_of_the_check_string_is_the_published_one() {
        assert_eq!(super::crc32(b"123456789"), 0xcbf4_3926);
    }
}
