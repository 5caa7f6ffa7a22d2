//! An event camera: images in, events out.
//!
//! A pixel turns light into a voltage and reports each change of it by a threshold. In the model, x
//! is the time and E the illuminance of the pixel in lux:
//!
//! - photocurrent: `E = lux * intensity`, plus the dark current `dark_lux`;
//! - logarithm: `u = ln(E + dark_lux)`, linear in time between two images (v2e instead makes the
//!   logarithm linear below 20 of 255);
//! - bandwidth: `dv/dx = (u - v) / tau` with `1 / tau = 2 pi min(cutoff_hz_per_lux (E + dark_lux),
//!   cutoff_max_hz)` (v2e: at most 300 Hz; IEBCS: tau of 40 to 100 us at 1 klux);
//! - leak: the reference `m` falls by `threshold_on` at the rate
//!   `leak_hz + leak_hz_per_klux E / 1000` (v2e: 0.01 to 0.1 Hz);
//! - threshold: an event where `v - m` reaches `threshold_on` or `-threshold_off` of the pixel,
//!   normal over pixels and polarities, at least 0.01 (v2e);
//! - reset: `m = v` at the end of the refractory time (v2e: 0.5 ms, IEBCS: 50 to 100 us);
//! - shot noise: events at the rate `shot_hz / (1 + (E / shot_corner_lux)^2)`, on and off equally
//!   often (v2e: 0.001 to 5 Hz);
//! - hot pixels: a share of the pixels has additional on events, each pixel at its own rate;
//! - latency: a stamp is `latency_us` after the crossing, with normal jitter (IEBCS: 100 us, jitter
//!   of 10 to 30 us).
//!
//! v2e: Hu, Liu and Delbruck 2021, "v2e: From video frames to realistic DVS events". IEBCS: Joubert
//! et al. 2021, "Event camera simulator improvements via characterized parameters". The response to
//! a linear ramp of `u` has a closed form (`pixel.rs`), so that the time of a crossing depends on
//! the scene and not on the times of the images.
//!
//! The model leaves out: the readout bus, which loses events when many pixels fire at once; flicker
//! of lamps; thresholds over temperature; correlated noise of neighbours.

mod pixel;
mod settings;

use meissner_engine::{Event, Sensor};
use meissner_kernels::random::Random;

use crate::error::{Result, SimulatorError};
pub use pixel::Cause;
pub(crate) use pixel::normal_pair;
use pixel::{Firing, Pixel};
pub use settings::CameraSettings;

/// An event and its cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct SimulatedEvent {
    pub event: Event,
    /// The cause of the event, which no sensor knows.
    pub cause: Cause,
}

/// An event camera that looks at a sequence of images.
///
/// Memory: about 100 bytes a pixel. Time: a few nanoseconds for a pixel whose light is constant,
/// some tens for one whose light changes, some hundreds for an event.
#[derive(Clone, Debug)]
pub struct Camera {
    sensor: Sensor,
    settings: CameraSettings,
    /// Time of the first and of the newest image; `None` before the first image.
    times: Option<(i64, i64)>,
    intensity: Vec<f32>,
    /// The earliest time of each pixel's next event, in us after the first image.
    due: Vec<f64>,
    pixels: Vec<Pixel>,
    /// Events before which a later crossing with less latency can still be stamped.
    pending: Vec<SimulatedEvent>,
}

impl Camera {
    /// A camera before its first image. `seed` sets thresholds, hot pixels, phases and noise.
    ///
    /// # Errors
    /// A setting is outside its range.
    pub fn new(sensor: Sensor, settings: CameraSettings, seed: u64) -> Result<Self> {
        settings.check()?;
        let count = usize::from(sensor.width) * usize::from(sensor.height);
        let mut seeds = Random::new(seed);
        let pixels = (0..count).map(|_| Pixel::new(&settings, Random::new(seeds.bits()))).collect();
        Ok(Self {
            sensor,
            settings,
            times: None,
            intensity: vec![0.0; count],
            due: vec![0.0; count],
            pixels,
            pending: Vec::new(),
        })
    }

    /// The sensor of the camera.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// Takes the image at `t_us`, and appends the events that are then certain, in order.
    ///
    /// `image` has an intensity for each pixel, row by row: the share of the light of a white
    /// surface, rarely above 1, whose logarithm is linear between images. The first image causes no
    /// events. Complexity: O(pixels + events).
    ///
    /// # Errors
    /// The time does not ascend, the number of pixels differs, or an intensity is wrong. The camera
    /// stays unchanged.
    pub fn push(&mut self, t_us: i64, image: &[f32], events: &mut Vec<SimulatedEvent>) -> Result<()> {
        self.check(t_us, image)?;
        let Some((first, before)) = self.times else {
            self.times = Some((t_us, t_us));
            self.intensity.copy_from_slice(image);
            for ((pixel, due), &intensity) in self.pixels.iter_mut().zip(&mut self.due).zip(image) {
                pixel.adapt(&self.settings, f64::from(intensity));
                *due = 0.0;
            }
            return Ok(());
        };
        let (start, end) = ((before - first) as f64, (t_us - first) as f64);
        let width = usize::from(self.sensor.width);
        for (i, &intensity) in image.iter().enumerate() {
            let constant = intensity == self.intensity[i];
            if constant && self.due[i] > end {
                continue;
            }
            let (x, y) = ((i % width) as u16, (i / width) as u16);
            let pending = &mut self.pending;
            let mut fire = |firing: Firing| {
                // A stamp is a whole microsecond, and not before the crossing.
                let t_us = first + libm::ceil(firing.stamp_us) as i64;
                pending
                    .push(SimulatedEvent { event: Event::new(t_us, x, y, firing.on), cause: firing.cause });
            };
            let pixel = &mut self.pixels[i];
            if !constant {
                pixel.stay(&self.settings, start, &mut fire);
            }
            self.due[i] = if constant {
                pixel.stay(&self.settings, end, &mut fire)
            } else {
                pixel.change(&self.settings, f64::from(intensity), end, &mut fire)
            };
        }
        self.intensity.copy_from_slice(image);
        self.times = Some((first, t_us));
        self.release(t_us, events);
        Ok(())
    }

    /// Appends the events that wait for their latency. Events of later images can have earlier
    /// stamps.
    pub fn finish(&mut self, events: &mut Vec<SimulatedEvent>) {
        self.release(i64::MAX, events);
    }

    /// Moves the pending events up to `t_us` to `events`.
    fn release(&mut self, t_us: i64, events: &mut Vec<SimulatedEvent>) {
        self.pending.sort_unstable_by_key(|pending| {
            let event = pending.event;
            (event.t_us, event.y, event.x, event.on)
        });
        let certain = self.pending.partition_point(|pending| pending.event.t_us <= t_us);
        events.extend(self.pending.drain(..certain));
    }

    fn check(&self, t_us: i64, image: &[f32]) -> Result<()> {
        if let Some((first, before)) = self.times
            && (t_us <= before || t_us.checked_sub(first).is_none_or(|span| span > 1 << 53))
        {
            return Err(SimulatorError::Time { before, found: t_us });
        }
        if image.len() != self.pixels.len() {
            return Err(SimulatorError::Pixels { expected: self.pixels.len(), found: image.len() });
        }
        match image.iter().position(|&value| !(value.is_finite() && value >= 0.0)) {
            None => Ok(()),
            Some(i) => {
                let width = usize::from(self.sensor.width);
                Err(SimulatorError::Intensity {
                    x: (i % width) as u16,
                    y: (i / width) as u16,
                    found: image[i],
                })
            }
        }
    }
}
