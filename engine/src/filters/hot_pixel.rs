//! Mutes pixels that fire all the time.

use super::{EventFilter, FilterCounters, Stamps};
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
    /// Time at which each pixel will have no debt. `us` is the period.
    pub(super) calm: Stamps,
    burst_us: i64,
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
        Ok(Self { calm, burst_us: i64::from(burst) * period_us, counters: FilterCounters::default() })
    }

    /// Time at which the pixel at `place` will be calm after an event at `t_us`.
    #[inline]
    fn calm_after(&self, place: usize, t_us: i64) -> i64 {
        self.calm.times[place].map_or(t_us, |calm| calm.max(t_us)).saturating_add_unsigned(self.calm.us)
    }

    /// Whether an event at `t_us` passes if its pixel will be calm at `calm_us`.
    #[inline]
    fn is_within(&self, t_us: i64, calm_us: i64) -> bool {
        // The difference is at least 0.
        calm_us.abs_diff(t_us) <= self.burst_us.unsigned_abs()
    }

    /// Whether `event` would pass.
    pub(super) fn passes(&self, event: Event) -> bool {
        let place = self.calm.place(event);
        place.is_none_or(|place| self.is_within(event.t_us, self.calm_after(place, event.t_us)))
    }
}

impl EventFilter for HotPixel {
    fn admit(&mut self, event: Event) -> bool {
        let passes = self.calm.place(event).is_none_or(|place| {
            let calm_us = self.calm_after(place, event.t_us);
            let most_us = event.t_us.saturating_add(2 * self.burst_us);
            self.calm.times[place] = Some(calm_us.min(most_us));
            self.is_within(event.t_us, calm_us)
        });
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.calm.times.fill(None);
    }

    reports!("hot_pixel");
}
