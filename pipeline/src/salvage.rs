//! The readable part of a recording that was cut short.

use meissner_io::Recording;
use serde::Serialize;

use crate::text::grouped;

/// The part of a recording that was kept, and where the rest begins.
#[derive(Clone, Debug, Serialize)]
pub struct Salvaged {
    /// Events kept.
    events: usize,
    /// The part that is incomplete.
    what: &'static str,
    /// Where it starts: a byte of the file, or a line of a text.
    place: String,
    bytes_not_read: u64,
}

impl Salvaged {
    /// `None` for a complete recording.
    pub fn of(recording: &Recording) -> Option<Self> {
        let salvage = recording.salvaged?;
        let events = recording.events.len();
        let (what, place) = (salvage.what, salvage.place.to_string());
        Some(Self { events, what, place, bytes_not_read: salvage.bytes_not_read })
    }
}

impl std::fmt::Display for Salvaged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { events, what, place, bytes_not_read } = self;
        let (events, bytes) = (grouped(*events as u64), grouped(*bytes_not_read));
        write!(f, "{events} events kept; {what}, from {place} on, is not whole: {bytes} bytes not read")
    }
}
