//! Lines of bounded length from any buffered reader, without reading beyond the line.

use std::io::{BufRead, ErrorKind};

use crate::error::{IoError, Place};
use crate::format::Format;
use crate::limits::LINE_BYTES;

/// Reads line after line into one buffer.
///
/// Invariant: a line is returned as soon as its line feed is in the reader's buffer; no more is asked of the
/// reader.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    input: R,
    line: Vec<u8>,
    /// Number of the line in `line`, from 1.
    number: u64,
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { input, line: Vec::new(), number: 0 }
    }

    /// The number of the line that was read last; 0 before the first.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// The bytes of the line that was read last, or as many of them as a line may have.
    pub(crate) fn raw(&self) -> &[u8] {
        &self.line
    }

    /// The next line and its number, without spaces around it; `None` at the end of the input.
    pub(crate) fn next(&mut self) -> Result<Option<(&[u8], u64)>, IoError> {
        self.line.clear();
        self.number += 1;
        let place = Place::Line(self.number);
        loop {
            let buffer = match self.input.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(source) => {
                    return Err(IoError::Stream { format: Format::Csv, action: "read", place, source });
                }
            };
            if buffer.is_empty() {
                break;
            }
            let end = buffer.iter().position(|&b| b == b'\n');
            let length = end.map_or(buffer.len(), |end| end + 1);
            let total = (self.line.len() + length) as u64;
            if total > LINE_BYTES {
                // The start shows what came in place of lines.
                let room = LINE_BYTES as usize - self.line.len();
                self.line.extend_from_slice(&buffer[..room]);
                return Err(IoError::TooLarge {
                    format: Format::Csv,
                    what: "line",
                    place,
                    limit: LINE_BYTES,
                    actual: total,
                    at_least: end.is_none(),
                });
            }
            self.line.extend_from_slice(&buffer[..length]);
            self.input.consume(length);
            if end.is_some() {
                break;
            }
        }
        if self.line.is_empty() {
            return Ok(None);
        }
        Ok(Some(self.current()))
    }

    /// The line that was read last and its number, without spaces around it.
    pub(crate) fn current(&self) -> (&[u8], u64) {
        let mut line = self.line.as_slice();
        if self.number == 1 {
            line = line.strip_prefix(super::BYTE_ORDER_MARK).unwrap_or(line);
        }
        (line.trim_ascii(), self.number)
    }
}
