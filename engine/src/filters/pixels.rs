//! Filters that compare an event with earlier events of its own pixel or of the pixels around it.

use super::{EventFilter, FilterCounters, reports};
use crate::error::in_range;
use crate::{EngineError, Event, Network, Sensor};

/// Pixels of the largest sensor: 1 GiB of stamps.
const MAX_PIXELS: i64 = 1 << 26;

/// Passes an event if the latest event of one of its eight neighbours is at most a given time away.
///
/// Every event, passed or dropped, supports its eight neighbours, not its own pixel. A pixel's
/// latest event is the one that arrived last; only the distance in time counts. Stamps slightly out
/// of order thus support each other, and a clock that jumped back silences nothing. An event
/// outside the sensor passes and is not remembered.
#[derive(Clone, Debug)]
pub struct BackgroundActivity {
    stamps: Stamps,
    counters: FilterCounters,
}

impl BackgroundActivity {
    /// Microseconds in which a neighbour supports an event: the contact-angle paper's.
    pub const DEFAULT_US: i64 = 1_250;

    /// Requires a neighbour within `us` microseconds.
    ///
    /// # Errors
    /// [`EngineError::Option`] if `us` is below 1 or above the longest span, or `sensor` has more
    /// than 2^26 pixels (1 GiB of stamps).
    pub fn new(sensor: Sensor, us: i64) -> Result<Self, EngineError> {
        let stamps = Stamps::new(sensor, us, "time of the activity filter in microseconds")?;
        Ok(Self { stamps, counters: FilterCounters::default() })
    }
}

impl EventFilter for BackgroundActivity {
    fn admit(&mut self, event: Event) -> bool {
        let us = self.stamps.us;
        let passes = self.stamps.place(event).is_none_or(|place| {
            self.stamps.times[place] = Some(event.t_us);
            self.stamps.any_around(place, |stamp| event.t_us.abs_diff(stamp) <= us)
        });
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.stamps.times.fill(None);
    }

    reports!("activity_filter");
}

/// Passes an event if the last passed event of its pixel is at least a given time away.
///
/// Dropped events do not prolong the pause. Only the distance in time counts: an earlier stamp
/// passes if it is far enough from the last passed one, and replaces it. Two events of a pixel that
/// pass in a row are thus at least that time apart. An event outside the sensor passes.
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
}

impl EventFilter for Refractory {
    fn admit(&mut self, event: Event) -> bool {
        let us = self.stamps.us;
        let passes = self.stamps.place(event).is_none_or(|place| {
            let last = &mut self.stamps.times[place];
            let passes = last.is_none_or(|stamp| event.t_us.abs_diff(stamp) >= us);
            if passes {
                *last = Some(event.t_us);
            }
            passes
        });
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.stamps.times.fill(None);
    }

    reports!("refractory");
}

/// The last stamp of each pixel, with a border so that every pixel has eight neighbours.
#[derive(Clone, Debug)]
struct Stamps {
    sensor: Sensor,
    /// The filter's time.
    us: u64,
    stride: usize,
    times: Vec<Option<i64>>,
}

impl Stamps {
    /// No stamps; `what` is the name of the time `us` in an error.
    fn new(sensor: Sensor, us: i64, what: &'static str) -> Result<Self, EngineError> {
        in_range(what, us, 1, Network::MAX_SPAN_US)?;
        let pixels = i64::from(sensor.width) * i64::from(sensor.height);
        in_range("pixels of a filter's sensor", pixels, 0, MAX_PIXELS)?;
        let stride = usize::from(sensor.width) + 2;
        let times = vec![None; stride * (usize::from(sensor.height) + 2)];
        Ok(Self { sensor, us: us.unsigned_abs(), stride, times })
    }

    /// Place of the event's pixel; none outside the sensor.
    #[inline]
    fn place(&self, Event { x, y, .. }: Event) -> Option<usize> {
        let inside = self.sensor.contains(x, y);
        inside.then(|| (usize::from(y) + 1) * self.stride + usize::from(x) + 1)
    }

    /// Whether `holds` is true of the stamp of one of the eight pixels around `place`.
    #[inline]
    fn any_around(&self, place: usize, holds: impl Fn(i64) -> bool) -> bool {
        let row = |at: usize| &self.times[at - 1..=at + 1];
        let mut any = false;
        // No branch for each neighbour: a processor cannot predict which one has a recent stamp.
        for &stamp in row(place - self.stride).iter().chain(row(place + self.stride)) {
            any |= stamp.is_some_and(&holds);
        }
        any || self.times[place - 1].is_some_and(&holds) || self.times[place + 1].is_some_and(&holds)
    }
}
