//! Slices that did not arrive, found by their numbers, with the reason.

use serde::Serialize;

use crate::wire::{Malformed, SliceHeader};

/// Why slices are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The buffer was full, because this process was slower than the driver: the oldest slices made room for newer ones.
    Overflow,
    /// They were published before this process had connected.
    JoinedLate,
    /// They arrived, and are no slices of events.
    Malformed,
}

/// A number of slices, and of their events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Lost {
    /// Slices.
    pub slices: u64,
    /// Events in them.
    pub events: u64,
}

/// What is missing, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// [`Reason::Overflow`].
    pub overflow: Lost,
    /// [`Reason::JoinedLate`].
    pub joined_late: Lost,
    /// [`Reason::Malformed`].
    pub malformed: Lost,
}

/// A gap in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Gap {
    /// The driver's run.
    pub run: u64,
    /// Why.
    pub reason: Reason,
    /// Number of the first event that is missing.
    pub first_event: u64,
    /// What is missing.
    #[serde(flatten)]
    pub lost: Lost,
}

/// Follows the numbers of the slices of one driver after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    /// The run, the number of the next slice, and that of the next event.
    expected: Option<(u64, u64, u64)>,
    /// Sums over all runs.
    pub losses: Losses,
}

/// What the number of a slice tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// Whether another start of the driver wrote it than the slice before.
    pub is_new_run: bool,
    /// What is missing before it.
    pub gap: Option<Gap>,
}

impl Watch {
    /// Notes the slice of `header` with this number of events.
    ///
    /// # Errors
    /// It was seen before, or counts fewer events than were seen. Nothing is noted.
    pub fn see(&mut self, header: &SliceHeader, events: usize) -> Result<Seen, Malformed> {
        let &SliceHeader { run, sequence, first_event, .. } = header;
        let known = self.expected.filter(|expected| expected.0 == run);
        let (_, next_slice, next_event) = known.unwrap_or((run, 0, 0));
        let Some(slices) = sequence.checked_sub(next_slice) else {
            return Err(Malformed::Repeated { expected: next_slice, found: sequence });
        };
        let Some(missing) = first_event.checked_sub(next_event) else {
            return Err(Malformed::Count { expected: next_event, found: first_event });
        };
        // A process that has seen the driver's run before was connected when this one began.
        let reason = if self.expected.is_some() { Reason::Overflow } else { Reason::JoinedLate };
        self.expected = Some((run, sequence.saturating_add(1), first_event.saturating_add(events as u64)));
        let lost = Lost { slices, events: missing };
        let gap = (slices > 0).then_some(Gap { run, reason, first_event: next_event, lost });
        if let Some(gap) = gap {
            self.add(gap.reason, gap.lost);
        }
        Ok(Seen { is_new_run: known.is_none(), gap })
    }

    /// Counts the slice of `header`, which is refused. If it is the next of its run, it does not count as missing too.
    pub fn refuse(&mut self, header: &SliceHeader, events: usize) {
        let lost = Lost { slices: 1, events: events as u64 };
        if let Some((run, slice, event)) = self.expected
            && (run, slice) == (header.run, header.sequence)
        {
            self.expected = Some((run, slice.saturating_add(1), event.saturating_add(lost.events)));
        }
        self.add(Reason::Malformed, lost);
    }

    fn add(&mut self, reason: Reason, lost: Lost) {
        let sum = match reason {
            Reason::Overflow => &mut self.losses.overflow,
            Reason::JoinedLate => &mut self.losses.joined_late,
            Reason::Malformed => &mut self.losses.malformed,
        };
        sum.slices = sum.slices.saturating_add(lost.slices);
        sum.events = sum.events.saturating_add(lost.events);
    }
}

#[cfg(test)]
mod tests {
    use super::{Gap, Lost, Reason, Seen, Watch};
    use crate::wire::{Malformed, SliceHeader};

    fn header(run: u64, sequence: u64, first_event: u64) -> SliceHeader {
        SliceHeader { run, sequence, first_event, ..SliceHeader::default() }
    }

    #[test]
    fn a_gap_within_a_run_is_an_overflow_and_one_before_the_first_slice_is_not() {
        let mut watch = Watch::default();
        let lost = Lost { slices: 3, events: 30 };
        let gap = Gap { run: 7, reason: Reason::JoinedLate, first_event: 0, lost };
        let seen = watch.see(&header(7, 3, 30), 10);
        assert_eq!(seen, Ok(Seen { is_new_run: true, gap: Some(gap) }));
        assert_eq!(watch.see(&header(7, 4, 40), 10), Ok(Seen { is_new_run: false, gap: None }));
        let lost = Lost { slices: 5, events: 123 };
        let gap = Gap { run: 7, reason: Reason::Overflow, first_event: 50, lost };
        assert_eq!(watch.see(&header(7, 10, 173), 1), Ok(Seen { is_new_run: false, gap: Some(gap) }));
        assert_eq!(watch.losses.joined_late, Lost { slices: 3, events: 30 });
        assert_eq!(watch.losses.overflow, Lost { slices: 5, events: 123 });
    }

    #[test]
    fn another_start_of_the_driver_counts_from_0_again() {
        let mut watch = Watch::default();
        watch.see(&header(1, 0, 0), 10).expect("the first");
        assert_eq!(watch.see(&header(2, 0, 0), 4), Ok(Seen { is_new_run: true, gap: None }));
        let seen = watch.see(&header(3, 2, 9), 4).expect("a later one");
        assert_eq!(
            seen.gap.map(|gap| (gap.reason, gap.lost)),
            Some((Reason::Overflow, Lost { slices: 2, events: 9 }))
        );
    }

    #[test]
    fn a_refused_slice_counts_once() {
        let mut watch = Watch::default();
        watch.see(&header(1, 0, 0), 10).expect("the first");
        watch.refuse(&header(1, 1, 10), 5);
        watch.refuse(&header(9, 4, 10), 5);
        assert_eq!(watch.see(&header(1, 2, 15), 5), Ok(Seen { is_new_run: false, gap: None }));
        assert_eq!(watch.losses.malformed, Lost { slices: 2, events: 10 });
        assert_eq!(watch.losses.overflow, Lost::default());
    }

    #[test]
    fn what_was_seen_before_is_refused_and_changes_nothing() {
        let mut watch = Watch::default();
        watch.see(&header(1, 0, 0), 10).expect("the first");
        let before = watch.losses;
        assert_eq!(watch.see(&header(1, 0, 0), 10), Err(Malformed::Repeated { expected: 1, found: 0 }));
        assert_eq!(watch.see(&header(1, 1, 9), 10), Err(Malformed::Count { expected: 10, found: 9 }));
        assert_eq!(watch.losses, before);
        assert_eq!(watch.see(&header(1, 1, 10), u64::MAX as usize).map(|seen| seen.gap), Ok(None));
    }
}
