//! Parameters of a camera.

use crate::error::{Result, setting};

/// Parameters of a [`Camera`](crate::Camera); its module has the equations.
///
/// The default is a sensor in lamp light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSettings {
    /// Illuminance of a pixel of intensity 1, in lux. With the lamp off it is smaller.
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
    /// Maximum rate of a hot pixel in hertz: the rates are uniform from 0.
    pub hot_hz: f64,
    /// Time after an event in which a pixel is reset, in microseconds.
    pub refractory_us: f64,
    /// Mean time from a crossing to the stamp of its event, in microseconds.
    pub latency_us: f64,
    /// Standard deviation of that time. No event is stamped before its crossing.
    pub jitter_us: f64,
    /// Whether pixels start anywhere between thresholds; otherwise, pixels with equal light fire
    /// together.
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
