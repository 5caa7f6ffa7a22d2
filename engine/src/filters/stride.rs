//! Every nth event.

use super::{EventFilter, FilterCounters};
use crate::error::in_range;
use crate::{EngineError, Event};

/// Lets the first of every `n` events pass, whatever their times and pixels.
#[derive(Clone, Debug)]
pub struct Stride {
    n: u32,
    /// Events since the last one that passed, modulo n.
    since: u32,
    counters: FilterCounters,
}

impl Stride {
    /// Lets the first, the (n + 1)th, the (2 n + 1)th, ... event pass.
    ///
    /// # Errors
    /// [`EngineError::Option`] where `n` is 0.
    pub fn new(n: u32) -> Result<Self, EngineError> {
        in_range("stride in events", i64::from(n), 1, i64::from(u32::MAX))?;
        Ok(Self { n, since: 0, counters: FilterCounters::default() })
    }
}

impl EventFilter for Stride {
    fn admit(&mut self, _: Event) -> bool {
        let passes = self.since == 0;
        self.since += 1;
        if self.since == self.n {
            self.since = 0;
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.since = 0;
    }

    fn counters(&self) -> FilterCounters {
        self.counters
    }

    fn name(&self) -> &'static str {
        "stride"
    }
}
