//! CSV: events from and to text, one event a line.
//!
//! ```text
//! # sensor 346x260
//! t,x,y,p
//! 1589163005561252,215,164,1
//! ```
//!
//! Lines that start with `#` are comments; `# sensor WxH` before the first event names the geometry. The
//! header is optional: without it the columns are t, x, y, p. With it they are found by name, in any order,
//! in upper or lower case, and other columns are passed over. t is in whole microseconds (`12` or `12.0`), p
//! is 1 or +1 for a rise and 0 or -1 for a fall (also `True` and `False`). Blank lines, spaces around fields,
//! quotes around fields, line ends of either kind and a byte order mark are accepted.
//!
//! A line reader of our own in place of the `csv` crate, because the fields are four integers, and the crate
//! neither bounds the length of a record nor promises to read no further than the line.

mod columns;
mod field;
mod line;
mod read;
mod write;

pub(crate) use field::{bare, shown};
pub(crate) use line::Lines;
pub use read::CsvEvents;
pub(crate) use read::decode;
pub(crate) use write::encode;

/// Byte order mark that some programs write before UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether `bytes` start as such a text does: no control characters, and a comma in the first line that
/// counts.
pub(crate) fn is_csv(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(4096)];
    let start = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
    if start.iter().any(|&b| b == 0x7f || (b < b' ' && !b"\t\r\n".contains(&b))) {
        return false;
    }
    let mut lines = start.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty());
    match lines.find(|line| !line.starts_with(b"#")) {
        Some(line) => line.contains(&b','),
        None => start.starts_with(b"#"),
    }
}
