//! The data set of digits.

use std::path::Path;

use meissner_engine::Event;
use meissner_io::datasets::{NmnistDataset, NmnistRecording, Split};

use crate::error::CliError;
use meissner_pipeline::text::grouped;

/// The recordings of a data set.
pub(crate) struct DigitsData {
    /// The recordings, by split, by class and then by file name in natural order.
    pub(crate) recordings: Vec<NmnistRecording>,
    /// What a person should know about the data.
    pub(crate) notes: Vec<String>,
}

impl DigitsData {
    /// Reads the data set in `folder`.
    pub(crate) fn read(folder: &Path) -> Result<Self, CliError> {
        let NmnistDataset { recordings, passed_over } = NmnistDataset::read(folder)?;
        let mut notes = Vec::new();
        let late: u64 = recordings.iter().map(|recording| late(&recording.events)).sum();
        if late > 0 {
            notes.push(format!("{} events are earlier than one before them", grouped(late)));
        }
        if let [first, ..] = &passed_over[..] {
            let (count, first) = (grouped(passed_over.len() as u64), first.display());
            notes.push(format!("{count} files are no recordings and are passed over, the first {first}"));
        }
        Ok(Self { recordings, notes })
    }

    /// Places of the recordings of `split`, ascending.
    pub(crate) fn of(&self, split: Split) -> Vec<usize> {
        (0..self.recordings.len()).filter(|&i| self.recordings[i].split == split).collect()
    }

    /// Classes of all recordings.
    pub(crate) fn classes(&self) -> Vec<usize> {
        self.recordings.iter().map(|recording| recording.class).collect()
    }

    /// Events of all recordings.
    pub(crate) fn events(&self) -> u64 {
        self.recordings.iter().map(|recording| recording.events.len() as u64).sum()
    }
}

/// Events that are earlier than one before them.
fn late(events: &[Event]) -> u64 {
    let mut newest = i64::MIN;
    let mut late = 0;
    for event in events {
        late += u64::from(event.t_us < newest);
        newest = newest.max(event.t_us);
    }
    late
}

#[cfg(test)]
mod tests {
    use super::late;
    use meissner_engine::Event;

    #[test]
    fn an_event_is_late_behind_any_newer_one() {
        let events = [5, 3, 4, 5, 9].map(|t_us| Event::new(t_us, 0, 0, true));
        assert_eq!(late(&events), 2);
    }
}
