//! Filters in front of an engine: they decide which events enter.
//!
//! Input: events, one at a time. Output: whether each passes. A filter takes O(1) for an event and
//! allocates nothing later. It does not know window or admission: it also sees late events and
//! events outside the sensor, which the engine counts.
//!
//! | filter | passes | source |
//! |---|---|---|
//! | [`Stride`] | every nth event | |
//! | [`RateLimit`] | as many events as a rate allows | token bucket (the mirror of Turner 1986) |
//! | [`BackgroundActivity`] | events with a recent neighbour | Delbruck 2008 |
//! | [`Refractory`] | at most one event of a pixel in a time | the refractory filter of jAER |
//! | [`HotPixel`] | what is no pixel that fires all the time | leaky bucket (ITU-T I.371) |
//!
//! A network states the filters that it needs as [`FilterRule`]s; engines apply them.
//!
//! Times are compared by the magnitude of their difference as u64, which cannot overflow; the
//! earliest time that 64 bits can hold is remembered as the one after it. Each filter documents how
//! it treats an event that is earlier than a previous one.

/// The name and the counters of a filter with a field `counters`.
macro_rules! reports {
    ($name:literal) => {
        fn counters(&self) -> $crate::filters::FilterCounters {
            self.counters
        }

        fn name(&self) -> &'static str {
            $name
        }
    };
}

mod hot_pixel;
mod rule;

use crate::error::in_range;
use crate::{EngineError, Event, Sensor};

pub use hot_pixel::HotPixel;
pub use rule::FilterRule;

/// Decides, event by event, which events pass.
pub trait EventFilter {
    /// Whether `event`, the next one, passes.
    fn admit(&mut self, event: Event) -> bool;
    /// Forgets all events; counts continue.
    fn reset(&mut self);
    /// Counts since the filter was made.
    fn counters(&self) -> FilterCounters;
    /// A short name, as in the program's reports.
    fn name(&self) -> &'static str;
}

/// Numbers of events that passed and that were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterCounters {
    /// Events that passed.
    pub passed: u64,
    /// Events that were dropped.
    pub dropped: u64,
}

impl FilterCounters {
    /// Counts an event, and returns whether it passed.
    fn count(&mut self, passed: bool) -> bool {
        self.passed += u64::from(passed);
        self.dropped += u64::from(!passed);
        passed
    }
}

/// Passes the first of every `n` events, whatever their times and pixels.
#[derive(Clone, Debug)]
pub struct Stride {
    n: u32,
    /// Events since the last one that passed, modulo n.
    since: u32,
    counters: FilterCounters,
}

impl Stride {
    /// Passes the first, the (n + 1)th, the (2 n + 1)th, ... event.
    ///
    /// # Errors
    /// [`EngineError::Option`] if `n` is 0.
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

    reports!("stride");
}

/// A token bucket: thins events evenly if they come faster than a rate.
///
/// ```text
/// credit <- min(credit + rate (t - newest), depth),  newest <- t      if t > newest
/// an event passes if credit >= 1, and takes 1 off it;
/// depth = max(rate 1 ms, 1), full at the start
/// ```
///
/// Credit counts in millionths of an event, so a microsecond adds `rate`, an integer. In any T
/// microseconds at most `rate` T / 10^6 + `depth` events pass; if no interval contains more, all
/// events pass. In a steady faster stream, events pass at even distances once the depth is used.
///
/// An event earlier than the newest adds no credit, and passes if credit is left: the bound holds
/// over the newest times. After a restart of the clock, [`reset`](EventFilter::reset) the filter.
#[derive(Clone, Debug)]
pub struct RateLimit {
    events_per_s: u64,
    credit: u64,
    depth: u64,
    newest_us: Option<i64>,
    counters: FilterCounters,
}

/// Credit that an event takes.
const EVENT: u64 = 1_000_000;

impl RateLimit {
    /// Microseconds of stream time that the bucket holds: the longest burst that is not thinned.
    pub const DEPTH_US: u64 = 1_000;
    /// Highest rate, in events per second.
    pub const HIGHEST: u64 = 1_000_000_000_000;

    /// Passes `events_per_s` events a second.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a rate of 0 or above [`Self::HIGHEST`].
    pub fn new(events_per_s: u64) -> Result<Self, EngineError> {
        let rate = i64::try_from(events_per_s).unwrap_or(i64::MAX);
        in_range("rate limit in events per second", rate, 1, Self::HIGHEST as i64)?;
        let depth = (events_per_s * Self::DEPTH_US).max(EVENT);
        Ok(Self { events_per_s, credit: depth, depth, newest_us: None, counters: FilterCounters::default() })
    }
}

impl EventFilter for RateLimit {
    fn admit(&mut self, event: Event) -> bool {
        let newest = self.newest_us.unwrap_or(event.t_us);
        if event.t_us > newest {
            let earned = event.t_us.abs_diff(newest).saturating_mul(self.events_per_s);
            self.credit = self.credit.saturating_add(earned).min(self.depth);
        }
        self.newest_us = Some(newest.max(event.t_us));
        let passes = self.credit >= EVENT;
        if passes {
            self.credit -= EVENT;
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.credit = self.depth;
        self.newest_us = None;
    }

    reports!("rate_limit");
}

/// Longest time of a filter in microseconds: that of a network's span.
pub(crate) const MAX_US: i64 = 1 << 40;
/// Pixels of the largest sensor: 512 MiB of stamps.
const MAX_PIXELS: i64 = 1 << 26;

/// Passes an event if the latest event of one of its eight neighbours is at most a given time away.
///
/// Every event, passed or dropped, supports its eight neighbours, not its own pixel. A pixel's
/// latest event is the one that arrived last; only the distance in time counts. Timestamps slightly
/// out of order thus support each other, and a clock that jumped back silences no pixel. An event
/// outside the sensor passes and is not remembered.
#[derive(Clone, Debug)]
pub struct BackgroundActivity {
    stamps: Stamps,
    counters: FilterCounters,
}

impl BackgroundActivity {
    /// Microseconds in which a neighbour supports an event: the value of the contact-angle paper.
    pub const DEFAULT_US: i64 = 1_250;

    /// Requires a neighbour within `us` microseconds.
    ///
    /// # Errors
    /// [`EngineError::Option`] if `us` is below 1 or above the longest span, or `sensor` has more
    /// than 2^26 pixels (512 MiB of stamps).
    pub fn new(sensor: Sensor, us: i64) -> Result<Self, EngineError> {
        let stamps = Stamps::new(sensor, us, "time of the activity filter in microseconds")?;
        Ok(Self { stamps, counters: FilterCounters::default() })
    }

    /// Whether `event` would pass.
    fn passes(&self, event: Event) -> bool {
        let t = stamp(event.t_us);
        let near = |stamp| stamp != NEVER && t.abs_diff(stamp) <= self.stamps.us;
        self.stamps.place(event).is_none_or(|place| self.stamps.any_around(place, near))
    }
}

impl EventFilter for BackgroundActivity {
    fn admit(&mut self, event: Event) -> bool {
        let passes = self.passes(event);
        if let Some(place) = self.stamps.place(event) {
            self.stamps.set(place, stamp(event.t_us));
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.stamps.times.fill(NEVER);
    }

    reports!("activity_filter");
}

/// Passes an event if the last passed event of its pixel is at least a given time away.
///
/// Dropped events do not prolong the pause. Only the distance in time counts: an earlier timestamp
/// passes if it is far enough from the last passed one, and replaces it. Two consecutive passed
/// events of a pixel are thus at least that time apart. An event outside the sensor passes.
#[derive(Clone, Debug)]
pub struct Refractory {
    stamps: Stamps,
    counters: FilterCounters,
}

impl Refractory {
    /// Silences a pixel for `us` microseconds after each event; an event exactly `us` later passes.
    ///
    /// # Errors
    /// As [`BackgroundActivity::new`].
    pub fn new(sensor: Sensor, us: i64) -> Result<Self, EngineError> {
        let stamps = Stamps::new(sensor, us, "refractory time in microseconds")?;
        Ok(Self { stamps, counters: FilterCounters::default() })
    }

    /// Whether `event` would pass.
    fn passes(&self, event: Event) -> bool {
        let t = stamp(event.t_us);
        let rested = |stamp| stamp == NEVER || t.abs_diff(stamp) >= self.stamps.us;
        self.stamps.place(event).is_none_or(|place| rested(self.stamps.times[place]))
    }
}

impl EventFilter for Refractory {
    fn admit(&mut self, event: Event) -> bool {
        let passes = self.passes(event);
        if let Some(place) = self.stamps.place(event).filter(|_| passes) {
            self.stamps.set(place, stamp(event.t_us));
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.stamps.times.fill(NEVER);
    }

    reports!("refractory");
}

/// Stamp of a time: microseconds since the earliest that 64 bits can hold.
#[inline]
fn stamp(t_us: i64) -> u64 {
    t_us.abs_diff(i64::MIN)
}

/// Stamp of a pixel that has none. Zeros, so that the memory of pixels without events is never
/// touched.
const NEVER: u64 = 0;

/// The last stamp of each pixel, with a border so that every pixel has eight neighbours.
#[derive(Clone, Debug)]
struct Stamps {
    sensor: Sensor,
    us: u64,
    stride: usize,
    times: Vec<u64>,
}

impl Stamps {
    /// An empty set of stamps; `what` is the name of the time `us` in an error.
    fn new(sensor: Sensor, us: i64, what: &'static str) -> Result<Self, EngineError> {
        in_range(what, us, 1, MAX_US)?;
        let pixels = i64::from(sensor.width) * i64::from(sensor.height);
        in_range("pixels of a filter's sensor", pixels, 0, MAX_PIXELS)?;
        let stride = usize::from(sensor.width) + 2;
        let times = vec![NEVER; Self::places(sensor)];
        Ok(Self { sensor, us: us.unsigned_abs(), stride, times })
    }

    /// Index of the event's pixel; `None` outside the sensor.
    #[inline]
    fn place(&self, Event { x, y, .. }: Event) -> Option<usize> {
        let inside = self.sensor.contains(x, y);
        inside.then(|| (usize::from(y) + 1) * self.stride + usize::from(x) + 1)
    }

    /// Whether `holds` is true of the stamp of one of the eight pixels around `place`.
    #[inline]
    fn any_around(&self, place: usize, holds: impl Fn(u64) -> bool) -> bool {
        let row = |at: usize| &self.times[at - 1..=at + 1];
        let mut any = false;
        // No branch for each neighbour: a processor cannot predict which one has a recent stamp.
        for &stamp in row(place - self.stride).iter().chain(row(place + self.stride)) {
            any |= holds(stamp);
        }
        any || holds(self.times[place - 1]) || holds(self.times[place + 1])
    }

    /// Stamps the pixel at `place`; the stamp is not [`NEVER`].
    #[inline]
    fn set(&mut self, place: usize, stamp: u64) {
        self.times[place] = stamp.max(NEVER + 1);
    }
}

/// A filter of any kind.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Every nth event.
    Stride(Stride),
    /// At most the number of events that a rate allows.
    RateLimit(RateLimit),
    /// Events with a recent neighbour.
    BackgroundActivity(BackgroundActivity),
    /// At most one event per pixel in a given time.
    Refractory(Refractory),
    /// No events of pixels that fire all the time.
    HotPixel(HotPixel),
}

/// Evaluates an expression for the filter inside a [`Filter`].
macro_rules! inner {
    ($any:ident, $filter:ident => $value:expr) => {
        match $any {
            Filter::Stride($filter) => $value,
            Filter::RateLimit($filter) => $value,
            Filter::BackgroundActivity($filter) => $value,
            Filter::Refractory($filter) => $value,
            Filter::HotPixel($filter) => $value,
        }
    };
}

impl EventFilter for Filter {
    fn admit(&mut self, event: Event) -> bool {
        inner!(self, filter => filter.admit(event))
    }

    fn reset(&mut self) {
        inner!(self, filter => filter.reset());
    }

    fn counters(&self) -> FilterCounters {
        inner!(self, filter => filter.counters())
    }

    fn name(&self) -> &'static str {
        inner!(self, filter => filter.name())
    }
}

/// Filters in series: each sees the events that the filters before it passed. An empty chain passes
/// everything.
#[derive(Clone, Debug, Default)]
pub struct Chain {
    filters: Vec<Filter>,
    counters: FilterCounters,
}

impl Chain {
    /// A chain of `filters`; the first sees every event.
    pub fn new(filters: Vec<Filter>) -> Self {
        Self { filters, counters: FilterCounters::default() }
    }

    /// Whether there is no filter.
    pub fn is_empty(&self) -> bool {
        self.filters.is_empty()
    }

    /// The filters, in order.
    pub fn filters(&self) -> &[Filter] {
        &self.filters
    }
}

impl EventFilter for Chain {
    fn admit(&mut self, event: Event) -> bool {
        let passes = self.filters.iter_mut().all(|filter| filter.admit(event));
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.filters.iter_mut().for_each(Filter::reset);
    }

    reports!("chain");
}
