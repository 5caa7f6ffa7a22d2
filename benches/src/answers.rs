//! Checks of answers. Every bench compares its answer before it times anything: the time of a wrong answer is no figure.

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use meissner_engine::{Batch, Engine, Event, Stream};
use meissner_kernels::{FeatureMap, Neighbour};

use crate::streams::{Recording, SPAN_US};

/// Distance of values from those expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Largest difference, relative to the largest expected magnitude.
    pub max: f64,
    /// Root of the mean squared difference, relative to that of the expected values.
    pub rms: f64,
    /// Largest difference, relative to the root of the mean of the squared expected values.
    pub max_by_rms: f64,
}

impl Deviation {
    /// Of `found` from `expected`, value by value. O(values).
    pub fn between<'a>(
        expected: impl IntoIterator<Item = &'a f32>,
        found: impl IntoIterator<Item = &'a f32>,
    ) -> Self {
        let (mut largest, mut magnitude, mut squares, mut energy, mut count) = (0f64, 0f64, 0f64, 0f64, 0u64);
        for (&expected, &found) in expected.into_iter().zip(found) {
            let (expected, difference) = (f64::from(expected), f64::from(found) - f64::from(expected));
            largest = largest.max(difference.abs());
            magnitude = magnitude.max(expected.abs());
            squares += difference * difference;
            energy += expected * expected;
            count += 1;
        }
        let max_by_rms = largest / (energy / count as f64).sqrt();
        Self { max: largest / magnitude, rms: (squares / energy).sqrt(), max_by_rms }
    }

    /// Of a map from the one expected.
    pub fn between_maps(expected: &FeatureMap, found: &FeatureMap) -> Self {
        let places = || (0..expected.height()).flat_map(|y| (0..expected.width()).map(move |x| (y, x)));
        let values = |map| places().flat_map(move |(y, x)| FeatureMap::pixel(map, y, x));
        Self::between(values(expected), values(found))
    }
}

/// Asserts that `engine`, which took all of `accepted` since its reset, predicts the same bits as the batch.
///
/// # Panics
/// If it does not.
pub fn engine_equals_batch(engine: &mut Engine, accepted: &[Event]) {
    let batch = Batch::new(engine.network().clone(), engine.sensor()).expect("the sensor has pixels");
    let expected = batch.forward(Stream::new(accepted)).expect("finite").prediction;
    let got = engine.predict().expect("finite").values;
    assert_eq!(bits(got), bits(&expected), "{}: engine and batch differ", engine.network().name());
}

/// Bit patterns of `values`.
pub fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Asserts that the neighbourhoods of `engine`, which took all of `accepted` since its reset, are the batch's.
///
/// # Panics
/// If one is not.
pub fn neighbourhoods_equal_batch(engine: &Engine, accepted: &[Event]) {
    let batch = Batch::new(engine.network().clone(), engine.sensor()).expect("the sensor has pixels");
    let trace = batch.forward(Stream::new(accepted)).expect("finite");
    let events = &trace.levels[0];
    let first = events.first as u32;
    assert_eq!(engine.nodes(), events.edges.rows() - events.first, "events in the window");
    for index in 0..engine.nodes() {
        // A frozen in-edge outlives its source, and the engine no longer reports it then.
        let present = events.edges.row(events.first + index).iter().filter(|n| n.row >= first);
        let expected: Vec<Neighbour> = present.map(|n| Neighbour { row: n.row - first, u: n.u }).collect();
        let got = engine.neighbourhood(index);
        assert_eq!(got, expected, "neighbourhood of event {index}");
    }
}

/// The `k` nearest other events of each event by kiddo's k-d tree, in the engine's order: nearer first, later first among
/// equals.
///
/// The tree works on rounded positions. It proposes all events within slightly more than the distance of the k-th; exact
/// distances from integer differences decide, as in the engine.
///
/// # Panics
/// If there are fewer than two events.
pub fn tree_neighbourhoods(recording: &Recording, k: usize) -> Vec<Vec<u32>> {
    let events = &recording.events;
    let extents = [f64::from(recording.sensor.width), f64::from(recording.sensor.height), SPAN_US as f64];
    let origin = events[0].t_us;
    let place = |e: &Event| {
        let axes = [f64::from(e.x), f64::from(e.y), (e.t_us - origin) as f64];
        [axes[0] / extents[0], axes[1] / extents[1], axes[2] / extents[2]]
    };
    let places: Vec<[f64; 3]> = events.iter().map(place).collect();
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&places).expect("finite positions");
    let exact = |a: &Event, b: &Event| {
        let x = f64::from(a.x.abs_diff(b.x)) / extents[0];
        let y = f64::from(a.y.abs_diff(b.y)) / extents[1];
        let t = (a.t_us - b.t_us) as f64 / extents[2];
        x * x + y * y + t * t
    };
    let most = NonZeroUsize::new(k + 1).expect("above 0");
    let mut found = Vec::new();
    let mut lists = Vec::with_capacity(events.len());
    for (i, place) in places.iter().enumerate() {
        let nearest = tree.query(place).nearest_n::<SquaredEuclidean<f64>>(most).execute();
        let farthest = nearest.iter().map(|n| n.distance).fold(0.0, f64::max);
        let around = farthest * (1.0 + 1e-9) + 1e-18;
        let within = tree.query(place).within::<SquaredEuclidean<f64>>(around).execute();
        found.clear();
        let others = within.iter().map(|n| n.item as usize).filter(|&j| j != i);
        found.extend(others.map(|j| (exact(&events[i], &events[j]), j as u32)));
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        lists.push(found.iter().take(k).map(|&(_, j)| j).collect());
    }
    lists
}
