//! An endless stream with a full window: the same events round after round, each round later by the window's span and
//! one microsecond, so that an event leaves exactly when it comes again.
//!
//! Whatever is timed on it runs in a steady state: about as many nodes as a round has events, one expiry an event.

use meissner_engine::{Engine, Event};

use crate::streams::SPAN_US;

/// Events without end.
#[derive(Clone, Debug)]
pub struct Lap {
    events: Vec<Event>,
    next: usize,
    offset_us: i64,
}

impl Lap {
    /// Rounds of `events`, which must lie within the span.
    ///
    /// # Panics
    /// If there are none, or they last longer than the span.
    pub fn new(events: &[Event]) -> Self {
        let duration = events[events.len() - 1].t_us - events[0].t_us;
        assert!(duration <= SPAN_US, "a round of {duration} us does not fit the span");
        Self { events: events.to_vec(), next: 0, offset_us: 0 }
    }

    /// The next event.
    pub fn event(&mut self) -> Event {
        let event = self.events[self.next];
        let out = Event { t_us: event.t_us + self.offset_us, ..event };
        self.next += 1;
        if self.next == self.events.len() {
            self.next = 0;
            self.offset_us += SPAN_US + 1;
        }
        out
    }

    /// Pushes one round and a little more, so that `engine` is full; the events pushed.
    pub fn fill(&mut self, engine: &mut Engine) -> Vec<Event> {
        let pushed: Vec<Event> = (0..self.events.len() + 50).map(|_| self.event()).collect();
        engine.push_slice(&pushed);
        pushed
    }
}
