//! Random streams and interleavings of an engine's verbs.

use meissner_engine::{Event, Sensor};
use proptest::prelude::*;

/// A verb of the engine, times relative to the one before.
#[derive(Clone, Debug)]
pub enum Verb {
    /// An event `dt` after the newest (negative: late), at a pixel.
    Push {
        /// Microseconds since the newest event or `advance`.
        dt: i64,
        /// Column, taken modulo a little more than the sensor's width.
        x: u16,
        /// Row.
        y: u16,
        /// Polarity.
        on: bool,
    },
    /// Time moves on.
    Advance {
        /// Microseconds.
        dt: i64,
    },
    /// A prediction is read.
    Predict,
    /// Everything is forgotten.
    Reset,
    /// A snapshot is taken, what follows it is undone at once by returning to it.
    Snapshot,
}

/// How events are spread over the sensor and over time.
#[derive(Clone, Copy, Debug)]
enum Style {
    Anywhere,
    OnePixel,
    FewPixels,
    OneInstant,
}

fn verb(style: Style) -> impl Strategy<Value = Verb> {
    let dt = match style {
        Style::OneInstant => Just(0i64).boxed(),
        _ => prop_oneof![4 => 0i64..4, 4 => 0i64..60, 1 => 0i64..1_500, 1 => -9i64..0].boxed(),
    };
    let pixels = match style {
        Style::OnePixel => 1u16,
        Style::FewPixels => 4,
        Style::Anywhere | Style::OneInstant => u16::MAX,
    };
    let push =
        (dt, 0..pixels, 0..pixels, any::<bool>()).prop_map(|(dt, x, y, on)| Verb::Push { dt, x, y, on });
    prop_oneof![
        40 => push,
        2 => prop_oneof![3 => 0i64..80, 1 => 0i64..3_000].prop_map(|dt| Verb::Advance { dt }),
        8 => Just(Verb::Predict),
        1 => Just(Verb::Snapshot),
    ]
}

/// A sensor, and what happens on it.
#[derive(Clone, Debug)]
pub struct Script {
    /// The sensor.
    pub sensor: Sensor,
    /// Where time starts.
    pub origin_us: i64,
    /// What happens.
    pub verbs: Vec<Verb>,
}

impl Script {
    /// The event of a push at `now`. A few pixels fall outside the sensor.
    pub fn event(&self, now: i64, (dt, x, y, on): (i64, u16, u16, bool)) -> Event {
        let pixel = |p: u16, extent: u16| (u32::from(p) % (u32::from(extent) * 33 / 32 + 1)) as u16;
        Event::new(now + dt, pixel(x, self.sensor.width), pixel(y, self.sensor.height), on)
    }
}

/// Scripts of up to `most` verbs.
pub fn script(most: usize) -> impl Strategy<Value = Script> {
    let style = prop_oneof![
        4 => Just(Style::Anywhere),
        1 => Just(Style::OnePixel),
        1 => Just(Style::FewPixels),
        1 => Just(Style::OneInstant),
    ];
    let origin = prop_oneof![Just(0i64), Just(1_700_000_000_000_000), Just(-77), Just(i64::MIN / 2)];
    let sensor = (prop_oneof![1u16..12, 12u16..70], prop_oneof![1u16..12, 12u16..70]);
    let verbs = style.prop_flat_map(move |style| {
        let run = || proptest::collection::vec(verb(style), 1..most);
        (run(), proptest::option::weighted(0.2, run())).prop_map(|(mut verbs, second)| {
            if let Some(second) = second {
                verbs.push(Verb::Reset);
                verbs.extend(second);
            }
            verbs
        })
    });
    (sensor, origin, verbs).prop_map(|((width, height), origin_us, verbs)| Script {
        sensor: Sensor::new(width, height),
        origin_us,
        verbs,
    })
}
