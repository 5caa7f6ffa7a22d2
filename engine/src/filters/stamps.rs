//! A time for each pixel of a sensor.

use crate::error::in_range;
use crate::{EngineError, Sensor};

/// Pixels of the largest sensor: 1 GiB of stamps.
const MOST_PIXELS: i64 = 1 << 26;

/// The newest stamp that was set at each pixel, with a border of one pixel that has none, so that every pixel of the
/// sensor has eight neighbours.
#[derive(Clone, Debug)]
pub(super) struct Stamps {
    sensor: Sensor,
    stride: usize,
    times: Vec<Option<i64>>,
}

impl Stamps {
    /// No stamps.
    pub(super) fn new(sensor: Sensor) -> Result<Self, EngineError> {
        let pixels = i64::from(sensor.width) * i64::from(sensor.height);
        in_range("pixels of a filter's sensor", pixels, 0, MOST_PIXELS)?;
        let stride = usize::from(sensor.width) + 2;
        Ok(Self { sensor, stride, times: vec![None; stride * (usize::from(sensor.height) + 2)] })
    }

    /// Place of a pixel; none outside the sensor.
    #[inline]
    pub(super) fn place(&self, x: u16, y: u16) -> Option<usize> {
        let inside = self.sensor.contains(x, y);
        inside.then(|| (usize::from(y) + 1) * self.stride + usize::from(x) + 1)
    }

    #[inline]
    pub(super) fn get(&self, place: usize) -> Option<i64> {
        self.times[place]
    }

    #[inline]
    pub(super) fn set(&mut self, place: usize, t_us: i64) {
        self.times[place] = Some(t_us);
    }

    /// Whether one of the eight pixels around `place` has a stamp of which `holds` is true.
    #[inline]
    pub(super) fn any_around(&self, place: usize, holds: impl Fn(i64) -> bool) -> bool {
        let row = |at: usize| &self.times[at - 1..=at + 1];
        let mut any = false;
        // No branch for each: which neighbour has spoken cannot be guessed.
        for &stamp in row(place - self.stride).iter().chain(row(place + self.stride)) {
            any |= stamp.is_some_and(&holds);
        }
        any || self.get(place - 1).is_some_and(&holds) || self.get(place + 1).is_some_and(&holds)
    }

    /// Forgets all stamps.
    pub(super) fn clear(&mut self) {
        self.times.fill(None);
    }
}
