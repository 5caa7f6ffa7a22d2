//! Incremental equals batch, bit for bit: every row of every layer, over random networks, streams
//! and interleavings, and over real recordings.
//!
//! `MEISSNER_CASES` sets the number of cases (5,000 without it).

use meissner_engine::{Candidates, Event, GraphRule, Reach, Search, Sensor};
use meissner_models::{Description, Weights};
use meissner_tests::cases;
use meissner_tests::shared::shared;
use meissner_verify::networks::{NetworkShape, PoolShape};
use meissner_verify::{CheckedEngine, strategies};
use proptest::prelude::*;

/// A configuration that runs one in `of` cases.
fn config(of: u32) -> ProptestConfig {
    let all = cases(5_000);
    ProptestConfig { cases: all.cases.div_ceil(of), ..all }
}

proptest! {
    #![proptest_config(config(1))]

    #[test]
    fn incremental_equals_batch_bit_for_bit(shape in strategies::network(), script in prop_oneof![7 => strategies::script(120), 1 => strategies::script(700)]) {
        let mut checked = CheckedEngine::new(shape.build(), script.sensor, Search::Exhaustive);
        prop_assert_eq!(checked.run(&script), Ok(()));
        prop_assert_eq!(checked.refused, 0, "random networks compute numbers");
        // The grid of a batch exists for speed and gives the same rows.
        prop_assert_eq!(checked.compare_with(Search::Grid), Ok(()));
    }
}

proptest! {
    // Fewer cases, because each batch makes tables of all columns and rows.
    #![proptest_config(config(100))]

    /// The search of the graph uses larger cells there.
    #[test]
    fn incremental_equals_batch_bit_for_bit_on_large_sensors(shape in strategies::network(), script in strategies::script_on((70..=u16::MAX, 70..=u16::MAX), 60)) {
        let mut checked = CheckedEngine::new(shape.build(), script.sensor, Search::Exhaustive);
        prop_assert_eq!(checked.run(&script), Ok(()));
    }
}

/// Found by the property test: centres of coarse cells in time spread over more cells of a finer
/// level above than a window can fill.
#[test]
fn cells_in_time_above_coarser_cells_in_time_do_not_share_a_slot() {
    let pool =
        |time| PoolShape { from: 0, cell: [(1, 1), (1, 1)], time: Some(time), mean: false, blocks: vec![] };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates: Candidates::All },
        span_us: 128,
        capacity: 3,
        place: None,
        blocks: vec![],
        pooled: vec![pool((2, 1)), pool((3, 4)), pool((1, 4))],
        from: 0,
        grid: [1, 1],
        dense: vec![1],
        head: None,
        seed: 0,
    };
    let mut checked = CheckedEngine::new(shape.build(), Sensor::new(1, 1), Search::Exhaustive);
    for t in [0, 189, 219, 240, 256, 256, 256, 256, 256, 256] {
        checked.push(Event::new(t, 0, 0, false));
        assert_eq!(checked.compare(), Ok(()));
    }
}

const SHIPPED: [&str; 3] = ["graphres", "tactigraph", "tactigraph-past"];
const EVENTS: usize = 20_000;
/// Events from one comparison with a batch that searches by its grid to the next.
const EVERY: usize = 50;
/// One in so many comparisons checks every row, with another search.
const WHOLE: usize = 10;

/// Pushes the recording's first events and compares.
fn compare(recording: &str, network: &str) {
    let path = shared(&format!("data/events/{recording}.aedat4"));
    let recording = meissner_io::read(&path).expect("a readable recording");
    let sensor = recording.sensor.expect("AEDAT4 names its geometry");
    let description = Description::shipped(network).expect("a shipped network");
    let weights = Weights::shipped(network).expect("shipped weights");
    let network = description.network(&weights).expect("the weights fit");
    let mut checked = CheckedEngine::new(network, sensor, Search::Grid);
    for (i, &event) in recording.events.iter().take(EVENTS).enumerate() {
        checked.push(event);
        if i % (EVERY * WHOLE) == 0 {
            let all_pairs = i % (2 * EVERY * WHOLE) == 0;
            let oracle =
                if all_pairs { Search::Exhaustive } else { Search::Proposed(meissner_reference::PROPOSE) };
            checked.compare_with(oracle).unwrap_or_else(|e| panic!("event {i}: {e}"));
        } else if i % EVERY == 0 {
            checked.predict().unwrap_or_else(|e| panic!("event {i}: {e}"));
        }
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn shipped_networks_on_tactile_dots() {
    for network in SHIPPED {
        compare("tactile_dots", network);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn shipped_networks_on_davis346() {
    for network in SHIPPED {
        compare("davis346", network);
    }
}
