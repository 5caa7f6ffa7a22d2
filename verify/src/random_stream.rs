//! Random streams of events and of frames, with all difficult cases for an engine.

use meissner_engine::{Event, Network, Sensor};
use meissner_kernels::random::Random;

use crate::frame_networks::next_frame;
use crate::stream::{Step, Stream};

/// The distribution of the events of a stream over sensor and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scene {
    /// All pixels are equally likely.
    Uniform,
    /// Most events come from a few neighbouring pixels.
    HotSpot,
    /// All events come from one pixel.
    OnePixel,
    /// All events have the same time.
    OneInstant,
    /// Few events are in the window at a time.
    Sparse,
    /// Many events at once, and then silence for longer than the window.
    Bursts,
    /// Times and pixels lie on multiples of fractions of span and sensor, where cells begin.
    Grid,
    /// The window is full.
    Full,
}

const SCENES: [Scene; 8] = {
    use Scene::{Bursts, Full, Grid, HotSpot, OneInstant, OnePixel, Sparse, Uniform};
    [Uniform, HotSpot, OnePixel, OneInstant, Sparse, Bursts, Grid, Full]
};
/// Starts of time.
const ORIGINS: [i64; 4] = [0, 1_700_000_000_000_000, -77, i64::MIN / 2];
/// Events in a window of an ordinary scene.
const NODES: u64 = 24;

/// `cases` random streams of `seed` for `network`: on `sensor`, or on several sizes. In every
/// second stream, and if the window is to be full, the capacity is below that of the network.
pub fn random_streams(
    network: &Network,
    sensor: Option<Sensor>,
    cases: u64,
    seed: u64,
) -> impl Iterator<Item = Stream> {
    (0..cases).map(move |case| random_stream(network, sensor, &mut random_of(seed, case)))
}

/// `cases` random sequences of `seed` with frames of `values` values, between other steps.
pub fn random_frames(values: usize, cases: u64, seed: u64) -> impl Iterator<Item = Stream<Vec<f32>>> {
    (0..cases).map(move |case| {
        let random = &mut random_of(seed, case);
        let mut frame = vec![0.0; values];
        let mut steps = Vec::new();
        for _ in 0..=random.below(12) {
            next_frame(&mut frame, random);
            steps.push(Step::Push(frame.clone()));
            match random.below(16) {
                0 => steps.push(Step::Reset),
                1 => steps.push(Step::Snapshot),
                2 => steps.push(Step::Bytes),
                3..12 => steps.push(Step::Predict),
                _ => {}
            }
        }
        Stream { sensor: None, capacity: None, steps }
    })
}

/// Each case is determined by seed and number alone.
fn random_of(seed: u64, case: u64) -> Random {
    Random::new(Random::new(seed).bits() ^ Random::new(!case).bits())
}

pub(crate) fn random_stream(network: &Network, sensor: Option<Sensor>, random: &mut Random) -> Stream {
    let scene = SCENES[random.below(SCENES.len() as u64) as usize];
    let sensor = sensor.unwrap_or_else(|| Sensor::new(side(random), side(random)));
    let small = scene == Scene::Full || random.below(2) == 0;
    let capacity = small.then(|| network.parts().capacity.min(1 + random.below(32) as usize));
    // Long streams are rare: every comparison is a full recomputation.
    let count = if random.below(8) == 0 { 240 } else { random.below(80) };
    let each = random.below(2) == 0;
    let (span_us, now) = (network.parts().span_us as u64, ORIGINS[random.below(4) as usize]);
    let hot = [random.below(sensor.width.into()), random.below(sensor.height.into())];
    let mut source = Source { scene, sensor, span_us, now, hot };
    let mut steps = Vec::new();
    for _ in 0..count {
        steps.push(Step::Push(source.event(random)));
        match random.below(120) {
            0..6 => steps.push(Step::Advance(source.advance(random))),
            6..8 => steps.push(Step::Reset),
            8..11 => steps.push(Step::Snapshot),
            11..14 => steps.push(Step::Bytes),
            // Between two comparisons, several events change the same rows.
            14..26 => steps.push(Step::Predict),
            _ if each => steps.push(Step::Predict),
            _ => {}
        }
    }
    Stream { sensor: Some(sensor), capacity, steps }
}

/// Columns or rows of a sensor.
fn side(random: &mut Random) -> u16 {
    let (low, high) = [(1, 12), (12, 70), (70, 700)][random.below(3) as usize];
    (low + random.below(high - low)) as u16
}

/// The source of events.
struct Source {
    scene: Scene,
    sensor: Sensor,
    span_us: u64,
    now: i64,
    /// The hot spot.
    hot: [u64; 2],
}

impl Source {
    fn event(&mut self, random: &mut Random) -> Event {
        let gap = self.gap(random);
        let time = self.now.saturating_add(gap as i64);
        if random.below(24) == 0 {
            // Late, and dropped.
            let late = 1 + random.below(self.span_us / 8 + 1);
            return self.at(self.now.saturating_sub(late as i64), random);
        }
        self.now = time;
        self.at(time, random)
    }

    fn gap(&self, random: &mut Random) -> u64 {
        let span = self.span_us;
        let ordinary = random.below(2 * span / NODES + 1);
        if random.below(6) == 0 {
            return 0;
        }
        match self.scene {
            Scene::Uniform | Scene::HotSpot | Scene::OnePixel => ordinary,
            Scene::OneInstant => 0,
            Scene::Sparse => random.below(span),
            Scene::Bursts if random.below(16) == 0 => span + random.below(2 * span),
            Scene::Bursts => random.below(span / 200 + 1),
            Scene::Grid => span / 16 * random.below(4),
            Scene::Full => random.below(span / 256 + 1),
        }
    }

    fn at(&self, t_us: i64, random: &mut Random) -> Event {
        let extent = [u64::from(self.sensor.width), u64::from(self.sensor.height)];
        let mut pixel = [0, 1].map(|axis| match self.scene {
            Scene::OnePixel => self.hot[axis],
            Scene::HotSpot if random.below(8) > 0 => (self.hot[axis] + random.below(3)).min(extent[axis] - 1),
            Scene::Grid => extent[axis] * random.below(16) / 16,
            _ => random.below(extent[axis]),
        });
        if random.below(40) == 0 {
            // Outside the sensor, and dropped.
            let axis = random.below(2) as usize;
            pixel[axis] = extent[axis] + random.below(3);
        }
        Event::new(t_us, pixel[0] as u16, pixel[1] as u16, random.below(2) == 1)
    }

    fn advance(&mut self, random: &mut Random) -> i64 {
        let by = if random.below(3) == 0 {
            random.below(3 * self.span_us)
        } else {
            random.below(self.span_us / 8 + 1)
        };
        self.now = self.now.saturating_add(by as i64);
        self.now
    }
}
