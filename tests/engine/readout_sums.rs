//! A readout that sums: what it holds, and which cells an event makes it sum again.
#![forbid(unsafe_code)]

use meissner_engine::{Aggregation, Event, Network};
use meissner_models::{Description, draw};
use meissner_verify::CheckedEngine;

use crate::network_text::NetworkText;
use crate::readout_by_time::{checked, readout};

/// Two cells side by side; the readout sums polarities over 300 us.
fn network() -> String {
    let keys = "grid = [2, 1]; aggregation = \"sum\"";
    NetworkText::over_events("sums").network("span_us = 300").readout(keys, &["a", "b", "c"], "1")
}

/// Cells that one more prediction recomputes.
fn recomputed(checked: &mut CheckedEngine) -> u64 {
    let before = checked.engine.counters().predictions.cells_recomputed;
    checked.predict().expect("equal to batch");
    checked.engine.counters().predictions.cells_recomputed - before
}

#[test]
fn sums_count_the_events_of_each_cell_while_they_are_in_the_window() {
    let mut checked = checked(&network());
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
    let mut checked = checked(&network());
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
    let mut checked = checked(&network());
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
