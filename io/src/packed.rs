//! gzip and zip around one recording.
//!
//! Input: the bytes of a file, or a stream of them. Output: the content of a gzip file (of all its
//! members, RFC 1952), or of the only recording of a zip archive ([`crate::zip`]). Invariant: a
//! content has at most [`PACKET_BYTES`] and [`EXPANSION`] bytes for each packed byte.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::limits::{STREAM_BYTES, most};
use crate::recording::Salvage;
use crate::zip;

/// First bytes of a gzip file: the mark and the only method, deflate.
const GZIP: &[u8] = b"\x1f\x8b\x08";
/// First bytes of a zip archive with an entry.
const ZIP: &[u8] = b"PK\x03\x04";

/// A content, and the incomplete end that was left out.
pub(crate) type Content<'a> = (Cow<'a, [u8]>, Option<Salvage>);

/// Whether a file that starts with `bytes` is a gzip file or a zip archive.
pub(crate) fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(GZIP) || bytes.starts_with(ZIP)
}

/// The content of `bytes`, a whole file, unpacked if it is a gzip file or a zip archive.
pub(crate) fn content(bytes: &[u8], salvage: bool) -> Result<Content<'_>, IoError> {
    if bytes.starts_with(GZIP) {
        let (content, salvaged) = gunzip(bytes, bytes.len() as u64, salvage)?;
        Ok((content.into(), salvaged))
    } else if bytes.starts_with(ZIP) {
        Ok((zip::recording(bytes)?.into(), None))
    } else {
        Ok((bytes.into(), None))
    }
}

/// The content of the file at `path`, like [`content`]. A gzip file is unpacked while it is read.
pub(crate) fn content_of_file(path: &Path, salvage: bool) -> Result<Content<'static>, IoError> {
    let fail = |source| IoError::file("read", path)(source);
    let file = File::open(path).map_err(fail)?;
    let about = file.metadata().map_err(fail)?;
    let mut input = BufReader::with_capacity(1 << 16, file);
    // The length of a pipe is not known beforehand.
    if about.is_file() && input.fill_buf().map_err(fail)?.starts_with(GZIP) {
        let (content, salvaged) = gunzip(input, about.len(), salvage)?;
        return Ok((content.into(), salvaged));
    }
    // The stated length of a file must not alone decide how much memory is used.
    let limit = if about.is_file() { about.len().max(STREAM_BYTES) } else { STREAM_BYTES };
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(about.len() as usize).map_err(|_| fail(ErrorKind::OutOfMemory.into()))?;
    read_bounded(input, limit, &mut bytes).map_err(fail)??;
    match content(&bytes, salvage)? {
        (Cow::Owned(content), salvaged) => Ok((content.into(), salvaged)),
        (Cow::Borrowed(_), salvaged) => Ok((bytes.into(), salvaged)),
    }
}

/// Reads all of `input` after `bytes`, at most `limit` bytes.
pub(crate) fn read_bounded(
    input: impl Read,
    limit: u64,
    bytes: &mut Vec<u8>,
) -> io::Result<Result<(), IoError>> {
    input.take(limit.saturating_add(1)).read_to_end(bytes)?;
    let actual = bytes.len() as u64;
    let too_large =
        || Bytes::file("recording", &[]).too_large("content of a device or a pipe", 0, limit, actual, true);
    Ok(if actual > limit { Err(too_large()) } else { Ok(()) })
}

/// The content of the gzip file `input` of `packed` bytes; with `salvage`, up to a cut.
fn gunzip(input: impl BufRead, packed: u64, salvage: bool) -> Result<(Vec<u8>, Option<Salvage>), IoError> {
    let (format, what, place) = ("gzip", "compressed content", Place::Byte(0));
    let limit = most(packed);
    let mut content = Vec::new();
    let read = MultiGzDecoder::new(input).take(limit + 1).read_to_end(&mut content);
    if content.len() as u64 > limit {
        let file = Bytes::file(format, &[]);
        return Err(file.too_large("unpacked content", 0, limit, content.len() as u64, true));
    }
    match read.map_err(|error| (error.kind(), error)) {
        Ok(_) => Ok((content, None)),
        Err((ErrorKind::UnexpectedEof, _)) if salvage => {
            let salvaged = Salvage { what, place: Place::Byte(packed), bytes_not_read: 0 };
            Ok((content, Some(salvaged)))
        }
        Err((ErrorKind::UnexpectedEof, _)) => Err(IoError::Truncated {
            format,
            what,
            place,
            expected: packed + 1,
            actual: packed,
            at_least: true,
        }),
        Err((ErrorKind::InvalidData | ErrorKind::InvalidInput, error)) => {
            let expected = "members of deflated data with their CRC-32".to_owned();
            Err(IoError::Malformed { format, what, place, expected, actual: error.to_string() })
        }
        Err((_, source)) => Err(IoError::Stream { format, action: "read", place, source }),
    }
}
