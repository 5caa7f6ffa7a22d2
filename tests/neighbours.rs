//! Neighbourhoods against a second oracle that shares nothing with the project: a k-d tree.

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use meissner_engine::{Batch, Candidates, Event, GraphRule, Reach, Search, Sensor, Stream};
use meissner_tests::networks::NetworkShape;
use proptest::prelude::*;

const SENSOR: Sensor = Sensor { width: 48, height: 36 };
const SPAN_US: i64 = 5_000;

/// The neighbourhoods of all events, from a k-d tree over rounded positions: the tree proposes all points within a
/// little more than the distance of the k-th, exact differences decide.
fn by_tree(events: &[Event], k: usize) -> Vec<Vec<u32>> {
    let extents = [f64::from(SENSOR.width), f64::from(SENSOR.height), SPAN_US as f64];
    let coordinates = |e: &Event| [f64::from(e.x), f64::from(e.y), e.t_us as f64];
    let positions: Vec<[f64; 3]> =
        events.iter().map(|e| [0, 1, 2].map(|d| coordinates(e)[d] / extents[d])).collect();
    let tree: ImmutableKdTree<f64, 3> =
        ImmutableKdTree::new_from_slice(&positions).expect("finite positions");
    let exact = |i: usize, j: usize| {
        let (a, b) = (coordinates(&events[i]), coordinates(&events[j]));
        let [x, y, t] = [0, 1, 2].map(|d| ((a[d] - b[d]) / extents[d]).powi(2));
        x + y + t
    };
    (0..events.len())
        .map(|i| {
            let most = NonZeroUsize::new(k + 1).expect("above 0");
            let nearest = tree.query(&positions[i]).nearest_n::<SquaredEuclidean<f64>>(most).execute();
            let farthest = nearest.iter().map(|n| n.distance).fold(0.0, f64::max) * (1.0 + 1e-9) + 1e-18;
            let within = tree.query(&positions[i]).within::<SquaredEuclidean<f64>>(farthest).execute();
            let mut found: Vec<(f64, usize)> = within
                .iter()
                .map(|n| n.item as usize)
                .filter(|&j| j != i)
                .map(|j| (exact(i, j), j))
                .collect();
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            found.into_iter().take(k).map(|(_, j)| j as u32).collect()
        })
        .collect()
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let event = (0i64..40, 0u16..SENSOR.width, 0u16..SENSOR.height);
    (proptest::collection::vec(event, 1..400), prop_oneof![Just(1u16), Just(6), Just(48)]).prop_map(
        |(steps, spread)| {
            let mut t = 0;
            let place = |(dt, x, y): (i64, u16, u16)| {
                t += dt / 4;
                Event::new(t, x % spread, y % spread.min(SENSOR.height), dt % 2 == 0)
            };
            steps.into_iter().map(place).collect()
        },
    )
}

/// Clusters of events far apart, and some between them, on sensors of any size; spans up to a minute.
fn scenes() -> impl Strategy<Value = (Vec<Event>, Sensor, i64)> {
    let event = (0i64..40, 0u16..8, 0u16..12, 0u16..12, any::<bool>());
    let step_us = prop_oneof![3 => Just(1i64), 2 => Just(25), 1 => Just(20_000)];
    let sensor =
        prop_oneof![3 => Just((240, 180)), 1 => Just((4_096, 4_096)), 1 => (240..=u16::MAX, 180..=u16::MAX)];
    (proptest::collection::vec(event, 1..500), sensor, step_us).prop_map(
        |(steps, (width, height), step_us)| {
            let mut t = 1_000_000_000_000;
            let place = |(dt, cluster, x, y, on): (i64, u16, u16, u16, bool)| {
                t += dt / 4 * step_us;
                let [left, top] = [[3, 5], [60, 20], [200, 90], [225, 160]][usize::from(cluster % 4)];
                // In units of 240 columns and 180 rows but for the pixels of a cluster.
                let at = |corner: u16, pixel: u16, units: u16, extent: u16| {
                    let (pixel, scale) = (u32::from(pixel), u32::from(extent) / u32::from(units));
                    let wide = if cluster == 7 { 12 * scale } else { 1 };
                    (u32::from(corner) * scale + pixel * wide).min(u32::from(extent) - 1) as u16
                };
                Event::new(t, at(left, x, 240, width), at(top, y, 180, height), on)
            };
            (steps.into_iter().map(place).collect(), Sensor::new(width, height), 5_000 * step_us)
        },
    )
}

/// A network of which the graph alone matters: the `k` nearest of all nodes.
fn graph_alone(k: usize, span_us: i64) -> NetworkShape {
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k }, candidates: Candidates::All },
        span_us,
        capacity: 1_000,
        blocks: vec![],
        pooled: vec![],
        from: 0,
        grid: [1, 1],
        dense: vec![1],
        head: None,
        seed: 0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_grid_finds_what_comparing_all_pairs_finds((events, sensor, span_us) in scenes(), k in 1usize..=40) {
        let shape = graph_alone(k, span_us);
        let batch = Batch::new(shape.build(), sensor).expect("the sensor has pixels");
        let edges = |search| {
            let trace = batch.clone().with_search(search).forward(Stream::new(&events)).expect("finite");
            trace.levels[0].edges.clone()
        };
        prop_assert_eq!(edges(Search::Grid), edges(Search::Exhaustive));
    }

    #[test]
    fn neighbourhoods_are_those_of_a_k_d_tree(events in events(), k in 1usize..=24) {
        let shape = graph_alone(k, SPAN_US);
        let expected = by_tree(&events, k);
        for search in [Search::Exhaustive, Search::Grid] {
            let batch = Batch::new(shape.build(), SENSOR).expect("the sensor has pixels").with_search(search);
            let trace = batch.forward(Stream::new(&events)).expect("finite");
            let edges = &trace.levels[0].edges;
            let got: Vec<Vec<u32>> =
                (0..edges.rows()).map(|row| edges.row(row).iter().map(|n| n.row).collect()).collect();
            prop_assert_eq!(&got, &expected, "{:?}", search);
        }
    }
}
