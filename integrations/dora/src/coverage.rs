//! Which events of a sensor reached the engine, and what became of the others.
//!
//! Enters: the place of each message of events, in order of arrival, and how many messages the queue of this input dropped. Leaves: the part
//! of each message that the engine takes, and the losses. Invariant, at any time: `next = accepted + lost`, so that every event before `next`
//! is in one of the two.
//!
//! A source numbers its events and its messages. A message that does not begin at `next` proves that others are missing. What arrives after it
//! was counted as lost stays lost: the engine takes events in order only.

use serde::{Deserialize, Serialize};

/// Why an event did not reach the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Reason {
    /// The queue of the node's input was full.
    Queue,
    /// It was lost on the way, outside of this node.
    Link,
    /// In one gap, some messages were dropped by the queue and others lost on the way.
    QueueOrLink,
    /// It was sent before the node started, while it was down, or after the state that the node restored.
    Down,
    /// The engine's own queue was full.
    Overload,
    /// The message could not be read.
    Malformed,
}

impl Reason {
    /// All reasons, in the order of their counts.
    pub(crate) const ALL: [Self; 6] =
        [Self::Queue, Self::Link, Self::QueueOrLink, Self::Down, Self::Overload, Self::Malformed];

    /// The name in messages and metrics.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Queue => "queue",
            Self::Link => "link",
            Self::QueueOrLink => "queue_or_link",
            Self::Down => "down",
            Self::Overload => "overload",
            Self::Malformed => "malformed",
        }
    }
}

/// Lost events by reason.
pub(crate) type Lost = [u64; Reason::ALL.len()];

/// The messages of one output by their numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Numbers {
    /// Number of the next message; `None` before the first.
    next: Option<u64>,
    /// Messages that the queue dropped and that no gap has shown yet.
    dropped: u64,
}

impl Numbers {
    /// Notes that the queue of the input dropped this many messages.
    pub(crate) fn dropped(&mut self, messages: u64) {
        self.dropped += messages;
    }

    /// The message of this number has arrived: how many before it are missing and why. `None` if it is late or a repetition.
    pub(crate) fn arrived(&mut self, number: u64) -> Option<(u64, Reason)> {
        let missing = number.checked_sub(self.next.unwrap_or(0))?;
        let reason = if missing <= self.dropped {
            Reason::Queue
        } else if self.next.is_none() {
            Reason::Down
        } else if self.dropped == 0 {
            Reason::Link
        } else {
            Reason::QueueOrLink
        };
        self.next = Some(number + 1);
        self.dropped = self.dropped.saturating_sub(missing);
        Some((missing, reason))
    }
}

/// What a node knows of the events of one life of a source.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Coverage {
    /// Number of the next event.
    pub(crate) next: u64,
    /// Events that the engine took.
    pub(crate) accepted: u64,
    /// Events that it did not.
    pub(crate) lost: Lost,
    /// Messages that came after their events had been counted as lost, or twice.
    pub(crate) late_messages: u64,
    numbers: Numbers,
}

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Placed {
    /// Events that are missing before it.
    pub(crate) gap: Option<(u64, u64, Reason)>,
    /// Events at its beginning that are not taken: they are known already.
    pub(crate) skip: usize,
}

impl Coverage {
    /// What a state covered: nothing is known of later messages.
    pub(crate) fn resumed(next: u64, accepted: u64, lost: Lost) -> Self {
        Self { next, accepted, lost, ..Self::default() }
    }

    /// Notes that the queue of the input dropped this many messages.
    pub(crate) fn dropped(&mut self, messages: u64) {
        self.numbers.dropped(messages);
    }

    /// Places the message of this number, whose `len` events begin with `first`. Its gap counts as lost from now on; the caller takes the
    /// events ([`Self::take`]) or loses them ([`Self::lose`]). `None` if there is nothing new in it.
    pub(crate) fn place(&mut self, number: u64, first: u64, len: usize) -> Option<Placed> {
        let arrived = self.numbers.arrived(number);
        let end = first.saturating_add(len as u64);
        let is_new = if len == 0 { first >= self.next } else { end > self.next };
        let Some((_, reason)) = arrived.filter(|_| is_new) else {
            self.late_messages += 1;
            return None;
        };
        let gap = (first > self.next).then(|| self.lose_until(first, reason));
        Some(Placed { gap, skip: self.next.saturating_sub(first) as usize })
    }

    /// The engine takes the next `events`.
    pub(crate) fn take(&mut self, events: usize) {
        self.next += events as u64;
        self.accepted += events as u64;
    }

    /// The engine does not take the next `events`.
    pub(crate) fn lose(&mut self, events: usize, reason: Reason) -> (u64, u64, Reason) {
        self.lose_until(self.next + events as u64, reason)
    }

    fn lose_until(&mut self, until: u64, reason: Reason) -> (u64, u64, Reason) {
        let from = std::mem::replace(&mut self.next, until);
        self.lost[reason as usize] += until - from;
        (from, until, reason)
    }
}

#[cfg(test)]
mod tests {
    use super::{Coverage, Numbers, Reason};

    fn balanced(coverage: &Coverage) -> bool {
        coverage.next == coverage.accepted + coverage.lost.iter().sum::<u64>()
    }

    #[test]
    fn reasons_count_where_their_order_says() {
        for (place, reason) in Reason::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, place);
        }
    }

    #[test]
    fn events_in_order_are_taken_and_a_gap_is_lost_on_the_link() {
        let mut coverage = Coverage::default();
        let placed = coverage.place(0, 0, 10).unwrap();
        assert_eq!((placed.gap, placed.skip), (None, 0));
        coverage.take(10);
        let placed = coverage.place(3, 25, 5).unwrap();
        assert_eq!((placed.gap, placed.skip), (Some((10, 25, Reason::Link)), 0));
        coverage.take(5);
        assert_eq!((coverage.next, coverage.accepted), (30, 15));
        assert!(balanced(&coverage));
    }

    #[test]
    fn a_node_that_joins_late_or_restores_a_state_has_lost_what_came_before() {
        let mut coverage = Coverage::default();
        assert_eq!(coverage.place(9, 100, 1).unwrap().gap, Some((0, 100, Reason::Down)));
        let mut coverage = Coverage::resumed(40, 30, [0, 10, 0, 0, 0, 0]);
        assert_eq!(coverage.place(9, 100, 1).unwrap().gap, Some((40, 100, Reason::Down)));
        assert!(balanced(&coverage));
    }

    #[test]
    fn a_message_that_the_state_covers_in_part_is_taken_from_there() {
        let mut coverage = Coverage::resumed(40, 40, [0; 6]);
        let placed = coverage.place(4, 35, 10).unwrap();
        assert_eq!((placed.gap, placed.skip), (None, 5));
        coverage.take(5);
        assert_eq!(coverage.next, 45);
    }

    #[test]
    fn what_the_queue_dropped_is_told_from_what_the_link_lost() {
        let mut numbers = Numbers::default();
        numbers.dropped(1);
        assert_eq!(numbers.arrived(1), Some((1, Reason::Queue)));
        numbers.dropped(2);
        assert_eq!(numbers.arrived(4), Some((2, Reason::Queue)));
        assert_eq!(numbers.arrived(7), Some((2, Reason::Link)));
        numbers.dropped(1);
        assert_eq!(numbers.arrived(10), Some((2, Reason::QueueOrLink)));
        assert_eq!(numbers.arrived(11), Some((0, Reason::Queue)));
    }

    #[test]
    fn what_was_sent_before_the_first_message_that_arrives_was_sent_while_the_node_was_down() {
        let mut numbers = Numbers::default();
        assert_eq!(numbers.arrived(3), Some((3, Reason::Down)));
        assert_eq!(numbers.arrived(4), Some((0, Reason::Queue)));
        assert_eq!(numbers.arrived(4), None);
    }

    #[test]
    fn late_and_repeated_messages_change_nothing_but_their_count() {
        let mut coverage = Coverage::default();
        coverage.place(0, 0, 10).unwrap();
        coverage.take(10);
        coverage.place(2, 20, 10).unwrap();
        coverage.take(10);
        let before = coverage.clone();
        assert_eq!(coverage.place(1, 10, 10), None);
        assert_eq!(coverage.place(2, 20, 10), None);
        assert_eq!(coverage, Coverage { late_messages: 2, ..before });
    }

    #[test]
    fn a_message_without_events_shows_what_was_lost_at_the_end() {
        let mut coverage = Coverage::default();
        coverage.place(0, 0, 10).unwrap();
        coverage.take(10);
        let placed = coverage.place(2, 30, 0).unwrap();
        assert_eq!(placed.gap, Some((10, 30, Reason::Link)));
        assert_eq!(coverage.place(3, 30, 0).unwrap().gap, None);
        assert_eq!(coverage.lose(0, Reason::Overload), (30, 30, Reason::Overload));
        assert!(balanced(&coverage));
    }
}
