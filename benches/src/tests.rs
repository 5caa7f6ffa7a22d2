//! Costs that can be counted by hand, and the streams to which figures refer.

use meissner_engine::{Event, Sensor};
use meissner_kernels::{SplineConv, SplineParts};

use crate::cost::{dense, row_bytes, spline_row};
use crate::streams::{Recording, SPAN_US, WINDOW};

#[test]
fn a_row_of_the_published_fifth_block_is_counted_by_hand() {
    let weight = vec![0.5; 8 * 16 * 32];
    let parts = SplineParts { inputs: 16, outputs: 32, kernel: [2, 2, 2], weight, ..SplineParts::default() };
    let cost = spline_row(&SplineConv::new(&parts).unwrap(), 16, false);
    assert_eq!(cost.multiply_adds, 16 * 8 * 16 + 8 * 16 * 32);
    // Edges, neighbours' rows, weights, sums twice, and four rows of 32 values.
    assert_eq!(cost.bytes, 16 * 16 + 16 * 64 + 8 * 16 * 128 + 2 * 8 * 64 + 4 * 128);
}

#[test]
fn one_channel_moves_a_whole_lane() {
    assert_eq!(row_bytes(1), 32);
    assert_eq!(dense(1, 1, 1).multiply_adds, 1);
}

#[test]
fn the_synthetic_stream_is_accepted_whole_and_has_the_window() {
    let stream = Recording::synthetic(2 * WINDOW);
    assert!(stream.events.is_sorted_by_key(|e| e.t_us));
    assert!(stream.events.iter().all(|e| e.x < stream.sensor.width && e.y < stream.sensor.height));
    assert_eq!(stream.first_window(WINDOW, SPAN_US).map(<[Event]>::len), Some(WINDOW));
}

#[test]
fn the_window_of_the_tactile_recording_is_the_one_that_figures_refer_to() {
    let Some(recording) = Recording::load("tactile_dots") else {
        println!("skipped: no ../shared/data/events/tactile_dots.aedat4");
        return;
    };
    let window = recording.first_window(WINDOW, SPAN_US).unwrap();
    assert_eq!(window[WINDOW - 1], recording.events[8_462]);
    assert_eq!(window[0], recording.events[8_463 - WINDOW]);
}

#[test]
fn a_window_ends_with_the_event_that_fills_it() {
    let events = [0, 10, 100, 105, 110].map(|t| Event::new(t, 0, 0, true)).to_vec();
    let stream = Recording { name: String::new(), sensor: Sensor::new(1, 1), events };
    assert_eq!(stream.first_window(3, 10).map(|w| w[0].t_us), Some(100));
    assert_eq!(stream.first_window(4, 10), None);
}
