//! A readout that keeps cells in time apart: what it holds, and that time alone can change it.
#![forbid(unsafe_code)]

use meissner_engine::{Event, Network, Search, Sensor};
use meissner_models::{Description, draw};
use meissner_verify::CheckedEngine;

use crate::network_text::NetworkText;

/// Cells of 100 us in a window of 300; the readout has four grids of one cell.
fn network() -> String {
    NetworkText::over_events("ages")
        .network("span_us = 300")
        .layer("pool", "pool", "cell = [\"1/1\", \"1/1\"]; time = \"1/3\"; scale = 0.5")
        .readout("grid = [1, 1]; by_time = true", &["a", "b", "c"], "1")
}

/// An engine beside a batch, for a network with drawn weights on 4 x 4 pixels.
pub(crate) fn checked(network: &str) -> CheckedEngine {
    let description = Description::parse(network).expect("consistent");
    let network: Network = description.network(&draw(&description, 5)).expect("drawn weights fit");
    CheckedEngine::new(network, Sensor::new(4, 4), Search::Exhaustive)
}

/// The readout's values from the newest cell in time to the oldest.
pub(crate) fn readout(checked: &mut CheckedEngine) -> Vec<f32> {
    checked.predict().expect("equal to batch");
    let readout = checked.batch.trace().expect("numbers").readout;
    let expected: Vec<Vec<f32>> = (0..readout.rows()).map(|row| readout.values(row).collect()).collect();
    assert_eq!(checked.engine.readout(), expected);
    expected.concat()
}

#[test]
fn what_time_moves_on_from_ages_and_leaves() {
    let mut checked = checked(&network());
    checked.push(Event::new(1_000, 1, 1, false));
    assert_eq!(readout(&mut checked), [-1.0, 0.0, 0.0, 0.0]);
    checked.push(Event::new(1_120, 1, 1, true));
    assert_eq!(readout(&mut checked), [1.0, -1.0, 0.0, 0.0]);
    checked.advance(1_300);
    assert_eq!(readout(&mut checked), [0.0, 0.0, 1.0, -1.0]);
    checked.advance(1_301);
    assert_eq!(readout(&mut checked), [0.0, 0.0, 1.0, 0.0]);
    checked.advance(1_400);
    assert_eq!(readout(&mut checked), [0.0, 0.0, 0.0, 1.0]);
    checked.advance(1_421);
    assert_eq!(readout(&mut checked), [0.0; 4]);
}

#[test]
fn the_prediction_follows_when_nothing_but_the_cell_in_time_changed() {
    let mut checked = checked(&network());
    checked.push(Event::new(0, 1, 1, true));
    let mut seen = vec![checked.predict().expect("equal to batch")];
    for now in [99, 100, 199, 200, 299, 300] {
        checked.advance(now);
        seen.push(checked.predict().expect("equal to batch"));
    }
    assert_eq!(seen[0], seen[1], "within a cell nothing ages");
    assert!(seen[1] != seen[2] && seen[3] != seen[4] && seen[5] != seen[6], "{seen:?}");
}

#[test]
fn a_reset_begins_with_the_cell_of_the_next_event() {
    let mut checked = checked(&network());
    checked.push(Event::new(0, 1, 1, true));
    checked.push(Event::new(250, 1, 1, true));
    checked.predict().expect("equal to batch");
    checked.reset();
    checked.push(Event::new(777, 2, 2, false));
    assert_eq!(readout(&mut checked), [-1.0, 0.0, 0.0, 0.0]);
}
