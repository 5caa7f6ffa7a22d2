//! What stands between the fields of a line.

use super::field::bare;

/// What separates fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Comma,
    Semicolon,
    /// Any number of blanks and tabs.
    Blanks,
}

/// Fields that an event has at least.
const FIELDS: usize = 4;

impl Separator {
    /// The separator of `line`: the first of comma, semicolon and blanks that gives enough fields for an event, else the
    /// first that is there.
    pub(crate) fn of(line: &[u8]) -> Self {
        const ALL: [Separator; 3] = [Separator::Comma, Separator::Semicolon, Separator::Blanks];
        let least = |fields: usize| ALL.into_iter().find(|s| s.fields(line).take(fields).count() == fields);
        least(FIELDS).or_else(|| least(2)).unwrap_or(Self::Comma)
    }

    /// The fields of `line`, without the blanks and the quotes around them.
    pub(crate) fn fields(self, line: &[u8]) -> Fields<'_> {
        let rest = if self == Self::Blanks { line.trim_ascii_start() } else { line };
        Fields { separator: self, rest: Some(rest) }
    }

    fn separates(self, byte: u8) -> bool {
        match self {
            Self::Comma => byte == b',',
            Self::Semicolon => byte == b';',
            Self::Blanks => byte.is_ascii_whitespace(),
        }
    }
}

/// The fields of a line.
pub(crate) struct Fields<'a> {
    separator: Separator,
    rest: Option<&'a [u8]>,
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?;
        let end = rest.iter().position(|&byte| self.separator.separates(byte));
        self.rest = end.map(|end| &rest[end + 1..]);
        if self.separator == Separator::Blanks {
            self.rest = self.rest.map(<[u8]>::trim_ascii_start).filter(|rest| !rest.is_empty());
        }
        Some(bare(&rest[..end.unwrap_or(rest.len())]))
    }
}
