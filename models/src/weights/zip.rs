//! Zip archives as `torch.save` writes them: stored entries, without compression or encryption.
//!
//! Enters: an archive, whose records `rawzip` reads. Leaves: entries by name, as slices with the
//! stated CRC-32. Invariant: nothing is allocated by a claimed size, and slices are together no
//! longer than the archive: linear time.

use std::collections::BTreeMap;

use rawzip::{CompressionMethod, ZipFileHeaderRecord, ZipLocator, ZipSliceArchive};

use super::error::FormatError;

/// How an archive starts: the signature of a local header.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";
/// The end record with the longest comment.
const SEARCHED: u64 = 22 + u16::MAX as u64;

pub(super) fn entries(bytes: &[u8]) -> Result<BTreeMap<String, &[u8]>, FormatError> {
    let located = ZipLocator::new().max_search_space(SEARCHED).locate_in_slice(bytes);
    let archive = located
        .map_err(|(_, error)| FormatError::zip("end record", "one in the last 64 KiB", error.to_string()))?;
    let mut entries = BTreeMap::new();
    let (mut count, mut left) = (0, bytes.len());
    for record in archive.entries() {
        let record =
            record.map_err(|error| FormatError::zip("directory", "whole records", error.to_string()))?;
        let path = record.file_path();
        let name = str::from_utf8(path.as_bytes())
            .map_err(|_| FormatError::zip("directory", "names in UTF-8", "other bytes"))?;
        let data = stored(&archive, &record, name)?;
        count += 1;
        // Entries that share bytes would take time that grows with the square of the archive.
        left = left.checked_sub(data.len()).ok_or_else(|| {
            let expected = format!("entries that share no bytes: at most {left} more");
            FormatError::zip(name, expected, format!("{} bytes", data.len()))
        })?;
        if entries.insert(name.to_owned(), (data, record.crc32())).is_some() {
            return Err(FormatError::zip(name, "one entry of a name", "two"));
        }
    }
    if count != archive.entries_hint() {
        let expected = format!("{} entries, as the end record says", archive.entries_hint());
        return Err(FormatError::zip("directory", expected, count.to_string()));
    }
    let checked = entries.into_iter().map(|(name, (data, crc))| {
        let found = rawzip::crc32(data);
        if found != crc {
            return Err(FormatError::zip(
                &name,
                format!("CRC-32 {crc:#010x}"),
                format!("{found:#010x}: damaged data"),
            ));
        }
        Ok((name, data))
    });
    checked.collect()
}

/// The bytes of an entry that is stored as it is.
fn stored<'a>(
    archive: &ZipSliceArchive<&'a [u8]>,
    record: &ZipFileHeaderRecord<'_>,
    name: &str,
) -> Result<&'a [u8], FormatError> {
    if record.flags().is_encrypted() {
        return Err(FormatError::zip(name, "no encryption", "an encrypted entry"));
    }
    let (method, stored) = (record.compression_method(), record.compressed_size_hint());
    let size = record.uncompressed_size_hint();
    if method != CompressionMethod::STORE || stored != size {
        let found = format!("method {}, {stored} bytes for {size}", method.as_u16());
        return Err(FormatError::zip(name, "a stored entry, as torch.save writes it", found));
    }
    let entry = archive.get_entry(record.wayfinder()).map_err(|error| {
        let expected = format!("{size} bytes after a local header at {}", record.local_header_offset());
        FormatError::zip(name, expected, error.to_string())
    })?;
    let (start, end) = entry.compressed_data_range();
    Ok(&archive.get_ref()[start as usize..end as usize])
}
