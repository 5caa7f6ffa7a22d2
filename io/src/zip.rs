//! Zip archives: their complete files, one at a time, and the only recording of an archive.
//!
//! Input: the bytes of an archive, whose records the `rawzip` crate reads. Output: the name of each
//! file and its content, stored or deflated, with the size and the CRC-32 that the directory
//! states. Invariant: one content is held at a time. All contents together have at most [`most`]
//! bytes, and if there are several, each has at most [`PACKET_BYTES`].

use std::io::Read;

use flate2::bufread::DeflateDecoder;
use rawzip::{CompressionMethod, ZipFileHeaderRecord, ZipLocator, ZipSliceArchive, ZipSliceEntry};

use crate::bytes::Bytes;
use crate::detect::START;
use crate::error::IoError;
use crate::format::{Format, Kind, POLARITY, TIME, X, Y, beginning};
use crate::limits::{PACKET_BYTES, most};
use crate::npy::{self, Part};

/// Length of the end record with the longest comment.
const SEARCHED: u64 = 22 + u16::MAX as u64;

/// Calls `entry` with name and content of each file of the archive `bytes`, in its order.
pub(crate) fn for_each(
    bytes: &[u8],
    mut entry: impl FnMut(&str, &[u8]) -> Result<(), IoError>,
) -> Result<(), IoError> {
    let archive = Archive::open(bytes)?;
    // Entries may share bytes, so their expanded bytes are counted.
    let mut left = most(bytes.len() as u64);
    archive.for_each(|name, record| {
        let content = archive.content(record, left.min(PACKET_BYTES))?;
        left -= content.len() as u64;
        entry(name, &content)
    })
}

/// The content of the recording among the files of the archive `bytes`: the only recording, or the
/// one called `events` if there are several, or, in an `.npz`, the four arrays with the names of an
/// event's values, assembled. Other arrays are not recordings. If there is only one file, it is
/// taken as the recording: its reader reports its errors.
pub(crate) fn recording(bytes: &[u8]) -> Result<Vec<u8>, IoError> {
    let archive = Archive::open(bytes)?;
    let mut left = most(bytes.len() as u64);
    let (mut files, mut others) = (0_u64, Vec::new());
    // Number and name of each recording, and the numbers of the arrays for each value of an event.
    let (mut recordings, mut columns): (Vec<(u64, String)>, [Vec<u64>; 4]) = Default::default();
    archive.for_each(|name, record| {
        files += 1;
        let start = archive.start(record, left.min(START));
        left -= start.len() as u64;
        let part = match Kind::of(&start) {
            Some(Kind::Events(Format::Npy)) => npy::part(&start),
            Some(Kind::Events(_)) => Part::Events,
            _ => return Ok(()),
        };
        let stem = stem(name).to_ascii_lowercase();
        let value = [TIME, X, Y, POLARITY].iter().position(|names| names.contains(&stem.as_str()));
        match (part, value) {
            (Part::Events, _) => recordings.push((files, name.to_owned())),
            (Part::Column, Some(value)) => columns[value].push(files),
            _ => others.push(name.to_owned()),
        }
        Ok(())
    })?;
    let called = || recordings.iter().filter(|(_, name)| stem(name).eq_ignore_ascii_case("events"));
    let chosen = match (&recordings[..], columns.each_ref().map(Vec::as_slice)) {
        ([(only, _)], _) => vec![*only],
        ([], [&[t], &[x], &[y], &[p]]) => vec![t, x, y, p],
        ([_, _, ..], _) if called().count() == 1 => called().map(|(number, _)| *number).collect(),
        _ if files == 1 => vec![1],
        _ => {
            let found = recordings.len();
            let names = recordings.into_iter().map(|(_, name)| name).chain(others);
            let names: Vec<_> = names.map(|name| beginning(&name, 40)).collect();
            let shown = names[..names.len().min(4)].join(", ");
            let dots = if names.len() > 4 { ", .." } else { "" };
            let actual = format!("{found} among {files} files ({shown}{dots}): unpack it with unzip");
            let expected = "one recording of events in a zip archive, or arrays t, x, y and p";
            return Err(IoError::Unsupported { expected, actual });
        }
    };
    let (mut at, mut left, mut found) = (0, most(bytes.len() as u64), vec![Vec::new(); chosen.len()]);
    archive.for_each(|_, record| {
        at += 1;
        if let Some(place) = chosen.iter().position(|number| *number == at) {
            found[place] = archive.content(record, left)?;
            left -= found[place].len() as u64;
        }
        Ok(())
    })?;
    match <[Vec<u8>; 4]>::try_from(found) {
        Ok(columns) => npy::joined(&columns),
        Err(mut found) => Ok(found.pop().unwrap_or_default()),
    }
}

/// The name of a file without its folders, up to the first dot.
fn stem(name: &str) -> &str {
    let file = name.rsplit('/').next().unwrap_or_default();
    file.split('.').next().unwrap_or_default()
}

/// An archive in memory.
struct Archive<'a> {
    file: Bytes<'a>,
    archive: ZipSliceArchive<&'a [u8]>,
}

impl<'a> Archive<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, IoError> {
        let file = Bytes::file("zip", bytes);
        let located = ZipLocator::new().max_search_space(SEARCHED).locate_in_slice(bytes);
        let archive = located.map_err(|(_, error)| {
            file.malformed("archive", file.len(), "an end record in the last 64 KiB before this", error)
        })?;
        Ok(Self { file, archive })
    }

    /// Calls `entry` with each file. Skips folders, and the files that macOS adds for each file.
    fn for_each(
        &self,
        mut entry: impl FnMut(&str, &ZipFileHeaderRecord<'_>) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let Self { file, archive } = self;
        for record in archive.entries() {
            let at = archive.directory_offset() as usize;
            let record = record
                .map_err(|error| file.malformed("archive", at, "a directory of whole records", error))?;
            let path = record.file_path();
            let name = str::from_utf8(path.as_bytes()).map_err(|_| {
                let at = record.local_header_offset() as usize;
                file.malformed("name", at, "UTF-8", path.as_bytes().escape_ascii())
            })?;
            if !record.is_dir() && !name.starts_with("__MACOSX/") {
                entry(name, &record)?;
            }
        }
        Ok(())
    }

    /// The content of a file, of at most `limit` bytes.
    fn content(&self, record: &ZipFileHeaderRecord<'_>, limit: u64) -> Result<Vec<u8>, IoError> {
        let (at, size) = (record.local_header_offset() as usize, record.uncompressed_size_hint());
        if size > limit {
            return Err(self.file.too_large("content", at, limit, size, false));
        }
        let content = self.local(record).and_then(|local| {
            let mut content = Vec::new();
            // A content that is longer than stated is read only one byte beyond the stated size.
            let reader = unpacked(record, &local)?.take(size + 1);
            let read = local.verifying_reader(reader).read_to_end(&mut content);
            let expected = || format!("{size} bytes with CRC-32 {:#010x}", record.crc32());
            read.map_err(|error| (expected(), error.to_string()))?;
            Ok(content)
        });
        content.map_err(|(expected, actual)| self.file.malformed("entry", at, expected, actual))
    }

    /// The first `most` bytes of a file, or the readable part of them.
    fn start(&self, record: &ZipFileHeaderRecord<'_>, most: u64) -> Vec<u8> {
        let mut start = Vec::new();
        if let Ok(local) = self.local(record)
            && let Ok(reader) = unpacked(record, &local)
        {
            // The bytes before the damage identify a damaged file; it is refused when it is read.
            let _ = reader.take(most).read_to_end(&mut start);
        }
        start
    }

    /// The position of a file in the archive; or the expected and the found value.
    fn local(&self, record: &ZipFileHeaderRecord<'_>) -> Result<ZipSliceEntry<'_>, (String, String)> {
        if record.flags().is_encrypted() {
            return Err(("no encryption".to_owned(), "an encrypted entry".to_owned()));
        }
        let local = self.archive.get_entry(record.wayfinder());
        local.map_err(|error| ("a local header".to_owned(), error.to_string()))
    }
}

/// The content of a file as a stream; or the expected and the found value.
fn unpacked<'a>(
    record: &ZipFileHeaderRecord<'_>,
    local: &ZipSliceEntry<'a>,
) -> Result<Box<dyn Read + 'a>, (String, String)> {
    let packed = local.data();
    match record.compression_method() {
        CompressionMethod::STORE => Ok(Box::new(packed)),
        CompressionMethod::DEFLATE => Ok(Box::new(DeflateDecoder::new(packed))),
        other => Err(("a stored or deflated entry".to_owned(), format!("method {}", other.as_u16()))),
    }
}
