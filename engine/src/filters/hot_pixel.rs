//! Mutes pixels that fire all the time.

use super::{EventFilter, FilterCounters, NEVER, Stamps, stamp};
use crate::error::in_range;
use crate::{EngineError, Event, Sensor};

/// Mutes a pixel that fires more often than any visible object causes, until it calms down.
///
/// A pixel has a debt. Each of its events, passed or dropped, adds a period, and time reduces the
/// debt:
///
/// ```text
/// debt <- max(debt - (t - last), 0) + period,  last <- t
/// an event passes if debt <= burst period
/// debt <- min(debt, 2 burst period)
/// ```
///
/// This is a leaky bucket as a meter (ITU-T I.371, as a virtual schedule), in which dropped events
/// count as well. In any stream of a pixel, at most `burst` + T / `period` events pass in T
/// microseconds. A pixel that fires steadily at less than one event in a period passes. A pixel
/// that fires faster is muted after its first `burst` events, and stays muted as long as it fires
/// faster. Twice `burst` periods after its last event, it is as if it had never fired.
///
/// An event earlier than the last of its pixel also adds the time between them to the debt; after a
/// clock jumped back, the debt is at most the largest debt. No debt extends beyond the last time
/// that 64 bits can hold. An event outside the sensor passes.
#[derive(Clone, Debug)]
pub struct HotPixel {
    /// Stamp at which each pixel will have no debt. `us` is the period.
    pub(super) calm: Stamps,
    burst_us: u64,
    counters: FilterCounters,
}

impl HotPixel {
    /// Maximum number of events of a burst.
    pub const MAX_BURST: i64 = 1 << 16;

    /// Lets a pixel fire once in `period_us` microseconds, and `burst` times at once.
    ///
    /// # Errors
    /// As [`BackgroundActivity::new`](super::BackgroundActivity::new) for `period_us` and `sensor`;
    /// [`EngineError::Option`] if `burst` is below 1 or above [`Self::MAX_BURST`].
    pub fn new(sensor: Sensor, period_us: i64, burst: u32) -> Result<Self, EngineError> {
        in_range("burst of the hot-pixel filter in events", burst.into(), 1, Self::MAX_BURST)?;
        let calm = Stamps::new(sensor, period_us, "period of the hot-pixel filter in microseconds")?;
        Ok(Self {
            calm,
            burst_us: u64::from(burst) * period_us.unsigned_abs(),
            counters: FilterCounters::default(),
        })
    }

    /// Stamp at which the pixel at `place` will be calm after an event at `t`.
    #[inline]
    fn calm_after(&self, place: usize, t: u64) -> u64 {
        // A pixel that never fired is calm at all times.
        self.calm.times[place].max(t).saturating_add(self.calm.us)
    }

    /// Whether an event at `t` passes if its pixel will be calm at `calm`, not earlier.
    #[inline]
    fn is_within(&self, t: u64, calm: u64) -> bool {
        calm - t <= self.burst_us
    }

    /// Whether `event` would pass.
    pub(super) fn passes(&self, event: Event) -> bool {
        let t = stamp(event.t_us);
        self.calm.place(event).is_none_or(|place| self.is_within(t, self.calm_after(place, t)))
    }
}

impl EventFilter for HotPixel {
    fn admit(&mut self, event: Event) -> bool {
        let t = stamp(event.t_us);
        let passes = self.calm.place(event).is_none_or(|place| {
            let calm = self.calm_after(place, t);
            self.calm.set(place, calm.min(t.saturating_add(2 * self.burst_us)));
            self.is_within(t, calm)
        });
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.calm.times.fill(NEVER);
    }

    reports!("hot_pixel");
}
