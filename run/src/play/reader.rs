//! Offers events to a queue: those of a recording when they are due, those of a stream when they
//! arrive.
//!
//! Input: a recording, or a stream. Output: events and clock advances into the queue. An event of a
//! recording whose time steps back is due together with the event before it. On a stream, only
//! events advance the clock, because the delay of the next event is unknown.

use std::sync::mpsc::Sender;
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::Event;
use meissner_engine::filters::{Chain, EventFilter};
use meissner_live::{Input, LiveError};

use crate::clock::Clock;
use crate::error::Result;
use crate::interrupt;

/// Longest sleep, unless packets are further apart: it makes the clock advance in a gap.
const NAP: Duration = Duration::from_millis(1);
/// Number of events that the filters process at once.
const HANDFUL: usize = 1024;

/// Repetitions of a recording, one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Laps {
    /// At least 1.
    pub(super) number: u32,
    /// Stream time from the beginning of one repetition to that of the next.
    pub(super) us: i128,
}

pub(super) struct Reader {
    pub(super) clock: Clock,
    pub(super) input: Input,
    /// Filter that always acts, before the queue.
    pub(super) chain: Chain,
    /// Shortest sleep: it makes events arrive in packets, as from a camera.
    pub(super) packet: Duration,
    /// Longest time from the due time of an event until it was offered.
    pub(super) lag: Duration,
    /// Events that were due, including events that filters dropped.
    pub(super) taken: u64,
    /// Destination for showing these events, if requested.
    pub(super) tap: Option<Sender<Vec<Event>>>,
}

impl Reader {
    /// Offers `events` in `laps`, and advances the clock to `end_us` at that time. Ends early if
    /// events are no longer taken, or if the program is asked to end.
    pub(super) fn read(mut self, events: &[Event], laps: Laps, end_us: i64) -> Result<Self, LiveError> {
        let mut laps_us =
            (0..laps.number).map(|lap| i64::try_from(i128::from(lap) * laps.us).unwrap_or(i64::MAX));
        let (mut rest, mut shift_us) = (&events[..0], 0);
        let mut kept = Vec::with_capacity(HANDFUL);
        while !self.input.is_closed() && !interrupt::requested() {
            let now = Instant::now();
            let now_us = self.clock.stream_us(now);
            loop {
                let due =
                    rest.iter().take_while(|event| event.t_us.saturating_add(shift_us) <= now_us).count();
                let (events_due, later) = rest.split_at(due);
                rest = later;
                for events in events_due.chunks(HANDFUL) {
                    kept.clear();
                    kept.extend(
                        events
                            .iter()
                            .map(|&event| Event { t_us: event.t_us.saturating_add(shift_us), ..event }),
                    );
                    self.take(&kept, now);
                    kept.retain(|&event| self.chain.admit(event));
                    self.input.push_slice(&kept)?;
                }
                if !rest.is_empty() {
                    break;
                }
                let Some(lap_us) = laps_us.next() else { break };
                (rest, shift_us) = (events, lap_us);
            }
            // Later events have a later time, or are already late.
            self.input.advance(now_us.min(end_us));
            if rest.is_empty() && now_us >= end_us {
                break;
            }
            let next = rest.first().map_or(end_us, |event| event.t_us.saturating_add(shift_us));
            let nap = self.clock.at(next).saturating_duration_since(Instant::now());
            thread::sleep(nap.clamp(self.packet, NAP.max(self.packet)));
        }
        Ok(self)
    }

    /// Offers `events` as they arrive, until their end, a closed queue or a request to end.
    pub(super) fn follow(mut self, events: &mut dyn Iterator<Item = Result<Event>>) -> Result<Self> {
        while !self.input.is_closed()
            && let Some(event) = events.next().transpose()?
        {
            self.take(&[event], Instant::now());
            if self.chain.admit(event) {
                self.input.push_slice(&[event])?;
            }
        }
        Ok(self)
    }

    /// Counts `events`, which are offered at `now`.
    fn take(&mut self, events: &[Event], now: Instant) {
        self.taken += events.len() as u64;
        if let Some(tap) = &self.tap {
            // After the last report, no receiver is left.
            let _ = tap.send(events.to_vec());
        }
        if let Some(event) = events.first() {
            self.lag = self.lag.max(now.saturating_duration_since(self.clock.at(event.t_us)));
        }
    }
}
