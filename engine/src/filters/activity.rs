//! The background-activity filter (Delbruck 2008): events of a scene have neighbours, noise has none.

use super::stamps::Stamps;
use super::{EventFilter, FilterCounters};
use crate::error::in_range;
use crate::{EngineError, Event, Network, Sensor};

/// Lets an event pass where the latest event of one of the eight pixels around it is within a time of it.
///
/// Every event counts as a neighbour for those behind it, whether it passed or not; those of its own pixel do not.
/// The latest event of a pixel is the one that arrived last. Where it has a later stamp than the event that asks, it
/// counts if the two are as near, so that stamps a little out of order support each other, and a clock that jumped back
/// does not silence the sensor. An event outside the sensor passes and is not remembered.
#[derive(Clone, Debug)]
pub struct BackgroundActivity {
    stamps: Stamps,
    us: u64,
    counters: FilterCounters,
}

impl BackgroundActivity {
    /// Time in which a neighbour supports an event, in microseconds: that of the contact-angle paper.
    pub const DEFAULT_US: i64 = 1_250;

    /// Asks for a neighbour within `us` microseconds.
    ///
    /// # Errors
    /// [`EngineError::Option`] where `us` is below 1 or beyond the longest span, or where `sensor` has more than 2^26
    /// pixels, which is 1 GiB of stamps.
    pub fn new(sensor: Sensor, us: i64) -> Result<Self, EngineError> {
        in_range("time of the activity filter in microseconds", us, 1, Network::LONGEST_SPAN_US)?;
        Ok(Self { stamps: Stamps::new(sensor)?, us: us.unsigned_abs(), counters: FilterCounters::default() })
    }
}

impl EventFilter for BackgroundActivity {
    fn admit(&mut self, event: Event) -> bool {
        let us = self.us;
        let passes = self.stamps.place(event.x, event.y).is_none_or(|place| {
            self.stamps.set(place, event.t_us);
            self.stamps.any_around(place, |stamp| event.t_us.abs_diff(stamp) <= us)
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
        "activity_filter"
    }
}
