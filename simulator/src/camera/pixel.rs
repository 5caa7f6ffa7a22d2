//! One pixel. Input: its light over a time. Output: its firings, at the exact times of the model.
//!
//! While the logarithm of the light is a line, `u(x) = u0 + s x`, the level after the low-pass is
//! `v(x) = u0 + s x - s tau + (v0 - u0 + s tau) exp(-x / tau)`. The difference to a reference that
//! leaks is this plus a line. It has at most one extremum, so that a crossing is found between two
//! points of a monotone function. Times are in microseconds after the first image.

use libm::{exp, log};
use meissner_kernels::random::Random;

use super::settings::CameraSettings;

/// Smallest threshold, as in v2e, so that a spread cannot make a pixel fire without end.
const THRESHOLD_MIN: f64 = 0.01;

/// A level counts as equal to its light if the remaining difference is at most this.
const SETTLED: f64 = 1e-9;

/// The cause of a firing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The light changed.
    Signal,
    /// The reference drifted: more than half of the threshold is leak.
    Leak,
    /// Shot noise.
    ShotNoise,
    /// The pixel is hot.
    HotPixel,
}

impl Cause {
    /// All causes, each at the index of its number.
    pub const ALL: [Self; 4] = [Self::Signal, Self::Leak, Self::ShotNoise, Self::HotPixel];

    /// A name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Signal => "signal",
            Self::Leak => "leak",
            Self::ShotNoise => "shot noise",
            Self::HotPixel => "hot pixel",
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Firing {
    /// Time of the stamp, before rounding.
    pub(super) stamp_us: f64,
    pub(super) on: bool,
    pub(super) cause: Cause,
}

/// The state of a pixel at `time`.
#[derive(Clone, Debug)]
pub(super) struct Pixel {
    threshold_on: f64,
    threshold_off: f64,
    time: f64,
    /// Logarithm of the light.
    target: f64,
    /// The same after the low-pass.
    level: f64,
    /// The level with which the pixel compares, and the part of the difference that is leak.
    reference: f64,
    leaked: f64,
    /// End of the reset after the newest event.
    release: f64,
    /// The integral of the rate of noise that is left until the next noise event.
    patience: f64,
    /// Rate of a hot pixel per microsecond, 0 for others.
    hot_per_us: f64,
    random: Random,
}

/// Parameters of a pixel while the logarithm of its light is a line.
#[derive(Clone, Copy)]
struct Segment {
    end: f64,
    /// Slope of the logarithm per microsecond.
    slope: f64,
    tau: f64,
    leak: f64,
    shot: f64,
}

/// `constant + slope x + transient exp(-x / tau)`: level minus reference from a time on.
#[derive(Clone, Copy)]
struct Difference {
    constant: f64,
    slope: f64,
    transient: f64,
    tau: f64,
}

impl Pixel {
    /// A pixel with its own thresholds. Its light is unknown until [`Self::adapt`].
    pub(super) fn new(settings: &CameraSettings, mut random: Random) -> Self {
        let [on, off] = normal_pair(&mut random);
        let threshold =
            |mean: f64, deviation: f64| (mean + settings.threshold_spread * deviation).max(THRESHOLD_MIN);
        let is_hot = random.uniform() < settings.hot_share;
        let hot_per_us = random.uniform() * settings.hot_hz / 1e6;
        Self {
            threshold_on: threshold(settings.threshold_on, on),
            threshold_off: threshold(settings.threshold_off, off),
            time: 0.0,
            target: 0.0,
            level: 0.0,
            reference: 0.0,
            leaked: 0.0,
            release: 0.0,
            patience: exponential(&mut random),
            hot_per_us: if is_hot { hot_per_us } else { 0.0 },
            random,
        }
    }

    /// Sets the state of a pixel that has always seen `intensity`.
    pub(super) fn adapt(&mut self, settings: &CameraSettings, intensity: f64) {
        self.target = logarithm(settings, intensity);
        self.level = self.target;
        let phase = self.random.uniform();
        let width = self.threshold_on + self.threshold_off;
        self.reference =
            if settings.initial_phase { self.level - self.threshold_on + phase * width } else { self.level };
    }

    /// The light is constant until `end`. Returns the time before which nothing can happen if it
    /// stays constant.
    pub(super) fn stay(&mut self, settings: &CameraSettings, end: f64, fire: &mut impl FnMut(Firing)) -> f64 {
        let segment = self.segment(settings, self.target, end);
        self.run(settings, segment, fire);
        self.due(segment)
    }

    /// The logarithm of the light changes to that of `intensity` until `end`; returns as
    /// [`Self::stay`].
    pub(super) fn change(
        &mut self,
        settings: &CameraSettings,
        intensity: f64,
        end: f64,
        fire: &mut impl FnMut(Firing),
    ) -> f64 {
        let target = logarithm(settings, intensity);
        let segment = self.segment(settings, target, end);
        self.run(settings, segment, fire);
        self.target = target;
        self.due(self.segment(settings, target, end))
    }

    /// The light goes to `target` at `end`. Bandwidth and noise follow its geometric mean.
    fn segment(&self, settings: &CameraSettings, target: f64, end: f64) -> Segment {
        let lux = exp(0.5 * (self.target + target));
        let duration = end - self.time;
        Segment {
            end,
            slope: if duration > 0.0 { (target - self.target) / duration } else { 0.0 },
            tau: settings.tau_us(lux),
            leak: settings.leak_per_us(lux) * self.threshold_on,
            shot: settings.shot_per_us(lux),
        }
    }

    /// Everything that happens until the end of the segment.
    fn run(&mut self, settings: &CameraSettings, segment: Segment, fire: &mut impl FnMut(Firing)) {
        while self.time < segment.end {
            if self.time < self.release {
                self.go_to(self.release.min(segment.end), segment);
                self.reset();
                continue;
            }
            let noise_rate = segment.shot + self.hot_per_us;
            let left = segment.end - self.time;
            let noise_after = if noise_rate > 0.0 { self.patience / noise_rate } else { f64::INFINITY };
            let horizon = left.min(noise_after);
            let difference = self.difference(segment);
            let crossing = difference.first_crossing(self.threshold_on, self.threshold_off, horizon);
            if let Some((after, on)) = crossing {
                self.patience = (self.patience - noise_rate * after).max(0.0);
                self.go_to(self.time + after, segment);
                let cause =
                    if on && self.leaked > 0.5 * self.threshold_on { Cause::Leak } else { Cause::Signal };
                self.fire(settings, on, cause, fire);
            } else if noise_after <= left {
                self.go_to(self.time + noise_after, segment);
                let hot = self.random.uniform() * noise_rate < self.hot_per_us;
                let on = hot || self.random.uniform() < 0.5;
                self.patience = exponential(&mut self.random);
                self.fire(settings, on, if hot { Cause::HotPixel } else { Cause::ShotNoise }, fire);
            } else {
                self.patience = (self.patience - noise_rate * left).max(0.0);
                self.go_to(segment.end, segment);
            }
        }
    }

    fn difference(&self, segment: Segment) -> Difference {
        let Segment { slope, tau, leak, .. } = segment;
        Difference {
            constant: self.target - slope * tau - self.reference,
            slope: slope + leak,
            transient: self.level - self.target + slope * tau,
            tau,
        }
    }

    /// Follows light, low-pass and leak to `time`.
    fn go_to(&mut self, time: f64, segment: Segment) {
        let elapsed = time - self.time;
        let lag = segment.slope * segment.tau;
        let transient = self.level - self.target + lag;
        self.target += segment.slope * elapsed;
        self.level = self.target - lag + decayed(transient, elapsed, segment.tau);
        self.reference -= segment.leak * elapsed;
        self.leaked += segment.leak * elapsed;
        self.time = time;
    }

    fn reset(&mut self) {
        self.reference = self.level;
        self.leaked = 0.0;
    }

    fn fire(&mut self, settings: &CameraSettings, on: bool, cause: Cause, fire: &mut impl FnMut(Firing)) {
        let jitter = if settings.jitter_us > 0.0 { normal_pair(&mut self.random)[0] } else { 0.0 };
        let latency = (settings.latency_us + settings.jitter_us * jitter).max(0.0);
        fire(Firing { stamp_us: self.time + latency, on, cause });
        self.release = self.time + settings.refractory_us;
        self.reset();
    }

    /// The earliest next firing at constant light; now, unless level and light agree.
    fn due(&mut self, segment: Segment) -> f64 {
        if self.time < self.release || (self.level - self.target).abs() > SETTLED {
            return self.time;
        }
        let room = self.threshold_on - (self.level - self.reference);
        let leak = if segment.leak > 0.0 { room / segment.leak } else { f64::INFINITY };
        let noise_rate = segment.shot + self.hot_per_us;
        let noise = if noise_rate > 0.0 { self.patience / noise_rate } else { f64::INFINITY };
        // Slightly early, so that rounding cannot make the pixel miss the time.
        self.time + leak.min(noise) * (1.0 - 1e-9)
    }
}

impl Difference {
    fn at(&self, x: f64) -> f64 {
        self.constant + self.slope * x + decayed(self.transient, x, self.tau)
    }

    /// The first time until `horizon` at which it reaches `on` or `-off`, from between them; and
    /// whether it reaches `on`.
    fn first_crossing(&self, on: f64, off: f64, horizon: f64) -> Option<(f64, bool)> {
        let mut from = 0.0;
        for to in [self.extremum().min(horizon), horizon] {
            let value = self.at(to);
            if value >= on || value <= -off {
                let level = if value >= on { on } else { -off };
                return Some((self.reaches(level, from, to), value >= on));
            }
            from = to;
        }
        None
    }

    /// The time at which the slope is 0; infinity if there is none after 0.
    fn extremum(&self) -> f64 {
        let ratio = self.transient / (self.slope * self.tau);
        if ratio > 1.0 && ratio.is_finite() { self.tau * log(ratio) } else { f64::INFINITY }
    }

    /// The time in `from..=to` at which the difference reaches `level`. It must be monotone there
    /// and reach `level`. Newton's method, and halving if a step leaves the interval.
    fn reaches(&self, level: f64, from: f64, to: f64) -> f64 {
        const RESOLUTION_US: f64 = 1e-6;
        let rises = self.at(to) >= level && self.at(from) < level;
        let (mut low, mut high, mut x) = (from, to, to);
        for _ in 0..64 {
            let excess = self.at(x) - level;
            if (excess >= 0.0) == rises {
                high = x;
            } else {
                low = x;
            }
            let slope = self.slope - decayed(self.transient, x, self.tau) / self.tau.max(f64::MIN_POSITIVE);
            let next = x - excess / slope;
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            let step = (next - x).abs();
            x = next;
            if step < RESOLUTION_US {
                break;
            }
        }
        x
    }
}

/// `value exp(-x / tau)`.
fn decayed(value: f64, x: f64, tau: f64) -> f64 {
    if value == 0.0 || tau == 0.0 { 0.0 } else { value * exp(-x / tau) }
}

fn logarithm(settings: &CameraSettings, intensity: f64) -> f64 {
    log(settings.lux * intensity + settings.dark_lux)
}

/// Exponential with mean 1.
fn exponential(random: &mut Random) -> f64 {
    -log(1.0 - random.uniform())
}

/// Two independent standard normal values (Box and Muller 1958).
pub(crate) fn normal_pair(random: &mut Random) -> [f64; 2] {
    let radius = libm::sqrt(2.0 * exponential(random));
    let angle = 2.0 * std::f64::consts::PI * random.uniform();
    [radius * libm::cos(angle), radius * libm::sin(angle)]
}
