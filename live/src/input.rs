//! The handle for the thread that reads the sensor.

use std::sync::Arc;

use meissner_engine::Event;
use meissner_engine::filters::{Chain, EventFilter};

use crate::intake::Item;
use crate::shared::Shared;
use crate::{LiveError, QueueCounters};

/// Events processed under one lock; small, so that no thread waits long for the lock.
const CHUNK: usize = 512;

/// Offers events or frames to the queue; for the single thread that reads the sensor.
#[derive(Debug)]
pub struct Input<T = Event> {
    shared: Arc<Shared<T>>,
    /// The filters of `Overload::Filter`; they run in this thread, outside the lock.
    filters: Option<Chain>,
    passes: Vec<bool>,
}

impl<T: Item> Input<T> {
    pub(crate) fn new(shared: Arc<Shared<T>>, filters: Option<Chain>) -> Self {
        Self { shared, filters, passes: Vec::with_capacity(CHUNK) }
    }

    /// Offers `events` in order of arrival: each event enters the queue, or is dropped and counted.
    /// Allocates nothing for events; frames are copied.
    ///
    /// Under [`Overload::Block`](crate::Overload::Block), waits while the queue is full, until half
    /// of it is free; otherwise never.
    ///
    /// # Errors
    /// [`LiveError::Closed`] if the worker has ended; the remaining events are not counted.
    pub fn push_slice(&mut self, events: &[T]) -> Result<(), LiveError> {
        let mut taken = 0;
        for chunk in events.chunks(CHUNK) {
            self.passes.clear();
            if let Some(filters) = &mut self.filters {
                self.passes
                    .extend(chunk.iter().map(|item| item.event().is_none_or(|event| filters.admit(event))));
            }
            let decided = self.shared.offer(chunk, &self.passes);
            taken += decided;
            if decided < chunk.len() {
                return Err(LiveError::Closed { offered: events.len(), taken });
            }
        }
        Ok(())
    }

    /// Advances the clock to `t_us` after the events offered so far: earlier events would be late
    /// from now on. The next prediction of these events is for the window at that time.
    pub fn advance(&mut self, t_us: i64) {
        self.shared.advance(t_us);
    }

    /// Whether the worker has ended or is about to; offered events would not be accepted.
    pub fn is_closed(&self) -> bool {
        self.shared.lock().is_closed()
    }

    /// Counts of offered events.
    pub fn counters(&self) -> QueueCounters {
        *self.shared.lock().intake.counters()
    }
}
