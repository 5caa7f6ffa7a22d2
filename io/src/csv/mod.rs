//! CSV: events from and to text, one event a line.
//!
//! ```text
//! # sensor 346x260
//! t,x,y,p
//! 1589163005561252,215,164,1
//! ```
//!
//! Commas, semicolons, or blanks and tabs separate the fields of a line. Lines that start with `#` or `%` are comments;
//! `# sensor WxH` before the first event names the geometry, and so does a line with width and height alone.
//!
//! With a header, which may stand in a comment, the columns are found by name (t, ts, time or timestamp; x; y; p, pol, polarity or on), in any
//! order, in upper or lower case, and other columns are passed over. Without one there are four columns, and their order is
//! the caller's ([`TextOptions`]) or what all lines say (`evidence`); a text that leaves the choice is refused.
//!
//! t is in whole microseconds (`12` or `12.0`), or in the unit that the caller or the header (`t_ms`) says, or in
//! seconds where times have a decimal point and any has four or more decimals: fewer decimals could be milliseconds, and such a text
//! is refused. What is finer than a microsecond is rounded to the nearest, halves away from zero, digit by digit and not as a float. p
//! is 1 or +1 for a rise and 0 or -1 for a fall (also `True` and `False`). Blank lines, spaces around fields,
//! quotes around fields, line ends of either kind and a byte order mark are accepted.
//!
//! A line reader of our own in place of the `csv` crate, because the fields are four integers, and the crate
//! neither bounds the length of a record nor promises to read no further than the line.

mod columns;
mod evidence;
mod field;
mod layout;
mod line;
mod read;
mod separator;
mod write;

pub use columns::ColumnOrder;
use field::Number;
pub(crate) use field::{bare, shown};
pub use layout::{TextOptions, TimeUnit};
pub(crate) use line::Lines;
pub use read::CsvEvents;
pub(crate) use read::decode;
use separator::Separator;
pub(crate) use write::encode;

/// Byte order mark that some programs write before UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether `line` is a comment.
fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"%")
}

/// The start of `bytes` where that is text: no control characters.
fn text(bytes: &[u8]) -> Option<&[u8]> {
    let start = &bytes[..bytes.len().min(4096)];
    let start = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
    let is_text = !start.iter().any(|&b| b == 0x7f || (b < b' ' && !b"\t\r\n".contains(&b)));
    is_text.then_some(start)
}

/// Whether `bytes` start as text does.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    !bytes.is_empty() && text(bytes).is_some()
}

/// The lines of a text that are neither blank nor comments.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty() && !is_comment(line))
}

/// The first line of `bytes` that is neither blank nor a comment; `None` where they are no text or have none.
pub(crate) fn first_line(bytes: &[u8]) -> Option<&[u8]> {
    lines(text(bytes)?).next()
}

/// Whether `line` can be nothing but an event, or the header of events.
pub(crate) fn is_of_events(line: &[u8]) -> bool {
    let separator = Separator::of(line);
    let numbers = separator.fields(line).filter(|field| Number::parse(field).is_some()).count();
    ColumnOrder::from_header(line, separator).is_ok() || (numbers == 4 && separator.fields(line).count() == 4)
}

/// Whether `bytes` start as such a text may: no control characters, and a comma in the first line that counts, or a line that
/// can be nothing but an event or a header, which one with a width and a height may precede.
pub(crate) fn is_csv(bytes: &[u8]) -> bool {
    let Some(text) = text(bytes) else { return false };
    let mut lines = lines(text);
    let Some(first) = lines.next() else { return text.starts_with(b"#") };
    let numbers = |line: &[u8]| Separator::Blanks.fields(line).all(|field| Number::parse(field).is_some());
    let is_size = Separator::Blanks.fields(first).count() == 2 && numbers(first);
    first.contains(&b',') || is_of_events(first) || (is_size && lines.next().is_some_and(is_of_events))
}
