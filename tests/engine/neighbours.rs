//! Neighbourhoods of all pairs against two other searches: a k-d tree, and the engine's grid.

use meissner_engine::{Batch, Candidates, Event, GraphRule, Lifetime, Reach, Search, Sensor, Stream};
use meissner_reference::{PROPOSE, from_tree};
use meissner_verify::Random;
use meissner_verify::networks::NetworkShape;
use proptest::prelude::*;

const SENSOR: Sensor = Sensor { width: 48, height: 36 };
const SPAN_US: i64 = 5_000;

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

/// Clusters of events far apart, and some between them; spans up to a minute.
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
                // In units of 240 columns and 180 rows, except for the pixels of a cluster.
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

/// A network that is used only for its graph: the `k` nearest of all nodes.
fn graph_alone(k: usize, span_us: i64) -> NetworkShape {
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k }, candidates: Candidates::All },
        span_us,
        capacity: 1_000,
        place: None,
        blocks: vec![],
        pooled: vec![],
        from: 0,
        grid: [1, 1],
        dense: vec![1],
        head: None,
        seed: 0,
    }
}

fn rule() -> impl Strategy<Value = GraphRule> {
    let reach = prop_oneof![
        (1usize..=24).prop_map(|k| Reach::Knn { k }),
        (0.01f64..1.5, 1usize..=24).prop_map(|(r, max)| Reach::Radius { r, max }),
    ];
    let candidates = prop_oneof![
        Just(Candidates::All),
        Just(Candidates::Past(Lifetime::Window)),
        Just(Candidates::Past(Lifetime::Frozen)),
    ];
    (reach, candidates).prop_map(|(reach, candidates)| GraphRule { reach, candidates })
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
    fn a_k_d_tree_gives_the_neighbourhoods_of_all_pairs_under_every_rule(
        events in events(),
        graph in rule(),
        capacity in prop_oneof![Just(1_000usize), 1usize..60],
        epoch in prop_oneof![Just(0i64), Just(1_700_000_000_000_000)],
    ) {
        let shape = NetworkShape { graph, capacity, ..graph_alone(1, SPAN_US) };
        let batch = Batch::new(shape.build(), SENSOR).expect("the sensor has pixels");
        let events: Vec<Event> = events.iter().map(|e| Event { t_us: e.t_us + epoch, ..*e }).collect();
        let edges = |search| {
            let trace = batch.clone().with_search(search).forward(Stream::new(&events)).expect("finite");
            trace.levels[0].edges.clone()
        };
        let expected = edges(Search::Exhaustive);
        prop_assert_eq!(edges(Search::Proposed(from_tree)), expected.clone());
        prop_assert_eq!(edges(Search::Proposed(PROPOSE)), expected.clone());
        prop_assert_eq!(edges(Search::Grid), expected);
    }
}

/// A thousand events, hundreds of which share pixel and time, and a few thousand at all distances.
#[test]
fn a_k_d_tree_takes_equal_coordinates_and_windows_of_thousands() {
    let mut random = Random::new(5);
    let mut t_us = 0;
    let events: Vec<Event> = (0..3_000)
        .map(|i| {
            t_us += random.below(9) as i64 / 6;
            let mut pixel = |side: u16| if i % 3 == 0 { 7 } else { random.below(side.into()) as u16 };
            let (x, y) = (pixel(SENSOR.width), pixel(SENSOR.height));
            Event::new(t_us, x, y, i % 2 == 0)
        })
        .collect();
    for candidates in
        [Candidates::All, Candidates::Past(Lifetime::Window), Candidates::Past(Lifetime::Frozen)]
    {
        let shape = NetworkShape {
            graph: GraphRule { reach: Reach::Knn { k: 16 }, candidates },
            capacity: 2_500,
            ..graph_alone(16, SPAN_US)
        };
        let batch = Batch::new(shape.build(), SENSOR).expect("the sensor has pixels");
        let edges = |search| {
            let trace = batch.clone().with_search(search).forward(Stream::new(&events)).expect("finite");
            trace.levels[0].edges.clone()
        };
        assert!(edges(Search::Proposed(PROPOSE)) == edges(Search::Exhaustive), "{candidates:?}");
    }
}
