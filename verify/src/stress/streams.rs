//! Streams that strain the arithmetic, through shipped networks.

use std::collections::BTreeMap;
use std::sync::Arc;

use meissner_engine::{Event, Network, Sensor};
use meissner_kernels::random::Random;
use meissner_models::Weights;
use meissner_run::RunError;

use super::Prepared;
use super::events::EventRun;
use super::result::{Expect, Size, WITHIN};
use crate::error::VerifyError;

/// The networks that streams go through: neighbours among all, with one pooling and with three, and frozen ones from the
/// past, with poolings and without.
pub(super) const NETWORKS: [&str; 4] = ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"];
/// Most events in the window: fewer than there are, so that some are evicted.
const CAPACITY: usize = 300;
/// Of the shipped networks, in microseconds.
const SPAN: i64 = 150_000;
const SENSOR: Sensor = Sensor { width: 240, height: 180 };

/// A stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) name: &'static str,
    span_us: i64,
    sensor: Sensor,
    /// Event `i` of so many.
    event: fn(i: i64, count: i64, &mut Random) -> Event,
}

/// Anywhere on the sensor.
fn spread(t_us: i64, random: &mut Random) -> Event {
    Event::new(t_us, random.below(240) as u16, random.below(180) as u16, random.below(2) == 1)
}

/// Time `i` of those that begin at `first` and are `mean` microseconds apart, give or take as much.
fn at(first: i64, i: i64, mean: i64, random: &mut Random) -> i64 {
    first + i * mean + random.below(mean as u64 + 1) as i64
}

const fn usual(name: &'static str, event: fn(i64, i64, &mut Random) -> Event) -> Shape {
    Shape { name, span_us: SPAN, sensor: SENSOR, event }
}

/// The stream that others are compared with.
const ORDINARY: Shape = usual("ordinary", |i, _, random| spread(at(0, i, 600, random), random));

/// All streams.
pub(super) const SHAPES: &[Shape] = &[
    ORDINARY,
    usual("stamps around 2^53", |i, n, random| spread(at((1 << 53) - 300 * n, i, 600, random), random)),
    usual("stamps around 2^62", |i, n, random| spread(at((1 << 62) - 300 * n, i, 600, random), random)),
    usual("negative stamps, through 0", |i, n, random| spread(at(-300 * n, i, 600, random), random)),
    usual("stamps from the least i64", |i, _, random| spread(at(i64::MIN, i, 600, random), random)),
    usual("stamps up to the largest i64", |i, n, random| {
        spread(at(i64::MAX - 600 * n - 600, i, 600, random), random)
    }),
    usual("least i64, then the largest", |i, n, random| {
        // Events more than 63 bits from the epoch are dropped.
        spread(if i < n / 2 { at(i64::MIN, i, 600, random) } else { i64::MAX }, random)
    }),
    Shape {
        span_us: 10,
        ..usual("span of 10 us", |i, _, random| spread(i / 16 + random.below(2) as i64 / 2, random))
    },
    Shape {
        span_us: 10_000_000,
        ..usual("span of 10 s", |i, _, random| spread(at(0, i, 40_000, random), random))
    },
    Shape {
        span_us: Network::MAX_SPAN_US,
        ..usual("span of 12 days, stamps around 2^53", |i, n, random| {
            let mean = Network::MAX_SPAN_US / 250;
            spread(at((1 << 53) - n / 2 * mean, i, mean, random), random)
        })
    },
    usual("hours of silence between bursts", |i, _, random| {
        spread(i / 50 * 20_000_000_000 + at(0, i % 50, 20, random), random)
    }),
    usual("one pixel", |i, _, random| Event::new(at(0, i, 600, random), 120, 90, random.below(2) == 1)),
    usual("one instant", |_, _, random| spread(77, random)),
    usual("one pixel at one instant", |i, _, _| Event::new(77, 120, 90, i % 3 == 0)),
    Shape {
        sensor: Sensor { width: 256, height: 256 },
        ..usual("checkerboard of equal distances", |i, _, _| {
            let (x, y) = (i % 16, i / 16 % 16);
            Event::new(i / 256, (2 * x + y % 2) as u16 * 4, y as u16 * 4, (x + y) % 2 == 0)
        })
    },
    Shape {
        sensor: Sensor { width: 1, height: 1 },
        ..usual("sensor of one pixel", |i, _, random| Event::new(at(0, i, 600, random), 0, 0, i % 2 == 0))
    },
    Shape {
        sensor: Sensor { width: 4096, height: 4096 },
        ..usual("corners of 4096 x 4096", |i, _, random| {
            let end = |bit: i64| if i & bit == 0 { 0 } else { 4095 };
            Event::new(at(0, i, 600, random), end(1), end(2), random.below(2) == 1)
        })
    },
    Shape {
        sensor: Sensor { width: 65_535, height: 1 },
        ..usual("ends of 65535 x 1", |i, _, random| {
            Event::new(at(0, i, 600, random), if i % 2 == 0 { 0 } else { 65_534 }, 0, random.below(2) == 1)
        })
    },
];

/// The events of `shape`.
fn events(shape: &Shape, count: usize) -> Vec<Event> {
    let mut random = Random::new(1);
    let count = count as i64;
    let mut events: Vec<Event> = (0..count).map(|i| (shape.event)(i, count, &mut random)).collect();
    events.sort_by_key(|event| event.t_us);
    events
}

/// The shipped network `name` with capacity [`CAPACITY`].
pub(super) fn network(name: &str, weights: &Weights) -> Result<Network, VerifyError> {
    let (description, _) = meissner_run::model::describe(name)?;
    let network =
        description.network(weights).map_err(|source| RunError::weights(name.to_owned(), source))?;
    Ok(network.with_capacity(CAPACITY)?)
}

/// The shipped weights of `name`.
pub(super) fn weights(name: &str) -> Result<Weights, VerifyError> {
    Ok(meissner_run::model::weights(name, true, None)?.0)
}

/// The ordinary stream through `network`.
pub(super) fn ordinary(network: Network, size: Size) -> EventRun {
    let events = events(&ORDINARY, size.events);
    EventRun { network: Arc::new(network), norms: BTreeMap::new(), sensor: SENSOR, events }
}

/// `shape` through the shipped network `name`.
pub(super) fn prepare(shape: &Shape, name: &str, size: Size) -> Result<Prepared, VerifyError> {
    let shipped = network(name, &weights(name)?)?;
    let run = EventRun {
        network: Arc::new(shipped.clone().with_span_us(shape.span_us)?),
        norms: BTreeMap::new(),
        sensor: shape.sensor,
        events: events(shape, size.events),
    };
    let ordinary = Box::new(ordinary(shipped, size));
    Ok(Prepared { run: Box::new(run), expect: Expect::Finite, within: WITHIN, ordinary })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_in_order_and_on_their_sensor() {
        for shape in SHAPES {
            let events = events(shape, 640);
            assert!(events.is_sorted_by_key(|e| e.t_us), "{}", shape.name);
            assert!(events.iter().all(|e| shape.sensor.contains(e.x, e.y)), "{}", shape.name);
        }
    }
}
