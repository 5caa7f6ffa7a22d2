//! An event camera: images in, events out.
//!
//! A pixel turns light into a voltage and reports each change of it by a threshold. The model, with
//! x the time and E the illuminance of the pixel in lux:
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
//! - hot pixels: a share of the pixels has on events at a rate of its own, in addition;
//! - latency: a stamp is `latency_us` after the crossing, with normal jitter (IEBCS: 100 us, jitter
//!   of 10 to 30 us).
//!
//! v2e: Hu, Liu and Delbruck 2021, "v2e: From video frames to realistic DVS events". IEBCS: Joubert
//! et al. 2021, "Event camera simulator improvements via characterized parameters". The response to
//! a linear ramp of `u` is known in closed form (`pixel.rs`), so that the time of a crossing
//! depends on the scene and not on the times of the images.
//!
//! Left out: the readout bus, which loses events when many pixels fire at once; flicker of lamps;
//! thresholds over temperature; correlated noise of neighbours.

mod pixel;

use meissner_engine::{Event, Sensor};
use meissner_kernels::random::Random;

use crate::error::{Result, SimulatorError, setting};
pub use pixel::Cause;
pub(crate) use pixel::normal_pair;
use pixel::{Firing, Pixel};

/// An event and its cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct SimulatedEvent {
    pub event: Event,
    /// Why it was sent, which no sensor knows.
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
    /// Time of the first and of the newest image; no image has come yet if it is missing.
    times: Option<(i64, i64)>,
    intensity: Vec<f32>,
    /// When each pixel's next event is due at the earliest, in us after the first image.
    due: Vec<f64>,
    pixels: Vec<Pixel>,
    /// Events that a later crossing with less latency can still precede.
    pending: Vec<SimulatedEvent>,
}

impl Camera {
    /// A camera before its first image. `seed` sets thresholds, hot pixels, phases and noise.
    ///
    /// # Errors
    /// A setting that is outside its range.
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

    /// Takes the image at `t_us`, and appends the events that are certain by then, in order.
    ///
    /// `image` has an intensity for each pixel, row by row: the share of the light of a white
    /// surface, rarely above 1, whose logarithm is linear between images. The first image causes no
    /// events. Complexity: O(pixels + events).
    ///
    /// # Errors
    /// A time that does not ascend, other pixels, a wrong intensity. The camera is as it was.
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

    /// Appends the events that wait for their latency; later ones can precede them.
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

/// Parameters of a [`Camera`](crate::Camera); its module has the equations.
///
/// The default is a sensor in lamp light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSettings {
    /// Illuminance of a pixel of intensity 1, in lux. A lamp that is off is less light.
    pub lux: f64,
    /// The light whose photocurrent equals the dark current, in lux.
    pub dark_lux: f64,
    /// Mean threshold of on events, in units of the natural logarithm.
    pub threshold_on: f64,
    /// Mean threshold of off events.
    pub threshold_off: f64,
    /// Standard deviation of thresholds over pixels and polarities.
    pub threshold_spread: f64,
    /// Cutoff frequency of a pixel for each lux of its light, in hertz.
    pub cutoff_hz_per_lux: f64,
    /// Highest cutoff frequency in hertz; infinity for none.
    pub cutoff_max_hz: f64,
    /// Rate of leak events in the dark, in hertz.
    pub leak_hz: f64,
    /// Rate of leak events that 1,000 lux add, in hertz.
    pub leak_hz_per_klux: f64,
    /// Rate of shot noise in the dark, both polarities together, in hertz.
    pub shot_hz: f64,
    /// The light at which shot noise is half as frequent as in the dark, in lux.
    pub shot_corner_lux: f64,
    /// Share of hot pixels.
    pub hot_share: f64,
    /// Most frequent rate of a hot pixel in hertz: the rates are uniform from 0.
    pub hot_hz: f64,
    /// Time after an event in which a pixel is reset, in microseconds.
    pub refractory_us: f64,
    /// Mean time from a crossing to the stamp of its event, in microseconds.
    pub latency_us: f64,
    /// Standard deviation of that time. No event is stamped before its crossing.
    pub jitter_us: f64,
    /// Whether pixels start anywhere between thresholds; else equal ones fire together.
    pub initial_phase: bool,
}

impl Default for CameraSettings {
    fn default() -> Self {
        Self {
            lux: 300.0,
            dark_lux: 0.1,
            threshold_on: 0.2,
            threshold_off: 0.2,
            threshold_spread: 0.02,
            cutoff_hz_per_lux: 2.3,
            cutoff_max_hz: 3_000.0,
            leak_hz: 0.061,
            leak_hz_per_klux: 0.043,
            shot_hz: 5.0,
            shot_corner_lux: 1.44,
            hot_share: 0.0005,
            hot_hz: 50.0,
            refractory_us: 100.0,
            latency_us: 100.0,
            jitter_us: 20.0,
            initial_phase: true,
        }
    }
}

impl CameraSettings {
    /// Thresholds and leak that agree with a real tactile stream (docs/simulated-touch.md).
    #[must_use]
    pub fn tactile() -> Self {
        Self {
            threshold_on: 0.2,
            threshold_off: 0.35,
            threshold_spread: 0.03,
            leak_hz: 0.003,
            ..Self::default()
        }
    }

    /// No noise, spread, delay, dark current or limit of bandwidth; phases stay random.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            dark_lux: 1e-3,
            threshold_spread: 0.0,
            cutoff_max_hz: f64::INFINITY,
            cutoff_hz_per_lux: f64::INFINITY,
            leak_hz: 0.0,
            leak_hz_per_klux: 0.0,
            shot_hz: 0.0,
            hot_share: 0.0,
            refractory_us: 0.0,
            latency_us: 0.0,
            jitter_us: 0.0,
            ..Self::default()
        }
    }

    /// Time constant of a pixel in microseconds at the photocurrent of `lux`; 0 without a limit.
    pub(super) fn tau_us(&self, lux: f64) -> f64 {
        let cutoff_hz = (self.cutoff_hz_per_lux * lux).min(self.cutoff_max_hz);
        1e6 / (2.0 * std::f64::consts::PI * cutoff_hz)
    }

    /// Leak events per microsecond at `lux`.
    pub(super) fn leak_per_us(&self, lux: f64) -> f64 {
        (self.leak_hz + self.leak_hz_per_klux * lux / 1e3) / 1e6
    }

    /// Events of shot noise per microsecond at `lux`.
    pub(super) fn shot_per_us(&self, lux: f64) -> f64 {
        let ratio = lux / self.shot_corner_lux;
        self.shot_hz / (1.0 + ratio * ratio) / 1e6
    }

    pub(super) fn check(&self) -> Result<()> {
        let positive = |name, found: f64| {
            setting(name, "a finite number above 0", found, found.is_finite() && found > 0.0)
        };
        let cutoff = |name, found: f64| setting(name, "above 0", found, found > 0.0);
        let amount = |name, found: f64| {
            setting(name, "a finite number of at least 0", found, found.is_finite() && found >= 0.0)
        };
        positive("lux", self.lux)?;
        positive("dark_lux", self.dark_lux)?;
        positive("threshold_on", self.threshold_on)?;
        positive("threshold_off", self.threshold_off)?;
        amount("threshold_spread", self.threshold_spread)?;
        cutoff("cutoff_hz_per_lux", self.cutoff_hz_per_lux)?;
        cutoff("cutoff_max_hz", self.cutoff_max_hz)?;
        amount("leak_hz", self.leak_hz)?;
        amount("leak_hz_per_klux", self.leak_hz_per_klux)?;
        amount("shot_hz", self.shot_hz)?;
        positive("shot_corner_lux", self.shot_corner_lux)?;
        amount("hot_share", self.hot_share)?;
        amount("hot_hz", self.hot_hz)?;
        amount("refractory_us", self.refractory_us)?;
        amount("latency_us", self.latency_us)?;
        amount("jitter_us", self.jitter_us)
    }
}
