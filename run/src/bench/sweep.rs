//! How the cost of an event grows: one quantity after the other is varied, the others stay
//! constant.
//!
//! Input: the text of a description. Output: times, rows and memory for each value, and how they
//! grow. Events are uniform over the sensor and evenly spaced in time; weights are random. So only
//! the varied value differs between two points.

use std::time::Instant;

use meissner_engine::{Engine, Event, Options, Sensor};
use meissner_kernels::random::Random;
use meissner_models::description::Sizes;
use meissner_models::{Description, ModelError, draw};
use serde::Serialize;

use crate::error::{Result, RunError};
use crate::latency::{Distribution, Latency};
use crate::model::Model;
use crate::provenance::{Header, InputCard};

/// Events in the window if their number is not varied.
const WINDOW: usize = 10_000;
/// The period of a controller.
const DEADLINE_US: f64 = 1000.0;

/// A varied quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Events in the window, at a constant length of the window.
    Window,
    /// Events per second, at a constant number of events in the window: the window gets shorter.
    Rate,
    /// Maximum number of neighbours of an event.
    Neighbours,
    /// Channels of every block, as a factor.
    Channels,
    /// Pixels of the sensor, at a constant number of events in the window.
    Sensor,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 5] = [Self::Window, Self::Rate, Self::Neighbours, Self::Channels, Self::Sensor];

    /// The name of the quantity, with its unit.
    pub fn title(self) -> &'static str {
        match self {
            Self::Window => "events in the window",
            Self::Rate => "events a second",
            Self::Neighbours => "neighbours of an event",
            Self::Channels => "channels, as a factor",
            Self::Sensor => "pixels of the sensor",
        }
    }

    /// Its values, as scenes.
    fn scenes(self, usual: &Scene) -> Vec<(f64, Scene)> {
        let scene = |value: f64| {
            let mut scene = *usual;
            match self {
                Self::Window => scene.sizes.capacity = value as usize + 1,
                Self::Rate => scene.sizes.span_us = (usual.window() as f64 / value * 1e6) as i64,
                Self::Neighbours => scene.sizes.neighbours = Some(value as usize),
                Self::Channels => scene.sizes.channels = value,
                Self::Sensor => {
                    let side = (value / usual.pixels()).sqrt();
                    let scaled = |pixels: u16| (f64::from(pixels) * side).round().max(1.0) as u16;
                    scene.sensor = Sensor::new(scaled(usual.sensor.width), scaled(usual.sensor.height));
                }
            }
            (if self == Self::Sensor { scene.pixels() } else { value }, scene)
        };
        let values: &[f64] = match self {
            Self::Window => &[1e3, 3e3, 1e4, 3e4, 1e5],
            Self::Rate => &[1e4, 1e5, 1e6, 1e7],
            Self::Neighbours => &[4.0, 8.0, 16.0, 32.0],
            Self::Channels => &[0.5, 1.0, 2.0, 4.0],
            Self::Sensor => &[1e4, 3e4, 1e5, 3e5, 1e6],
        };
        values.iter().copied().map(scene).collect()
    }
}

/// Options of a sweep.
#[derive(Clone, Debug)]
pub struct SweepOptions {
    /// The quantities, one after the other.
    pub quantities: Vec<Quantity>,
    /// The sensor if its pixels are not varied.
    pub sensor: Sensor,
    /// Events that are timed for each value, with a prediction after each; at least 1.
    pub events: usize,
    /// Seed of events and weights.
    pub seed: u64,
}

/// A stream, and the sizes of the network that reads it.
#[derive(Clone, Copy, Debug)]
struct Scene {
    sizes: Sizes,
    sensor: Sensor,
}

impl Scene {
    /// Events in the window: one less than it can hold, so that events leave it by their age.
    fn window(&self) -> usize {
        self.sizes.capacity - 1
    }

    fn pixels(&self) -> f64 {
        f64::from(self.sensor.width) * f64::from(self.sensor.height)
    }

    /// Events a second.
    fn rate(&self) -> f64 {
        self.window() as f64 / self.sizes.span_us as f64 * 1e6
    }

    /// Events `from`..`to` of the stream.
    fn events(&self, random: &mut Random, from: usize, to: usize) -> Vec<Event> {
        let Sensor { width, height, .. } = self.sensor;
        let place = |random: &mut Random, pixels: u16| random.below(u64::from(pixels)) as u16;
        (from..to)
            .map(|i| {
                let t_us = (i as f64 / self.rate() * 1e6) as i64;
                let (x, y) = (place(random, width), place(random, height));
                Event::new(t_us, x, y, random.bits().is_multiple_of(2))
            })
            .collect()
    }
}

/// The report of a sweep.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SweepReport {
    pub header: Header,
    pub isa: &'static str,
    pub seed: u64,
    /// Events that were timed for each value.
    pub events: usize,
    /// Events in the window, and events per second, if they are not varied.
    pub window: usize,
    pub rate_events_per_s: f64,
    pub curves: Vec<Curve>,
}

/// The costs along one quantity.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Curve {
    /// The varied quantity.
    pub quantity: Quantity,
    /// Its values in ascending order.
    pub points: Vec<Point>,
    /// How the costs grow.
    pub slopes: Slopes,
    /// The first value at which an event costs more time than passes until the next one.
    pub behind_at: Option<f64>,
    /// The first value at which one event of 100 takes longer than 1 ms.
    pub late_at: Option<f64>,
}

/// The costs at one value.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Point {
    pub value: f64,
    /// Events in the window at the end.
    pub nodes: usize,
    pub rate_events_per_s: f64,
    /// A push with the prediction after it.
    pub latency_us: Distribution,
    /// Rows of all layers.
    pub rows_per_event: f64,
    /// Size of the state of a new engine.
    pub state_bytes: u64,
}

/// Exponents: a cost grows as the quantity to this power. Least squares over the logarithms; `None`
/// if there are fewer than two values, or a cost is 0.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the names of the costs")]
pub struct Slopes {
    pub p50: Option<f64>,
    pub p99: Option<f64>,
    pub rows: Option<f64>,
    pub state_bytes: Option<f64>,
}

/// Measures the network of the description `text`.
///
/// Complexity: for each value, pushes of two windows of events, and `options.events` predictions.
///
/// # Errors
/// The description cannot be read, or has no incremental form.
///
/// # Panics
/// If no event is to be timed.
pub fn sweep(text: &str, options: &SweepOptions) -> Result<SweepReport> {
    assert!(options.events > 0, "no event to time");
    let described = |source| RunError::description("the network".to_owned(), ModelError::Description(source));
    let description = Description::parse(text).map_err(described)?;
    let sizes =
        Sizes { span_us: description.span_us(), capacity: WINDOW + 1, neighbours: None, channels: 1.0 };
    let usual = Scene { sizes, sensor: options.sensor };
    let model = |scene: &Scene| {
        let resized = Description::resized(text, &scene.sizes).map_err(described)?;
        let label = format!("drawn, seed {}", options.seed);
        Model::of(&resized, (&draw(&resized, options.seed), label), false)
    };
    let input = InputCard::events("uniform events", &"drawn", options.sensor, None);
    let header = Header::new("sweep", input, model(&usual)?.card);
    let measured = |(value, scene): (f64, Scene)| point(value, &scene, model(&scene)?, options);
    let curve = |&quantity: &Quantity| {
        let points: Result<_> = quantity.scenes(&usual).into_iter().map(measured).collect();
        Ok(Curve::new(quantity, points?))
    };
    let curves = options.quantities.iter().map(curve).collect::<Result<_>>()?;
    Ok(SweepReport {
        header,
        isa: Options::default().isa.name(),
        seed: options.seed,
        events: options.events,
        window: usual.window(),
        rate_events_per_s: usual.rate(),
        curves,
    })
}

/// Fills the window of `scene`, then times events with a prediction after each.
fn point(value: f64, scene: &Scene, model: Model, options: &SweepOptions) -> Result<Point> {
    let mut engine = Engine::new(model.network, scene.sensor)?;
    let state_bytes = u64::try_from(engine.state_bytes()).unwrap_or(u64::MAX);
    // The first prediction computes every row, and nothing expires before one span is over.
    let (random, filled) = (&mut Random::new(options.seed), 2 * scene.window());
    engine.push_all(scene.events(random, 0, filled));
    engine.predict()?;
    let (mut latency, mut rows) = (Latency::new(), 0);
    for event in scene.events(random, filled, filled + options.events) {
        let start = Instant::now();
        engine.push(event);
        let prediction = engine.predict();
        latency.record(start.elapsed());
        rows += prediction?.rows.iter().sum::<u64>();
    }
    Ok(Point {
        value,
        nodes: engine.nodes(),
        rate_events_per_s: scene.rate(),
        latency_us: latency.distribution().expect("an event was timed"),
        rows_per_event: rows as f64 / options.events as f64,
        state_bytes,
    })
}

impl Curve {
    fn new(quantity: Quantity, points: Vec<Point>) -> Self {
        let slope = |cost: fn(&Point) -> f64| {
            slope(&points.iter().map(|point| (point.value, cost(point))).collect::<Vec<_>>())
        };
        let slopes = Slopes {
            p50: slope(|point| point.latency_us.quantiles.p50),
            p99: slope(|point| point.latency_us.quantiles.p99),
            rows: slope(|point| point.rows_per_event),
            state_bytes: slope(|point| point.state_bytes as f64),
        };
        let first = |is: fn(&Point) -> bool| points.iter().find(|point| is(point)).map(|point| point.value);
        let behind_at = first(|point| point.latency_us.mean * point.rate_events_per_s > 1e6);
        let late_at = first(|point| point.latency_us.quantiles.p99 > DEADLINE_US);
        Self { quantity, points, slopes, behind_at, late_at }
    }
}

/// The slope of the line through the logarithms of `points`.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 2 || points.iter().any(|&(x, y)| x <= 0.0 || y <= 0.0) {
        return None;
    }
    let logarithms = points.iter().map(|&(x, y)| (x.ln(), y.ln()));
    let count = points.len() as f64;
    let (sum_x, sum_y) = logarithms.clone().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let (mut with_y, mut with_x) = (0.0, 0.0);
    for (x, y) in logarithms {
        with_y += (x - mean_x) * (y - mean_y);
        with_x += (x - mean_x) * (x - mean_x);
    }
    (with_x > 0.0).then(|| with_y / with_x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swept(network: &str, quantities: &[Quantity]) -> SweepReport {
        let options =
            SweepOptions { quantities: quantities.to_vec(), sensor: Sensor::new(64, 48), events: 4, seed: 3 };
        let text = Description::shipped_text(network).unwrap();
        sweep(text, &options).unwrap()
    }

    #[test]
    fn a_slope_is_the_power_of_a_quantity() {
        let power = |p: f64| (1..6).map(|x| (f64::from(x), 3.0 * f64::from(x).powf(p))).collect::<Vec<_>>();
        assert!((slope(&power(1.5)).unwrap() - 1.5).abs() < 1e-12);
        assert!(slope(&power(0.0)).unwrap().abs() < 1e-12);
        assert_eq!(slope(&[(1.0, 2.0)]), None);
        assert_eq!(slope(&[(1.0, 2.0), (2.0, 0.0)]), None);
        assert_eq!(slope(&[(2.0, 2.0), (2.0, 1.0)]), None);
    }

    #[test]
    fn values_change_their_quantity_and_nothing_else() {
        let report = swept("tactigraph-past", &[Quantity::Rate, Quantity::Channels, Quantity::Sensor]);
        let [rate, channels, sensor] = &report.curves[..] else { panic!("{report:?}") };
        for point in report.curves.iter().flat_map(|curve| &curve.points) {
            // An event that is as old as the window's length has left the window.
            assert!((9_999..=10_001).contains(&point.nodes), "{point:?}");
            assert_eq!(point.latency_us.count, 4);
        }
        let rates: Vec<_> = rate.points.iter().map(|point| point.rate_events_per_s.round()).collect();
        assert_eq!(rates, [1e4, 1e5, 1e6, 1e7]);
        // An event of the past computes one row of each of three blocks.
        let rows = channels.points.iter().map(|point| point.rows_per_event);
        assert_eq!(rows.collect::<Vec<_>>(), [3.0; 4]);
        assert!(channels.slopes.state_bytes.unwrap() > 0.1 && sensor.points[0].value > 9_000.0);
        assert_eq!(rate.slopes.rows, Some(0.0));
    }

    #[test]
    fn neighbours_are_those_of_the_graph() {
        let report = swept("graphres", &[Quantity::Neighbours]);
        let rows: Vec<_> = report.curves[0].points.iter().map(|point| point.rows_per_event).collect();
        assert!(rows.is_sorted() && rows[3] > 2.0 * rows[0], "{rows:?}");
    }
}
