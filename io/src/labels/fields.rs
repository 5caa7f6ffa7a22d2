//! The fields of a row, with quotes as in RFC 4180, on one line.

use std::borrow::Cow;

use crate::error::{IoError, Place, shown};
use crate::format::Format;
use crate::text::Line;

/// The separator of the fields of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Separator(u8);

impl Separator {
    /// The separator of a header: a tab, a semicolon or a comma, the first of these that it
    /// contains.
    pub(super) fn of(header: &[u8]) -> Self {
        let mut quoted = false;
        let bare: Vec<u8> = header
            .iter()
            .copied()
            .filter(|&byte| {
                quoted ^= byte == b'"';
                !quoted
            })
            .collect();
        Self(*b"\t;,".iter().find(|separator| bare.contains(separator)).unwrap_or(&b','))
    }

    /// The fields of `line`, without the blanks and the quotes around them.
    pub(super) fn fields(self, line: Line<'_>) -> Result<Vec<Cow<'_, [u8]>>, IoError> {
        let (mut fields, mut rest) = (Vec::new(), line.text);
        loop {
            let blanks = rest.iter().take_while(|&&b| b == b' ' || (b == b'\t' && self.0 != b'\t')).count();
            rest = &rest[blanks..];
            let field = if let Some(inner) = rest.strip_prefix(b"\"") {
                let (field, after) = quoted(inner)
                    .ok_or_else(|| malformed(line, fields.len() + 1, "a quote at the field's end", rest))?;
                let end = after.iter().position(|&byte| byte == self.0).unwrap_or(after.len());
                if !after[..end].trim_ascii().is_empty() {
                    let expected = "nothing between a quote and the separator";
                    return Err(malformed(line, fields.len() + 1, expected, after));
                }
                rest = &after[end..];
                field
            } else {
                let end = rest.iter().position(|&byte| byte == self.0).unwrap_or(rest.len());
                let field = rest[..end].trim_ascii();
                rest = &rest[end..];
                Cow::Borrowed(field)
            };
            fields.push(field);
            match rest.split_first() {
                Some((_, after)) => rest = after,
                None => return Ok(fields),
            }
        }
    }

    /// A field with a point instead of its decimal comma, which it can have if commas do not
    /// separate fields.
    pub(super) fn number(self, field: &[u8]) -> Cow<'_, [u8]> {
        if self.0 == b',' || !field.contains(&b',') || field.contains(&b'.') {
            return Cow::Borrowed(field);
        }
        Cow::Owned(field.iter().map(|&byte| if byte == b',' { b'.' } else { byte }).collect())
    }
}

/// The text before the closing quote, and the text after it; `None` without a closing quote.
fn quoted(inner: &[u8]) -> Option<(Cow<'_, [u8]>, &[u8])> {
    let mut field = Vec::new();
    let mut from = 0;
    loop {
        let quote = from + inner[from..].iter().position(|&byte| byte == b'"')?;
        let after = &inner[quote + 1..];
        if after.first() == Some(&b'"') {
            field.extend_from_slice(&inner[from..=quote]);
            from = quote + 2;
            continue;
        }
        if field.is_empty() {
            return Some((Cow::Borrowed(inner[..quote].trim_ascii()), after));
        }
        field.extend_from_slice(&inner[from..quote]);
        return Some((Cow::Owned(field.trim_ascii().to_vec()), after));
    }
}

/// The error of a field of a table, with its line and its column from 1.
pub(super) fn malformed(line: Line<'_>, column: usize, expected: &str, found: &[u8]) -> IoError {
    IoError::Malformed {
        format: Format::Csv.name(),
        what: "field",
        place: Place::Line(line.number),
        expected: expected.to_owned(),
        actual: format!("{} in column {column}", shown(found)),
    }
}
