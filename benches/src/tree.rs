//! Neighbourhoods by somebody else's k-d tree, put into the engine's exact order.

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use meissner_engine::Event;

use crate::streams::{Recording, SPAN_US};

/// The `k` nearest of all other events for each, in the engine's order: nearer first, later first among equals.
///
/// The tree works on rounded positions. It proposes everything within a little more than the distance of the k-th;
/// differences of integers decide, as in the engine.
///
/// # Panics
/// If there are fewer than two events.
pub fn neighbourhoods(recording: &Recording, k: usize) -> Vec<Vec<u32>> {
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
