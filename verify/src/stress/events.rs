//! Networks over events that strain the arithmetic: incrementally, from scratch, and in f64.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{BatchEngine, Engine, EngineError, Event, Network, Search, Sensor, Trace};
use meissner_kernels::random::Random;
use meissner_models::Weights;
use meissner_reference::{BatchNorm, Difference, EventReference, EventTrace};
use meissner_run::RunError;

use super::{CaseResult, Errors, Expect, LayerError, Prepared, Run, Size, WITHIN};
use crate::checked::{CheckedEngine, poisoned};
use crate::error::VerifyError;

/// A network and a stream for it.
#[derive(Clone, Debug)]
pub(crate) struct EventRun {
    pub(crate) network: Arc<Network>,
    /// Batch norms before they were folded.
    pub(crate) norms: BTreeMap<String, BatchNorm>,
    pub(crate) sensor: Sensor,
    pub(crate) events: Vec<Event>,
}

/// Number of predictions of a stream that are compared with a batch.
const COMPARED: usize = 32;
/// One in so many of these is also computed in f64.
const PER_REFERENCE: usize = 8;

impl Run for EventRun {
    fn network(&self) -> String {
        self.network.name().to_owned()
    }

    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError> {
        let Self { network, norms, sensor, events } = self;
        let batch = BatchEngine::new(Arc::clone(network), *sensor)?;
        let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
        let mut checked = CheckedEngine::of(poisoned(Arc::clone(network), *sensor)?, batch);
        // No network under stress has a head.
        let reference = EventReference::new(Arc::clone(network), *sensor, None)?.with_norms(norms);
        let mut errors = LayerErrors::default();
        let stride = events.len().div_ceil(COMPARED);
        for (i, &event) in events.iter().enumerate() {
            checked.push(event);
            if (i + 1) % stride == 0 || i + 1 == events.len() {
                let trace = checked.batch.trace();
                let got = checked.engine.predict().map(|prediction| prediction.values.to_vec());
                result.compare(
                    &got,
                    &trace.as_ref().map(|trace| trace.prediction.clone()).map_err(Clone::clone),
                );
                let Ok(trace) = trace else { continue };
                // If the prediction differs, the difference is already counted there.
                result.different += u64::from(got.is_ok() && checked.compare_rows(&trace).is_err());
                if i + 1 == events.len() || (i + 1) / stride % PER_REFERENCE == 0 {
                    errors.add(network, &trace, &reference.forward(checked.batch.stream()));
                }
            }
        }
        result.steps = checked.engine.counters().events.accepted;
        errors.write(network, result);
        Ok(())
    }

    fn time_us(&self) -> Result<f64, EngineError> {
        let mut engine = Engine::new(Arc::clone(&self.network), self.sensor)?;
        let start = Instant::now();
        for &event in &self.events {
            engine.push(event);
            // A refused prediction is timed, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / self.events.len() as f64)
    }
}

/// Differences from f64.
#[derive(Default)]
struct LayerErrors {
    prediction: Difference,
    /// Differences of each feature that a block wrote, level by level.
    layers: BTreeMap<(usize, usize), Difference>,
}

impl LayerErrors {
    fn add(&mut self, network: &Network, got: &Trace, want: &EventTrace) {
        self.prediction.add_all(&got.prediction, &want.prediction);
        for (l, (got, want)) in got.levels.iter().zip(&want.levels).enumerate() {
            for b in 0..network.level(l).blocks.len() {
                let layer = self.layers.entry((l, b)).or_default();
                for row in got.first..got.features[b + 1].rows() {
                    let values: Vec<f32> = got.features[b + 1].values(row).collect();
                    layer.add_all(&values, &want.features[b + 1][row]);
                }
            }
        }
    }

    fn write(&self, network: &Network, result: &mut CaseResult) {
        if self.prediction.values > 0 {
            result.prediction = Some(Errors::from(&self.prediction));
        }
        let worst = self.layers.iter().max_by(|a, b| a.1.relative().total_cmp(&b.1.relative()));
        result.layer = worst.map(|(&(l, b), difference)| LayerError {
            layer: network.level(l).blocks[b].name.clone(),
            relative: difference.relative(),
        });
        result.largest_activation = self.layers.values().map(|layer| layer.largest).fold(0.0, f64::max);
        result.infinite_inside = self.layers.values().map(|layer| layer.infinite).sum();
    }
}

/// Networks with neighbours among all events, with one pooling and with three, and with neighbours
/// from the past, frozen and not.
pub(crate) const NETWORKS: [&str; 4] = ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"];
/// Maximum number of events in the window: below the number of events, so that some are evicted.
const CAPACITY: usize = 300;
/// Span of the shipped networks, in microseconds.
const SPAN: i64 = 150_000;
const SENSOR: Sensor = Sensor { width: 240, height: 180 };

/// A stream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) name: &'static str,
    span_us: i64,
    pub(crate) sensor: Sensor,
    /// Event `i` of `count` events.
    event: fn(i: i64, count: i64, &mut Random) -> Event,
}

/// An event anywhere on the sensor.
fn spread(t_us: i64, random: &mut Random) -> Event {
    Event::new(t_us, random.below(240) as u16, random.below(180) as u16, random.below(2) == 1)
}

/// Time `i` of a sequence that begins at `first` with steps of `mean` microseconds, give or take as
/// much.
fn at(first: i64, i: i64, mean: i64, random: &mut Random) -> i64 {
    first + i * mean + random.below(mean as u64 + 1) as i64
}

const fn usual(name: &'static str, event: fn(i64, i64, &mut Random) -> Event) -> Shape {
    Shape { name, span_us: SPAN, sensor: SENSOR, event }
}

/// The stream that others are compared with.
const ORDINARY: Shape = usual("ordinary", |i, _, random| spread(at(0, i, 600, random), random));

/// All streams.
pub(crate) const SHAPES: &[Shape] = &[
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
pub(crate) fn events(shape: &Shape, count: usize) -> Vec<Event> {
    let mut random = Random::new(1);
    let count = count as i64;
    let mut events: Vec<Event> = (0..count).map(|i| (shape.event)(i, count, &mut random)).collect();
    events.sort_by_key(|event| event.t_us);
    events
}

/// The shipped network `name` with capacity [`CAPACITY`], without its filters, because they would
/// drop most of the stressing events.
pub(crate) fn network(name: &str, weights: &Weights) -> Result<Network, VerifyError> {
    let (description, _) = meissner_run::model::describe(name)?;
    let network =
        description.network(weights).map_err(|source| RunError::weights(name.to_owned(), source))?;
    Ok(network.with_capacity(CAPACITY)?.with_filters(Vec::new())?)
}

/// The shipped weights of `name`.
pub(crate) fn weights(name: &str) -> Result<Weights, VerifyError> {
    Ok(meissner_run::model::weights(name, true, None)?.0)
}

/// The ordinary stream through `network`.
pub(crate) fn ordinary(network: Network, size: Size) -> EventRun {
    let events = events(&ORDINARY, size.events);
    EventRun { network: Arc::new(network), norms: BTreeMap::new(), sensor: SENSOR, events }
}

/// `shape` through the shipped network `name`.
pub(crate) fn prepare(shape: &Shape, name: &str, size: Size) -> Result<Prepared, VerifyError> {
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
