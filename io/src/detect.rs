//! The format of a recording, from its bytes alone: [`Kind`] knows the marks; CSV is also any text with a comma in its first
//! line.

use crate::csv;
use crate::error::{IoError, beginning};
use crate::format::Format;
use crate::kind::{EVENTS, Kind};
use crate::prophesee::{self, Header};

/// The format of `bytes`, the whole content of a file, or `None` where it is none of them.
///
/// It looks at the marks only: a file that is detected can still be corrupt. O(n) for N-MNIST, O(1) for the
/// others. No bytes at all have no format.
pub fn detect(bytes: &[u8]) -> Option<Format> {
    format_of(bytes).ok()
}

/// The format, or why there is none.
pub(crate) fn format_of(bytes: &[u8]) -> Result<Format, IoError> {
    match Kind::of(bytes) {
        Some(Kind::Events(format)) => return Ok(format),
        Some(found) => return Err(IoError::OtherKind { expected: EVENTS, found }),
        None if csv::is_csv(bytes) => return Ok(Format::Csv),
        None => {}
    }
    if let Some(prophesee::Kind::Unknown(encoding)) = Header::scan(bytes).kind() {
        let actual = format!("encoding `{}`", beginning(&encoding, 40));
        return Err(IoError::Unsupported { expected: "EVT 2.0 or 3.0", actual });
    }
    let start = bytes[..bytes.len().min(16)].escape_ascii().to_string();
    Err(IoError::UnknownFormat { length: bytes.len() as u64, start: format!("`{start}`") })
}
