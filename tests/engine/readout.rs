//! Readouts: one that keeps cells in time apart, and one that sums.
#![forbid(unsafe_code)]

use meissner_engine::{Aggregation, Event, Network, Search, Sensor};
use meissner_models::{Description, draw};
use meissner_verify::CheckedEngine;

use crate::network_text::NetworkText;

/// Cells of 100 us in a window of 300; the readout has four grids of one cell.
fn ages() -> String {
    NetworkText::over_events("ages")
        .network("span_us = 300")
        .layer("pool", "pool", "cell = [\"1/1\", \"1/1\"]; time = \"1/3\"; scale = 0.5")
        .readout("grid = [1, 1]; by_time = true", &["a", "b", "c"], "1")
}

/// An engine beside a batch, for a network with drawn weights on 4 x 4 pixels.
fn checked(network: &str) -> CheckedEngine {
    let description = Description::parse(network).expect("consistent");
    let network: Network = description.network(&draw(&description, 5)).expect("drawn weights fit");
    CheckedEngine::new(network, Sensor::new(4, 4), Search::Exhaustive)
}

/// The readout's values from the newest cell in time to the oldest.
fn readout(checked: &mut CheckedEngine) -> Vec<f32> {
    checked.predict().expect("equal to batch");
    let readout = checked.batch.trace().expect("numbers").readout;
    let expected: Vec<Vec<f32>> = (0..readout.rows()).map(|row| readout.values(row).collect()).collect();
    assert_eq!(checked.engine.readout(), expected);
    expected.concat()
}

#[test]
fn what_time_moves_on_from_ages_and_leaves() {
    let mut checked = checked(&ages());
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
    let mut checked = checked(&ages());
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
    let mut checked = checked(&ages());
    checked.push(Event::new(0, 1, 1, true));
    checked.push(Event::new(250, 1, 1, true));
    checked.predict().expect("equal to batch");
    checked.reset();
    checked.push(Event::new(777, 2, 2, false));
    assert_eq!(readout(&mut checked), [-1.0, 0.0, 0.0, 0.0]);
}

/// Two cells side by side; the readout sums polarities over 300 us.
fn sums() -> String {
    let keys = "grid = [2, 1]; aggregation = \"sum\"";
    NetworkText::over_events("sums").network("span_us = 300").readout(keys, &["a", "b", "c"], "1")
}

/// Number of cells that one more prediction recomputes.
fn recomputed(checked: &mut CheckedEngine) -> u64 {
    let before = checked.engine.counters().predictions.cells_recomputed;
    checked.predict().expect("equal to batch");
    checked.engine.counters().predictions.cells_recomputed - before
}

#[test]
fn sums_count_the_events_of_each_cell_while_they_are_in_the_window() {
    let mut checked = checked(&sums());
    for (t_us, x, on) in
        [(1_000, 0, true), (1_001, 1, true), (1_002, 3, false), (1_100, 0, true), (1_100, 3, false)]
    {
        checked.push(Event::new(t_us, x, 1, on));
    }
    assert_eq!(readout(&mut checked), [3.0, -2.0]);
    checked.advance(1_301);
    assert_eq!(readout(&mut checked), [2.0, -2.0]);
    checked.advance(1_401);
    assert_eq!(readout(&mut checked), [0.0, 0.0]);
}

#[test]
fn only_the_cell_of_an_event_is_summed_when_it_enters_and_when_it_leaves() {
    let mut checked = checked(&sums());
    checked.push(Event::new(0, 0, 0, true));
    checked.push(Event::new(10, 3, 0, true));
    assert_eq!(recomputed(&mut checked), 2);
    checked.push(Event::new(20, 0, 0, false));
    assert_eq!(recomputed(&mut checked), 1, "the cell that the event enters");
    checked.advance(301);
    assert_eq!(recomputed(&mut checked), 1, "the cell that the first event leaves");
    checked.advance(302);
    assert_eq!(recomputed(&mut checked), 0, "nothing happened");
}

#[test]
fn an_event_that_comes_and_goes_between_predictions_leaves_no_trace() {
    let mut checked = checked(&sums());
    checked.push(Event::new(0, 0, 0, true));
    checked.advance(301);
    checked.push(Event::new(302, 3, 3, true));
    assert_eq!(recomputed(&mut checked), 1);
    assert_eq!(readout(&mut checked), [0.0, 1.0]);
}

#[test]
fn a_sum_above_a_pooling_is_refused() {
    let description = Description::shipped("graphres").expect("a shipped network");
    let network = description.network(&draw(&description, 5)).expect("drawn weights fit");
    let mut parts = network.parts().clone();
    parts.readout.aggregation = Aggregation::Sum;
    let error = Network::new(parts).expect_err("pooled nodes have no order of arrival");
    assert_eq!(error.to_string(), "layer \"readout\": poolings below a sum: expected 0, found 1");
}
