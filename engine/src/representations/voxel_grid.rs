//! Voxel grids: events spread over bins of time (Zhu et al. 2019, "Unsupervised Event-based
//! Learning of Optical Flow, Depth, and Egomotion", Eq. 1-2, as Tonic's `ToVoxelGrid`).
//!
//! Input: a window from t0 to t1, both included, and events. Output: a grid (bins, height, width),
//!
//!   V(b, y, x) = sum over events at (x, y) of polarity max(0, 1 - |b - tau|),
//!   tau = s (t - t0) / (t1 - t0),
//!
//! with polarity +1 (ON) or -1 (OFF) and s = bins or bins - 1 ([`VoxelTime`]); tau is 0 if t1 = t0.
//! Weights are integer multiples of 1 / (t1 - t0), so sums are integers: the order of events,
//! including late ones, does not matter. A value is divided in f64 and rounded to f32 once.

use std::ops::RangeInclusive;

use crate::representations::{Crop, RepresentationError};
use crate::rows::RowSet;
use crate::{Event, Sensor};

/// How the time of a window maps to the bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VoxelTime {
    /// s = bins: the window ends one bin after the last bin, and weight beyond the last bin is lost
    /// (Tonic).
    #[default]
    Bins,
    /// s = bins - 1: the window ends on the last bin, and every event has weight 1 (the paper's Eq.
    /// 1).
    Centres,
}

/// Counts of events since a grid was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VoxelCounters {
    /// Events pushed.
    pub pushed: u64,
    /// Events that entered a grid.
    pub accepted: u64,
    /// Dropped: not on the sensor.
    pub outside_sensor: u64,
    /// Dropped: on the sensor, not in the crop.
    pub outside_crop: u64,
    /// Dropped: not in the window.
    pub outside_window: u64,
}

/// A voxel grid, and its pixels that have events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelFrame<'a> {
    /// Bins, rows, columns.
    pub shape: [usize; 3],
    /// Values, row-major.
    pub values: &'a [f32],
    /// Pixels (row times width plus column) with events, in any order; all others are 0.
    pub touched: &'a [u32],
    /// Events inside.
    pub events: u64,
}

/// A voxel grid under construction.
///
/// A push costs O(1), a frame O(bins x pixels with new events), a restart O(bins x touched pixels);
/// nothing is allocated later.
#[derive(Clone, Debug)]
pub struct VoxelGrid {
    sensor: Sensor,
    crop: Crop,
    bins: usize,
    time: VoxelTime,
    start_us: i64,
    /// t1 - t0.
    span: i64,
    /// Multiples of 1 / `span`.
    sums: Vec<i64>,
    values: Vec<f32>,
    touched: RowSet,
    stale: RowSet,
    events: u64,
    counters: VoxelCounters,
}

impl VoxelGrid {
    /// An empty grid of `bins` over the events of `window_us`.
    ///
    /// # Errors
    /// A crop outside `sensor`, bins not from 1 to 65,536, a window that [`Self::restart`] refuses.
    pub fn new(
        sensor: Sensor,
        crop: Crop,
        bins: usize,
        time: VoxelTime,
        window_us: RangeInclusive<i64>,
    ) -> Result<Self, RepresentationError> {
        if !(1..=1 << 16).contains(&bins) {
            return Err(RepresentationError::option("bins", "1 to 65536", bins));
        }
        crop.check(sensor, bins)?;
        let span = span(&window_us)?;
        let pixels = crop.pixels();
        Ok(Self {
            sensor,
            crop,
            bins,
            time,
            start_us: *window_us.start(),
            span,
            sums: vec![0; bins * pixels],
            values: vec![0.0; bins * pixels],
            touched: RowSet::new(pixels),
            stale: RowSet::new(pixels),
            events: 0,
            counters: VoxelCounters::default(),
        })
    }

    /// Empties the grid and begins another window. Counters are kept.
    ///
    /// # Errors
    /// A window that ends before it starts or exceeds 2^32 - 1 us (71 minutes); nothing changes.
    pub fn restart(&mut self, window_us: RangeInclusive<i64>) -> Result<(), RepresentationError> {
        self.span = span(&window_us)?;
        self.start_us = *window_us.start();
        for &pixel in self.touched.as_slice() {
            for i in self.crop.indices(pixel, self.bins) {
                self.sums[i] = 0;
                self.values[i] = 0.0;
            }
        }
        self.touched.clear();
        self.stale.clear();
        self.events = 0;
        Ok(())
    }

    /// Adds `event` if it is on the sensor, in the crop and in the window; returns whether it is.
    pub fn push(&mut self, event: Event) -> bool {
        self.counters.pushed += 1;
        if !self.sensor.contains(event.x, event.y) {
            self.counters.outside_sensor += 1;
            return false;
        }
        let Some(pixel) = self.crop.index(event.x, event.y) else {
            self.counters.outside_crop += 1;
            return false;
        };
        let since = event.t_us.checked_sub(self.start_us).filter(|since| (0..=self.span).contains(since));
        let Some(since) = since else {
            self.counters.outside_window += 1;
            return false;
        };
        self.counters.accepted += 1;
        self.events += 1;
        self.touched.insert(pixel);
        self.stale.insert(pixel);
        let steps = match self.time {
            VoxelTime::Bins => self.bins,
            VoxelTime::Centres => self.bins - 1,
        };
        let unit = self.span.max(1);
        // Below 2^48.
        let scaled = steps as i64 * since;
        let (bin, rest) = ((scaled / unit) as usize, scaled % unit);
        let sign = if event.on { 1 } else { -1 };
        for (bin, weight) in [(bin, unit - rest), (bin + 1, rest)] {
            if bin < self.bins {
                let sum = &mut self.sums[bin * self.crop.pixels() + pixel as usize];
                *sum = sum.saturating_add(sign * weight);
            }
        }
        true
    }

    /// The grid over the events so far.
    pub fn frame(&mut self) -> VoxelFrame<'_> {
        let unit = self.span.max(1) as f64;
        for &pixel in self.stale.as_slice() {
            for i in self.crop.indices(pixel, self.bins) {
                self.values[i] = (self.sums[i] as f64 / unit) as f32;
            }
        }
        self.stale.clear();
        VoxelFrame {
            shape: self.crop.shape(self.bins),
            values: &self.values,
            touched: self.touched.as_slice(),
            events: self.events,
        }
    }

    /// Counts of the events so far, by outcome.
    pub fn counters(&self) -> &VoxelCounters {
        &self.counters
    }
}

/// t1 - t0. It is below 2^32, so that 2^31 events at one pixel cannot saturate a sum.
fn span(window_us: &RangeInclusive<i64>) -> Result<i64, RepresentationError> {
    let span = window_us.end().checked_sub(*window_us.start());
    span.filter(|span| (0..=i64::from(u32::MAX)).contains(span)).ok_or_else(|| {
        let found = format!("{window_us:?}");
        RepresentationError::option("window", "a start, and an end 0 to 4294967295 us after it", found)
    })
}
