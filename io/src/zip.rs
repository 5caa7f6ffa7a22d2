//! Zip archives of small files: the entries, whole, one at a time.
//!
//! Enters: the bytes of an archive, whose records the `rawzip` crate reads. Leaves: the name of each entry and its content,
//! stored or deflated, with the size and the CRC-32 that the directory states. Invariant: one content is held at a time. All
//! contents together have at most [`PACKET_BYTES`] and [`EXPANSION`] bytes for each byte of the archive.

use std::io::Read;

use flate2::bufread::DeflateDecoder;
use rawzip::{CompressionMethod, ZipFileHeaderRecord, ZipLocator, ZipSliceArchive};

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::limits::{EXPANSION, PACKET_BYTES};

/// The end record with the longest comment.
const SEARCHED: u64 = 22 + u16::MAX as u64;

/// Calls `entry` with the name and the content of each file of the archive `bytes`, in the order of its directory. Folders are
/// passed over.
pub(crate) fn for_each(
    bytes: &[u8],
    mut entry: impl FnMut(&str, &[u8]) -> Result<(), IoError>,
) -> Result<(), IoError> {
    let file = Bytes::file("zip", bytes);
    let bad = |at: u64, expected: &str, error: rawzip::Error| {
        file.malformed("archive", at as usize, expected, error)
    };
    let located = ZipLocator::new().max_search_space(SEARCHED).locate_in_slice(bytes);
    let archive = located.map_err(|(_, error)| {
        bad(file.len() as u64, "an end record in the last 64 KiB before this", error)
    })?;
    let mut left = (file.len() as u64).saturating_mul(EXPANSION).saturating_add(PACKET_BYTES);
    for record in archive.entries() {
        let record =
            record.map_err(|error| bad(archive.directory_offset(), "a directory of whole records", error))?;
        let at = record.local_header_offset();
        let path = record.file_path();
        let name = str::from_utf8(path.as_bytes())
            .map_err(|_| file.malformed("name", at as usize, "UTF-8", path.as_bytes().escape_ascii()))?;
        if record.is_dir() {
            continue;
        }
        // Entries may share bytes: they are counted by what they expand to.
        let size = record.uncompressed_size_hint();
        let limit = left.min(PACKET_BYTES);
        if size > limit {
            return Err(file.too_large("content", at as usize, limit, size, false));
        }
        left -= size;
        let content = content(&archive, &record, size)
            .map_err(|(expected, actual)| file.malformed("entry", at as usize, expected, actual))?;
        entry(name, &content)?;
    }
    Ok(())
}

/// The content of an entry, of `size` bytes; or what was expected and what was found.
fn content(
    archive: &ZipSliceArchive<&[u8]>,
    record: &ZipFileHeaderRecord<'_>,
    size: u64,
) -> Result<Vec<u8>, (String, String)> {
    if record.flags().is_encrypted() {
        return Err(("no encryption".to_owned(), "an encrypted entry".to_owned()));
    }
    let local = archive.get_entry(record.wayfinder());
    let local = local.map_err(|error| ("a local header".to_owned(), error.to_string()))?;
    let packed = local.data();
    let reader: Box<dyn Read + '_> = match record.compression_method() {
        CompressionMethod::STORE => Box::new(packed),
        CompressionMethod::DEFLATE => Box::new(DeflateDecoder::new(packed)),
        other => return Err(("a stored or deflated entry".to_owned(), format!("method {}", other.as_u16()))),
    };
    let mut content = Vec::new();
    // A content that is longer than stated is read no further than that.
    let read = local.verifying_reader(reader.take(size + 1)).read_to_end(&mut content);
    let expected = || format!("{size} bytes with CRC-32 {:#010x}", record.crc32());
    read.map_err(|error| (expected(), error.to_string()))?;
    Ok(content)
}
