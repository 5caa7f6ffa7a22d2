//! When predictions are read.

use crate::support::{argument, file, lines, meissner, nodes, times};

/// Predictions of the default network on `events`, lines of CSV.
fn read(events: &str, every: &str, more: &[&str]) -> Vec<serde_json::Value> {
    let (_folder, path) = file("events.csv", events);
    let arguments = [&["run", argument(&path), "--sensor", "8x8", "--every", every, "--json"], more].concat();
    lines(&meissner(&arguments)).0
}

#[test]
fn after_every_accepted_event() {
    let predictions = read("10,1,1,1\n12,9,1,1\n12,2,1,0\n15,3,1,1\n", "event", &[]);
    assert_eq!(times(&predictions), [Some(10), Some(12), Some(15)]);
    assert_eq!(nodes(&predictions), [1, 2, 3]);
}

#[test]
fn after_every_second_event_and_not_for_a_remainder() {
    let predictions = read("10,1,1,1\n12,2,1,1\n15,3,1,1\n", "2", &[]);
    assert_eq!(times(&predictions), [Some(12)]);
}

#[test]
fn at_the_end_of_nothing_there_is_a_prediction_without_a_time() {
    let predictions = read("t,x,y,p\n", "end", &[]);
    assert_eq!(times(&predictions), [None]);
    assert_eq!(nodes(&predictions), [0]);
}

#[test]
fn nothing_at_all_has_no_periods() {
    assert_eq!(times(&read("t,x,y,p\n", "10us", &[])), []);
}

#[test]
fn a_period_holds_the_event_at_its_end_and_the_last_one_covers_the_last_event() {
    let predictions = read("10,1,1,1\n20,2,1,1\n21,3,1,1\n22,4,1,1\n", "10us", &[]);
    assert_eq!(times(&predictions), [Some(20), Some(22)]);
    assert_eq!(nodes(&predictions), [2, 4]);
}

#[test]
fn in_a_gap_predictions_go_on_until_the_window_is_empty_and_resume_with_the_next_event() {
    let year_us = 31_557_600_000_000_i64;
    // A second event confirms the year.
    let events = format!("0,1,1,1\n5,2,1,1\n{0},3,1,1\n{0},4,1,1\n", year_us + 3);
    let predictions = read(&events, "10us", &["--span", "25us"]);
    assert_eq!(times(&predictions), [Some(5), Some(5), Some(5), Some(5), Some(year_us + 3)]);
    // Due at 10, 20, 30 (the event at 0 has left, the one at 5 is 25 us old), 40, and after the
    // year.
    assert_eq!(nodes(&predictions), [2, 2, 1, 0, 2]);
}

#[test]
fn the_limit_counts_events_taken() {
    for limit in [0, 1, 250] {
        let output = meissner(&["run", "--limit", &limit.to_string(), "--every", "event", "--json"]);
        let (predictions, summary) = lines(&output);
        assert_eq!(summary["events"], limit);
        assert_eq!(predictions.len(), limit);
    }
}
