//! How much a window differs from those of a training.
//!
//! Input: the events of a window. Output: [`WindowStatistics`] and, by a [`TrainingWindows`], how
//! unlike they are to those of the training: the distance of nine features (`gaussian.rs`). Sums
//! are integers, so the order of arrival changes no bit. No output of a network depends on this.
//!
//! Invariant: the sums of an engine equal [`WindowStatistics::of`] the events in its window.

use std::collections::BTreeMap;

use crate::gaussian::Gaussian;
use crate::memory::Memory;
use crate::metric::Node;
use crate::window::Window;
use crate::{Event, Sensor};

/// Number of features of a window.
const FEATURES: usize = 9;

/// The features of a window, see [`WindowStatistics::features`]; `None` for features that a window
/// without events does not have.
pub type Features = [Option<f64>; FEATURES];

/// Sums over the events of a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WindowStatistics {
    /// Events.
    pub events: u64,
    /// Events at which the brightness rose.
    pub on: u64,
    /// Pixels with at least one event. On a sensor of more than 2^20 pixels, squares of pixels, as
    /// small as possible with at most 2^20 squares.
    pub pixels: u64,
    /// Sum of the squares of these pixels' numbers of events.
    pub squares: u64,
    /// Sums of columns and rows.
    pub place: [u64; 2],
    /// Sums of their squares.
    pub place_squared: [u64; 2],
    /// Sum of the ages in microseconds.
    pub age_us: u64,
}

impl WindowStatistics {
    /// Statistics of `events` of `sensor` at the time `now_us`; no event is later. O(events log
    /// events).
    pub fn of(events: &[Event], sensor: Sensor, now_us: i64) -> Self {
        let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
        let mut statistics = Self::default();
        let places = Places::of(sensor);
        for event in events {
            let [x, y] = [event.x, event.y].map(u64::from);
            statistics.events += 1;
            statistics.on += u64::from(event.on);
            statistics.place = [statistics.place[0] + x, statistics.place[1] + y];
            statistics.place_squared =
                [statistics.place_squared[0] + x * x, statistics.place_squared[1] + y * y];
            statistics.age_us += now_us.abs_diff(event.t_us);
            *counts.entry(places.of_pixel(event.x, event.y)).or_default() += 1;
        }
        statistics.pixels = counts.len() as u64;
        statistics.squares = counts.values().map(|count| count * count).sum();
        statistics
    }

    /// The features of a window of `span_us` on `sensor`: fourth roots of the number of events, of
    /// pixels with an event and of events at an event's pixel; share of events that are on; mean
    /// column and row, and their standard deviations, as parts of the sensor; mean age as a part of
    /// the span.
    pub fn features(&self, sensor: Sensor, span_us: i64) -> Features {
        let events = self.events as f64;
        let mean = |sum: u64| (self.events > 0).then(|| sum as f64 / events);
        let fourth_root = |value: f64| value.sqrt().sqrt();
        let size = [sensor.width, sensor.height].map(f64::from);
        let place = [0, 1].map(|axis| mean(self.place[axis]).map(|mean| mean / size[axis]));
        let spread = [0, 1].map(|axis| {
            let (mean, squared) = (mean(self.place[axis])?, mean(self.place_squared[axis])?);
            Some((squared - mean * mean).max(0.0).sqrt() / size[axis])
        });
        [
            Some(fourth_root(events)),
            Some(fourth_root(self.pixels as f64)),
            mean(self.squares).map(fourth_root),
            mean(self.on),
            place[0],
            place[1],
            spread[0],
            spread[1],
            mean(self.age_us).map(|age| age / span_us as f64),
        ]
    }
}

/// Statistics of the windows of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingWindows(Gaussian);

impl TrainingWindows {
    /// Statistics of a training with these windows, which all have events. `None` for fewer than 20
    /// windows. O(windows log windows).
    pub fn of(windows: &[Features]) -> Option<Self> {
        let windows: Vec<[f64; FEATURES]> =
            windows.iter().map(|window| window.map(Option::unwrap_or_default)).collect();
        Gaussian::of(FEATURES, &windows).map(Self)
    }

    /// Mean features of the training's windows, and the rows of the factor of their covariance: row
    /// i has i + 1 values. Scaled so that 1 of 1,000 windows of the training has a distance above
    /// 1.
    pub fn parts(&self) -> (&[f64], &[Vec<f64>]) {
        self.0.parts()
    }

    /// Statistics with these [parts](Self::parts).
    ///
    /// `None` for other numbers of values, values that are not finite, or a factor whose diagonal
    /// is not positive.
    pub fn from_parts(mean: &[f64], factor: Vec<Vec<f64>>) -> Option<Self> {
        Gaussian::from_parts(mean, factor).filter(|of| of.features() == FEATURES).map(Self)
    }

    /// The distance of `features` from those of the training, relative to the distance that 1 of
    /// 1,000 windows of the training exceeds: above 1, the window is unlike the training. Features
    /// that a window does not have do not count. About 50 multiply-adds.
    pub fn unlikeness(&self, features: Features) -> f32 {
        self.0.distance(|i| features[i])
    }
}

/// The pixels of a sensor, or squares of pixels, by index.
#[derive(Clone, Copy, Debug)]
struct Places {
    /// Binary logarithm of a square's side.
    side_log2: u32,
    columns: u32,
    count: u32,
}

impl Places {
    const MAX: u32 = 1 << 20;

    /// The smallest squares of `sensor` of which there are at most [`Self::MAX`].
    fn of(sensor: Sensor) -> Self {
        let of = |side_log2: u32| {
            let [columns, rows] =
                [sensor.width, sensor.height].map(|size| u32::from(size).div_ceil(1 << side_log2));
            Self { side_log2, columns, count: columns.saturating_mul(rows) }
        };
        (0..u16::BITS).map(of).find(|places| places.count <= Self::MAX).unwrap_or(of(u16::BITS))
    }

    #[inline]
    fn of_pixel(self, x: u16, y: u16) -> u32 {
        let [x, y] = [x, y].map(|at| u32::from(at) >> self.side_log2);
        y * self.columns + x
    }
}

/// Sums over the events of a moving window.
#[derive(Clone, Debug)]
pub(crate) struct WindowSums {
    places: Places,
    /// Number of events at each place.
    counts: Vec<u32>,
    sums: WindowStatistics,
    /// Sum of the times, modulo 2^64: the sum of the ages is below it.
    times: u64,
}

impl WindowSums {
    pub(crate) fn new(sensor: Sensor, memory: &mut Memory) -> Self {
        let places = Places::of(sensor);
        let counts = memory.copies(0, places.count as usize);
        Self { places, counts, sums: WindowStatistics::default(), times: 0 }
    }

    /// Sums of `window`, on the same sensor.
    pub(crate) fn of(&self, window: &Window) -> Self {
        let (counts, sums) = (vec![0; self.counts.len()], WindowStatistics::default());
        let mut of = Self { counts, sums, times: 0, ..*self };
        window.slots().for_each(|slot| of.enter(window.node(slot)));
        of
    }

    #[inline]
    pub(crate) fn enter(&mut self, node: Node) {
        let [x, y] = [node.x, node.y].map(u64::from);
        let sums = &mut self.sums;
        let count = &mut self.counts[self.places.of_pixel(node.x, node.y) as usize];
        sums.pixels += u64::from(*count == 0);
        sums.squares += 2 * u64::from(*count) + 1;
        *count += 1;
        sums.events += 1;
        sums.on += u64::from(node.on);
        sums.place[0] += x;
        sums.place[1] += y;
        sums.place_squared[0] += x * x;
        sums.place_squared[1] += y * y;
        self.times = self.times.wrapping_add_signed(node.t);
    }

    #[inline]
    pub(crate) fn leave(&mut self, node: Node) {
        let [x, y] = [node.x, node.y].map(u64::from);
        let sums = &mut self.sums;
        let count = &mut self.counts[self.places.of_pixel(node.x, node.y) as usize];
        *count -= 1;
        sums.squares -= 2 * u64::from(*count) + 1;
        sums.pixels -= u64::from(*count == 0);
        sums.events -= 1;
        sums.on -= u64::from(node.on);
        sums.place[0] -= x;
        sums.place[1] -= y;
        sums.place_squared[0] -= x * x;
        sums.place_squared[1] -= y * y;
        self.times = self.times.wrapping_sub(node.t as u64);
    }

    /// The statistics at `now`, which counts from the epoch as the nodes' times do.
    pub(crate) fn at(&self, now: i64) -> WindowStatistics {
        let age_us = self.sums.events.wrapping_mul(now as u64).wrapping_sub(self.times);
        WindowStatistics { age_us, ..self.sums }
    }
}
