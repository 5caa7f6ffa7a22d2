//! Moving markers, as the camera in a tactile sensor sees them: discs on a ground of another
//! intensity.
//!
//! Input: positions of markers at some times. Output: images at any time, or events.

use meissner_engine::Sensor;

use crate::{Camera, Result, SimulatedEvent, SimulatorError};

/// The look of markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerScene {
    /// Radius of a marker in pixels.
    pub radius: f32,
    /// Width of the edge in pixels, over which a marker's share of a pixel falls to 0.
    pub edge: f32,
    /// Intensity of markers, as in [`Camera::push`].
    pub marker: f32,
    /// Intensity between markers.
    pub ground: f32,
}

impl Default for MarkerScene {
    /// The scene of a real tactile stream (docs/simulated-touch.md), and of trainings.
    fn default() -> Self {
        Self { radius: 1.5, edge: 1.0, marker: 0.5, ground: 0.25 }
    }
}

/// Positions of markers over time, in pixels: (0, 0) is the centre of the pixel in the corner.
/// Markers move along straight lines between the times.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerTracks {
    t_us: Vec<i64>,
    markers: usize,
    /// Time after time, marker after marker.
    positions: Vec<[f32; 2]>,
}

impl MarkerTracks {
    /// Tracks of `markers` markers; `positions` is ordered by time, then by marker.
    ///
    /// # Errors
    /// Times do not ascend, the number of positions is wrong, or a position is not finite.
    pub fn new(t_us: Vec<i64>, markers: usize, positions: Vec<[f32; 2]>) -> Result<Self> {
        if positions.len() != t_us.len() * markers {
            return Err(SimulatorError::Tracks { times: t_us.len(), markers, found: positions.len() });
        }
        if let Some(pair) = t_us.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(SimulatorError::Time { before: pair[0], found: pair[1] });
        }
        if let Some(i) = positions.iter().position(|[x, y]| !(x.is_finite() && y.is_finite())) {
            return Err(SimulatorError::Position { marker: i % markers, t_us: t_us[i / markers] });
        }
        Ok(Self { t_us, markers, positions })
    }

    /// Films all tracks, and appends the events in order of time.
    ///
    /// Images are drawn so often that no marker moves more than `STEP` pixels between two.
    /// Complexity: O(images x (pixels + markers x area of a marker) + events).
    ///
    /// # Errors
    /// As [`Camera::push`]. Events of images before the error are in `events`.
    pub fn film(
        &self,
        scene: &MarkerScene,
        camera: &mut Camera,
        events: &mut Vec<SimulatedEvent>,
    ) -> Result<()> {
        (0..self.intervals()).try_for_each(|interval| self.film_interval(interval, scene, camera, events))?;
        camera.finish(events);
        Ok(())
    }

    /// Number of intervals between the times.
    pub fn intervals(&self) -> usize {
        self.t_us.len().saturating_sub(1)
    }

    /// Films an interval, for a caller that films them one by one in order, each with the same
    /// `camera`, and calls [`Camera::finish`] at the end: the events are those of [`Self::film`].
    ///
    /// # Errors
    /// As [`Camera::push`].
    ///
    /// # Panics
    /// If there is no such interval.
    pub fn film_interval(
        &self,
        interval: usize,
        scene: &MarkerScene,
        camera: &mut Camera,
        events: &mut Vec<SimulatedEvent>,
    ) -> Result<()> {
        let sensor = camera.sensor();
        let mut image = vec![0.0; usize::from(sensor.width) * usize::from(sensor.height)];
        let mut now = vec![[0.0; 2]; self.markers];
        let times = [self.t_us[interval], self.t_us[interval + 1]];
        let (before, after) = (self.at(interval), self.at(interval + 1));
        let span = times[1] - times[0];
        let images = images(before, after).min(span.unsigned_abs());
        for i in u64::from(interval > 0)..=images {
            let t_us = times[0] + (i128::from(span) * i128::from(i) / i128::from(images)) as i64;
            let share = (t_us - times[0]) as f32 / span as f32;
            for ((now, a), b) in now.iter_mut().zip(before).zip(after) {
                *now = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
            }
            scene.draw(sensor, &now, &mut image);
            camera.push(t_us, &image, events)?;
        }
        Ok(())
    }

    fn at(&self, time: usize) -> &[[f32; 2]] {
        &self.positions[time * self.markers..][..self.markers]
    }
}

/// Maximum motion of a marker between two images, in pixels: the light at its edge is then linear
/// in time.
const STEP: f32 = 0.125;

/// Number of images that a motion needs, at least 1.
fn images(before: &[[f32; 2]], after: &[[f32; 2]]) -> u64 {
    let distance = |(a, b): (&[f32; 2], &[f32; 2])| length(a[0] - b[0], a[1] - b[1]);
    let furthest = before.iter().zip(after).map(distance).fold(0.0, f32::max);
    ((furthest / STEP).ceil() as u64).max(1)
}

impl MarkerScene {
    /// Draws markers at `positions` into `image`. If two markers overlap in a pixel, the one that
    /// covers more counts.
    ///
    /// # Panics
    /// If `image` does not have the pixels of `sensor`.
    pub fn draw(&self, sensor: Sensor, positions: &[[f32; 2]], image: &mut [f32]) {
        let (width, height) = (usize::from(sensor.width), usize::from(sensor.height));
        assert_eq!(image.len(), width * height, "an image of {sensor}");
        image.fill(0.0);
        let edge = self.edge.max(f32::MIN_POSITIVE);
        let reach = self.radius + 0.5 * edge;
        for &[x, y] in positions {
            let columns = pixels(x - reach, x + reach, width);
            for row in pixels(y - reach, y + reach, height) {
                for column in columns.clone() {
                    let distance = length(column as f32 - x, row as f32 - y);
                    let covered = ((reach - distance) / edge).clamp(0.0, 1.0);
                    let pixel = &mut image[row * width + column];
                    *pixel = pixel.max(covered);
                }
            }
        }
        for pixel in image {
            *pixel = self.ground + *pixel * (self.marker - self.ground);
        }
    }
}

/// Unlike `hypot`, a square root is rounded equally on every machine.
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// The pixels from `low` to `high` that exist.
fn pixels(low: f32, high: f32, count: usize) -> std::ops::Range<usize> {
    let start = low.ceil().max(0.0) as usize;
    let end = (high.floor() + 1.0).max(0.0) as usize;
    start.min(count)..end.min(count)
}
