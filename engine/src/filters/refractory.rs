//! The refractory filter: a pixel that has spoken is silent for a while.

use super::stamps::Stamps;
use super::{EventFilter, FilterCounters};
use crate::error::in_range;
use crate::{EngineError, Event, Network, Sensor};

/// Lets an event pass where the last event of its pixel that passed is at least a time away.
///
/// Dropped events do not prolong the silence. An event with an earlier stamp than the one that passed is as far away as
/// their difference says, and where it passes, it is the one that counts from then on: of two events of a pixel that pass
/// one after the other, the stamps always differ by the time at least. An event outside the sensor passes.
#[derive(Clone, Debug)]
pub struct Refractory {
    stamps: Stamps,
    us: u64,
    counters: FilterCounters,
}

impl Refractory {
    /// Silences a pixel for `us` microseconds; an event `us` after the last passes.
    ///
    /// # Errors
    /// [`EngineError::Option`] where `us` is below 1 or beyond the longest span, or where `sensor` has more than 2^26
    /// pixels, which is 1 GiB of stamps.
    pub fn new(sensor: Sensor, us: i64) -> Result<Self, EngineError> {
        in_range("refractory time in microseconds", us, 1, Network::LONGEST_SPAN_US)?;
        Ok(Self { stamps: Stamps::new(sensor)?, us: us.unsigned_abs(), counters: FilterCounters::default() })
    }
}

impl EventFilter for Refractory {
    fn admit(&mut self, event: Event) -> bool {
        let us = self.us;
        let passes = self.stamps.place(event.x, event.y).is_none_or(|place| {
            let passes = self.stamps.get(place).is_none_or(|stamp| event.t_us.abs_diff(stamp) >= us);
            if passes {
                self.stamps.set(place, event.t_us);
            }
            passes
        });
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.stamps.clear();
    }

    fn counters(&self) -> FilterCounters {
        self.counters
    }

    fn name(&self) -> &'static str {
        "refractory"
    }
}
