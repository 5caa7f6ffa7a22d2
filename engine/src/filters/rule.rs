//! The filter rules of a network, as data; the filters of these rules on a sensor, and the filters'
//! state.

use super::{BackgroundActivity, Chain, EventFilter, Filter, HotPixel, NEVER, Refractory, Stamps, stamp};
use crate::fingerprint::Fingerprint;
use crate::{EngineError, Event, Sensor};

/// A filter that a network needs before it, as a part of the preparation of its input. Its
/// decisions depend only on the events of a pixel and its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilterRule {
    /// [`BackgroundActivity`] with this support time.
    BackgroundActivity {
        /// Microseconds in which a neighbour supports an event.
        us: i64,
    },
    /// [`Refractory`] with this time.
    Refractory {
        /// Microseconds of silence after an event.
        us: i64,
    },
    /// [`HotPixel`] with this period and burst.
    HotPixel {
        /// Microseconds in which a pixel may fire once, without limit of time.
        period_us: i64,
        /// Events that a pixel may send at once.
        burst: u32,
    },
}

impl FilterRule {
    /// The filter on `sensor`.
    ///
    /// # Errors
    /// As `new` of the filter.
    pub fn filter(self, sensor: Sensor) -> Result<Filter, EngineError> {
        Ok(match self {
            Self::BackgroundActivity { us } => {
                Filter::BackgroundActivity(BackgroundActivity::new(sensor, us)?)
            }
            Self::Refractory { us } => Filter::Refractory(Refractory::new(sensor, us)?),
            Self::HotPixel { period_us, burst } => Filter::HotPixel(HotPixel::new(sensor, period_us, burst)?),
        })
    }

    /// Bytes of the filter on `sensor`.
    pub(crate) fn bytes(sensor: Sensor) -> u128 {
        size_of::<Filter>() as u128 + Stamps::places(sensor) as u128 * size_of::<u64>() as u128
    }

    pub(crate) fn fingerprint(self, to: &mut Fingerprint) {
        let words = match self {
            Self::BackgroundActivity { us } => [0, us, 0],
            Self::Refractory { us } => [1, us, 0],
            Self::HotPixel { period_us, burst } => [2, period_us, burst.into()],
        };
        words.into_iter().for_each(|word| to.word(word as u64));
    }
}

impl Filter {
    /// Whether `event`, the next one, would pass.
    fn passes(&self, event: Event) -> bool {
        match self {
            Self::BackgroundActivity(filter) => filter.passes(event),
            Self::Refractory(filter) => filter.passes(event),
            Self::HotPixel(filter) => filter.passes(event),
            // No rule creates these filters.
            Self::Stride(_) | Self::RateLimit(_) => true,
        }
    }

    fn stamps(&self) -> Option<&Stamps> {
        match self {
            Self::BackgroundActivity(filter) => Some(&filter.stamps),
            Self::Refractory(filter) => Some(&filter.stamps),
            Self::HotPixel(filter) => Some(&filter.calm),
            Self::Stride(_) | Self::RateLimit(_) => None,
        }
    }

    fn stamps_mut(&mut self) -> Option<&mut Stamps> {
        match self {
            Self::BackgroundActivity(filter) => Some(&mut filter.stamps),
            Self::Refractory(filter) => Some(&mut filter.stamps),
            Self::HotPixel(filter) => Some(&mut filter.calm),
            Self::Stride(_) | Self::RateLimit(_) => None,
        }
    }
}

impl Chain {
    /// The filters of `rules` on `sensor`.
    ///
    /// # Errors
    /// As [`FilterRule::filter`].
    pub fn of_rules(rules: &[FilterRule], sensor: Sensor) -> Result<Self, EngineError> {
        Ok(Self::new(rules.iter().map(|rule| rule.filter(sensor)).collect::<Result<_, _>>()?))
    }

    /// Whether `event`, the next one, would pass, in a chain created from rules.
    #[inline]
    pub(crate) fn passes(&self, event: Event) -> bool {
        self.filters.iter().all(|filter| filter.passes(event))
    }

    /// The state of each filter of a chain created from rules: the column, the row and the time
    /// (us) of each pixel that can still decide about an event at `now_us` or later, row by row.
    /// Counts are left out.
    pub fn remembered(&self, now_us: i64) -> Vec<Vec<(u16, u16, i64)>> {
        let of = |filter: &Filter| filter.stamps().map_or_else(Vec::new, |stamps| stamps.since(now_us));
        self.filters.iter().map(of).collect()
    }

    /// Forgets all events and takes over the state that the filters of an equal chain
    /// [remembered](Self::remembered). Returns `false` and changes nothing if the number of filters
    /// differs, or pixels are outside the sensor.
    #[must_use]
    pub fn remember(&mut self, remembered: &[Vec<(u16, u16, i64)>]) -> bool {
        let Some(&Stamps { sensor, .. }) = self.filters.iter().find_map(Filter::stamps) else {
            return remembered.len() == self.filters.len() && remembered.iter().all(Vec::is_empty);
        };
        let inside = remembered.iter().flatten().all(|&(x, y, _)| sensor.contains(x, y));
        if remembered.len() != self.filters.len() || !inside {
            return false;
        }
        self.reset();
        for (stamps, pixels) in self.filters.iter_mut().filter_map(Filter::stamps_mut).zip(remembered) {
            for &(x, y, t_us) in pixels {
                let place = stamps.place(Event::new(t_us, x, y, true));
                place.into_iter().for_each(|place| stamps.set(place, stamp(t_us)));
            }
        }
        true
    }
}

impl Stamps {
    /// Number of pixels, including the border.
    pub(super) fn places(sensor: Sensor) -> usize {
        (usize::from(sensor.width) + 2).saturating_mul(usize::from(sensor.height) + 2)
    }

    /// The pixels whose stamp is less than a filter's time before `now_us`, or after it.
    fn since(&self, now_us: i64) -> Vec<(u16, u16, i64)> {
        let first = stamp(now_us).saturating_sub(self.us).max(NEVER + 1);
        let pixel = |(place, &stamp): (usize, &u64)| {
            let [x, y] = [place % self.stride, place / self.stride].map(|at| (at - 1) as u16);
            (x, y, i64::MIN.wrapping_add_unsigned(stamp))
        };
        self.times.iter().enumerate().filter(|&(_, &stamp)| stamp >= first).map(pixel).collect()
    }
}
