//! The format of some bytes, from the bytes alone.
//!
//! AEDAT4 and npy have a magic; Prophesee's files have a text header that names the encoding; CSV is text
//! without control characters and with a comma in its first line; N-MNIST has no mark at all and is tried
//! last.

use crate::error::{IoError, beginning};
use crate::format::Format;
use crate::prophesee::{Header, Kind, has_header};
use crate::{aedat4, csv, nmnist, npy};

/// The format of `bytes`, the whole content of a file, or `None` where it is none of them.
///
/// It looks at the marks only: a file that is detected can still be corrupt. O(n) for N-MNIST, O(1) for the
/// others. No bytes at all have no format.
pub fn detect(bytes: &[u8]) -> Option<Format> {
    format_of(bytes).ok()
}

/// The format, or why there is none.
pub(crate) fn format_of(bytes: &[u8]) -> Result<Format, IoError> {
    if aedat4::has_magic(bytes) {
        return Ok(Format::Aedat4);
    }
    if npy::has_magic(bytes) {
        return Ok(Format::Npy);
    }
    if bytes.starts_with(b"#!AER-DAT") {
        let actual = String::from_utf8_lossy(&bytes[..bytes.len().min(14)]).trim_end().to_owned();
        return Err(IoError::Unsupported { expected: "AEDAT of version 4.0", actual });
    }
    if has_header(bytes) {
        return match Header::scan(bytes).kind() {
            Some(Kind::Known(format)) => Ok(format),
            Some(Kind::Unknown(encoding)) => Err(IoError::Unsupported {
                expected: "EVT 2.0 or 3.0",
                actual: format!("encoding `{}`", beginning(&encoding, 40)),
            }),
            None => Err(unknown(bytes)),
        };
    }
    if csv::is_csv(bytes) {
        return Ok(Format::Csv);
    }
    if nmnist::is_nmnist(bytes) {
        return Ok(Format::Nmnist);
    }
    Err(unknown(bytes))
}

fn unknown(bytes: &[u8]) -> IoError {
    let start = bytes[..bytes.len().min(16)].escape_ascii().to_string();
    IoError::UnknownFormat { length: bytes.len() as u64, start: format!("`{start}`") }
}
