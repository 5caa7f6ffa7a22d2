//! A processor in simulated time: an engine behind a bounded queue, which takes so many events in a millisecond and no more.
//!
//! Enters: events, milliseconds. Leaves: the prediction for the events that were taken. It is what [`meissner::live`] does on a processor
//! of that speed when the oldest events make room, without clocks and threads: equal input gives equal bits.

use std::collections::VecDeque;

use meissner::{Engine, EngineError, Event};

/// An engine on a processor of some speed.
#[derive(Clone, Debug)]
pub struct Processor {
    engine: Engine,
    queue: VecDeque<Event>,
    capacity: usize,
    rate: usize,
    dropped: u64,
}

impl Processor {
    /// `engine` on a processor that takes `rate` events in a millisecond, behind a queue for `capacity` events.
    pub fn new(engine: Engine, rate: usize, capacity: usize) -> Self {
        Self { engine, queue: VecDeque::new(), capacity, rate, dropped: 0 }
    }

    /// A millisecond, at whose end the time is `now_us` and which has brought `events`.
    pub fn tick(&mut self, now_us: i64, events: &[Event]) {
        self.queue.extend(events);
        let taken = self.queue.len().min(self.rate);
        self.queue.drain(..taken).for_each(|event| {
            self.engine.push(event);
        });
        let over = self.queue.len().saturating_sub(self.capacity);
        self.queue.drain(..over);
        self.dropped += over as u64;
        if self.queue.is_empty() {
            self.engine.advance(now_us);
        }
    }

    /// The prediction for the events that were taken.
    ///
    /// # Errors
    /// As [`Engine::predict`].
    pub fn predict(&mut self) -> Result<&[f32], EngineError> {
        Ok(self.engine.predict()?.values)
    }

    /// Events that wait.
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// Events that were dropped to make room.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
