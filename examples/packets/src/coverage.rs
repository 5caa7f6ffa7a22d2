//! Tracks which events of a stream reached an engine, and what happened to the others.
//!
//! Input: the numbers of each packet, in order of arrival, and the number of packets that an input
//! queue dropped. Output: the part of each packet that the engine takes, and the gaps. Invariant:
//! `next = accepted + lost`, so that every event before `next` is in one of the two.
//!
//! A source numbers packets and events. A packet that does not begin at `next` proves that others
//! are missing. Packets that arrive later stay lost, because the engine takes events only in order.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The reason why an event did not reach the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The queue of the input was full.
    Queue,
    /// It was lost on the way, outside of this process.
    Link,
    /// Some were dropped by the queue and others lost on the way, or the transport cannot tell.
    QueueOrLink,
    /// It was sent before the process was connected, while the process was down, or after its saved
    /// state.
    Down,
    /// The engine's own queue was full.
    Overload,
    /// The packet could not be read.
    Malformed,
}

impl Reason {
    /// All reasons, in the order of their counts.
    pub const ALL: [Self; 6] =
        [Self::Queue, Self::Link, Self::QueueOrLink, Self::Down, Self::Overload, Self::Malformed];

    /// The name in messages, summaries and metrics.
    pub fn name(self) -> &'static str {
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

/// A number of packets, and of their events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lost {
    /// Packets.
    pub packets: u64,
    /// Events in them.
    pub events: u64,
}

/// Losses by [`Reason`], in its order.
pub type Losses = [Lost; Reason::ALL.len()];

/// Losses by the name of their reason, for summaries.
pub fn by_reason(losses: &Losses) -> BTreeMap<&'static str, Lost> {
    Reason::ALL.into_iter().map(Reason::name).zip(losses.iter().copied()).collect()
}

/// Events that no prediction covers, by their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap {
    /// Number of the first.
    pub from: u64,
    /// Number of the first event after them.
    pub until: u64,
    /// Number of packets that contained them.
    pub packets: u64,
    /// The reason.
    pub reason: Reason,
}

/// The packets of a stream by their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    /// Number of the next packet; `None` before the first.
    next: Option<u64>,
    /// Packets that the queue dropped and that no gap has shown yet.
    dropped: u64,
    /// Reasons for missing packets that the queue did not drop: before the first packet, and
    /// between two.
    reasons: [Reason; 2],
}

impl Default for Numbers {
    fn default() -> Self {
        Self::new(Reason::Link)
    }
}

impl Numbers {
    /// Packets from number 0 on; some get lost by `reason`.
    pub fn new(reason: Reason) -> Self {
        Self { next: None, dropped: 0, reasons: [Reason::Down, reason] }
    }

    /// Notes that the queue of the input dropped this number of packets.
    pub fn dropped(&mut self, packets: u64) {
        self.dropped += packets;
    }

    /// The packet of this number arrived: returns the number of missing packets before it, and the
    /// reason, unless it is late.
    pub fn arrived(&mut self, number: u64) -> Option<(u64, Reason)> {
        let missing = number.checked_sub(self.next.unwrap_or(0))?;
        let [before, between] = self.reasons;
        let reason = match self.next {
            _ if missing <= self.dropped => Reason::Queue,
            None => before,
            Some(_) if self.dropped == 0 => between,
            Some(_) => Reason::QueueOrLink,
        };
        self.next = Some(number.saturating_add(1));
        self.dropped = self.dropped.saturating_sub(missing);
        Some((missing, reason))
    }
}

/// The known data about the events of one stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Number of the next event.
    pub next: u64,
    /// Events that the engine took.
    pub accepted: u64,
    /// Events that the engine did not take.
    pub lost: Losses,
    /// Packets that came after their events had been counted as lost, or twice.
    pub late: u64,
    numbers: Numbers,
}

/// The decision about a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    /// The gap before it.
    pub gap: Option<Gap>,
    /// Number of events at its beginning that are not taken, because they are known already.
    pub skip: usize,
}

impl Coverage {
    /// A stream; some of its packets get lost by `reason`.
    pub fn new(reason: Reason) -> Self {
        Self { numbers: Numbers::new(reason), ..Self::default() }
    }

    /// The coverage of a state: nothing is known about later packets.
    pub fn resumed(next: u64, accepted: u64, lost: Losses) -> Self {
        Self { next, accepted, lost, ..Self::default() }
    }

    /// The same for a process that was connected before the stream began: its first packets may get
    /// lost too.
    #[must_use]
    pub fn connected(mut self) -> Self {
        self.numbers.reasons[0] = self.numbers.reasons[1];
        self
    }

    /// The stream is known from the packet of this number on.
    #[must_use]
    pub fn from_packet(mut self, number: u64) -> Self {
        self.numbers.next = Some(number);
        self
    }

    /// Number of the next packet; `None` before the first.
    pub fn next_packet(&self) -> Option<u64> {
        self.numbers.next
    }

    /// Notes that the queue of the input dropped this number of packets.
    pub fn dropped(&mut self, packets: u64) {
        self.numbers.dropped(packets);
    }

    /// Places the packet of this number, whose `len` events begin with `first` (`None`: events have
    /// no numbers). Its gap counts as lost; the caller [takes](Self::take) the events or
    /// [loses](Self::lose) them. `None` if nothing in it is new.
    pub fn place(&mut self, number: u64, first: Option<u64>, len: usize) -> Option<Placed> {
        // A state does not know which packets it covered.
        let is_known = self.next == 0 || self.next_packet().is_some();
        let (arrived, numbered) = (self.numbers.arrived(number), first.is_some());
        let first = first.unwrap_or(self.next);
        let end = first.saturating_add(len as u64);
        let is_new = if len == 0 { first >= self.next } else { end > self.next };
        let Some((packets, reason)) = arrived.filter(|_| is_new) else {
            self.late += 1;
            return None;
        };
        let packets = if is_known { packets } else { 0 };
        let is_missing = if numbered { first > self.next } else { packets > 0 };
        let gap = is_missing.then(|| self.lose_until(first, packets, reason));
        Some(Placed { gap, skip: self.next.saturating_sub(first) as usize })
    }

    /// The engine takes the next `events`.
    pub fn take(&mut self, events: usize) {
        self.next = self.next.saturating_add(events as u64);
        self.accepted = self.accepted.saturating_add(events as u64);
    }

    /// The engine does not take the next `events`, which are one packet.
    pub fn lose(&mut self, events: usize, reason: Reason) -> Gap {
        self.lose_until(self.next.saturating_add(events as u64), 1, reason)
    }

    /// Counts a packet without the numbers of its events.
    pub fn refuse(&mut self) {
        self.lost[Reason::Malformed as usize].packets += 1;
    }

    fn lose_until(&mut self, until: u64, packets: u64, reason: Reason) -> Gap {
        let until = until.max(self.next);
        let from = std::mem::replace(&mut self.next, until);
        let lost = &mut self.lost[reason as usize];
        lost.events = lost.events.saturating_add(until - from);
        lost.packets = lost.packets.saturating_add(packets);
        Gap { from, until, packets, reason }
    }

    /// Events that were lost, for any reason.
    pub fn lost_events(&self) -> u64 {
        self.lost.iter().map(|lost| lost.events).sum()
    }
}
