//! Incremental equals batch on real recordings, for every network that has an incremental form.

use meissner_engine::Search;
use meissner_models::{Description, Weights};
use meissner_tests::shared::shared;
use meissner_verify::CheckedEngine;

const EVENTS: usize = 20_000;
/// Events from one comparison of predictions to the next; the batch searches by its grid, which is fast and no oracle.
const EVERY: usize = 50;
/// Each of so many comparisons looks at every row, with neighbours from a k-d tree, and every other one from all pairs.
const WHOLE: usize = 10;

/// Pushes the recording's first events and compares.
fn compare(recording: &str, network: &str) {
    let path = shared(&format!("data/events/{recording}.aedat4"));
    let recording = meissner_io::read(&path).expect("a readable recording");
    let sensor = recording.sensor.expect("AEDAT4 names its geometry");
    let description = Description::shipped(network).expect("a shipped network");
    let weights = Weights::shipped(network).expect("shipped weights");
    let network = std::sync::Arc::new(description.network(&weights).expect("the weights fit"));
    let mut checked = CheckedEngine::new(std::sync::Arc::clone(&network), sensor, Search::Grid);
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
fn graphres_on_tactile_dots() {
    compare("tactile_dots", "graphres");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_on_davis346() {
    compare("davis346", "graphres");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_on_tactile_dots() {
    compare("tactile_dots", "tactigraph");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_on_davis346() {
    compare("davis346", "tactigraph");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_past_on_tactile_dots() {
    compare("tactile_dots", "tactigraph-past");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_past_on_davis346() {
    compare("davis346", "tactigraph-past");
}
