//! The parts that a reader leaves out of a recording. None of them is an event that its sensor can
//! have.
//!
//! Input: each odd word, event or line, as an error. Output: the error, if the reader is strict;
//! otherwise counts by kind, with the first errors as texts. Invariant: every omitted part is
//! counted here, or in [`Recording::other_streams`](crate::Recording::other_streams) if it belongs
//! to another stream or has no place yet.

use std::fmt;

use meissner_engine::Event;

use crate::error::IoError;

/// Number of errors of a kind that are kept as texts.
const KEPT: usize = 5;
/// Number of lines from the start of a text, of which at most half may be refused.
const FIRST_LINES: u64 = 100;

/// The reason why a part was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum LeftOutKind {
    /// Events outside the sensor that the file names.
    OutsideSensor,
    /// Words of a type that is reserved or does not concern brightness, such as padding.
    OtherWords,
    /// Events of EVT3 in a row of an external system (word 0x1).
    OtherEvents,
    /// Events with a value that no event can have, such as a polarity of 7.
    Malformed,
    /// Lines of a text that are not events.
    Lines,
}

impl LeftOutKind {
    /// The name for programs: `outside_sensor`, `other_words`, `other_events`, `malformed` or
    /// `lines`.
    pub fn name(self) -> &'static str {
        match self {
            Self::OutsideSensor => "outside_sensor",
            Self::OtherWords => "other_words",
            Self::OtherEvents => "other_events",
            Self::Malformed => "malformed",
            Self::Lines => "lines",
        }
    }
}

impl fmt::Display for LeftOutKind {
    /// The name for messages, in the plural.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::OutsideSensor => "events outside the sensor that the file names",
            Self::OtherWords => "words of a type that holds no events",
            Self::OtherEvents => "events of another system (EM)",
            Self::Malformed => "events with values that none can have",
            Self::Lines => "lines that are no events",
        })
    }
}

/// The parts that were left out of a recording for one reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The reason.
    pub kind: LeftOutKind,
    /// Number of parts.
    pub count: u64,
    /// The first of them with their places, at most five, as the errors of a strict reader.
    pub first: Vec<String>,
}

/// Counts the parts that a reader leaves out.
#[derive(Clone, Debug, Default)]
pub(crate) struct PassedOver {
    strict: bool,
    kinds: Vec<LeftOut>,
}

impl PassedOver {
    /// No counts yet; with `strict`, the first omitted part is an error.
    pub(crate) fn new(strict: bool) -> Self {
        Self { strict, kinds: Vec::new() }
    }

    /// Whether each omitted part is an error.
    pub(crate) fn is_strict(&self) -> bool {
        self.strict
    }

    /// Leaves out `count` elements; `error` is the error of a strict reader.
    ///
    /// # Errors
    /// `error`, if the reader is strict.
    #[cold]
    pub(crate) fn pass(&mut self, kind: LeftOutKind, count: u64, error: IoError) -> Result<(), IoError> {
        if self.strict {
            return Err(error);
        }
        self.note(kind, count, &error);
        Ok(())
    }

    /// Counts parts that are left out even if the reader is strict.
    pub(crate) fn note(&mut self, kind: LeftOutKind, count: u64, error: &IoError) {
        let known = self.kinds.iter().position(|left_out| left_out.kind == kind);
        let index = known.unwrap_or_else(|| {
            self.kinds.push(LeftOut { kind, count: 0, first: Vec::new() });
            self.kinds.len() - 1
        });
        let left_out = &mut self.kinds[index];
        left_out.count += count;
        if left_out.first.len() < KEPT {
            left_out.first.push(error.to_string());
        }
    }

    /// The parts that were left out so far.
    pub(crate) fn so_far(&self) -> &[LeftOut] {
        &self.kinds
    }

    /// All parts that were left out.
    pub(crate) fn end(self) -> Vec<LeftOut> {
        self.kinds
    }
}

/// Whether so many of the first lines are refused that the text probably does not contain events:
/// more than half of the first 100, or of all lines of a shorter text at its `end`.
pub fn is_mostly_refused(refused: u64, taken: u64, end: bool) -> bool {
    let lines = refused + taken;
    (lines <= FIRST_LINES && 2 * refused > FIRST_LINES) || (end && lines < FIRST_LINES && refused > taken)
}

/// The events of a text with the lines `items`. `strict`: the first refused line is an error.
///
/// # Errors
/// An error that is not about one line, and [`IoError::Lines`] if most of the first lines are
/// refused.
pub(crate) fn events_of_lines(
    items: impl Iterator<Item = Result<Event, IoError>>,
    strict: bool,
) -> Result<(Vec<Event>, Vec<LeftOut>), IoError> {
    let (mut events, mut passed) = (Vec::new(), PassedOver::new(strict));
    let (mut refused, mut first) = (0, None);
    for item in items {
        match item {
            Ok(event) => events.push(event),
            Err(error) if !strict && error.is_about_a_line() => {
                passed.note(LeftOutKind::Lines, 1, &error);
                refused += 1;
                first.get_or_insert(error);
                if is_mostly_refused(refused, events.len() as u64, false) {
                    break;
                }
            }
            Err(error) => return Err(error),
        }
    }
    let taken = events.len() as u64;
    match first {
        Some(first) if is_mostly_refused(refused, taken, true) => {
            let lines = if 2 * refused > FIRST_LINES { FIRST_LINES } else { refused + taken };
            // A single line cannot be compared with others.
            Err(if lines == 1 { first } else { IoError::Lines { refused, lines, first: Box::new(first) } })
        }
        _ => Ok((events, passed.end())),
    }
}
