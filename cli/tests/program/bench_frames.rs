//! `bench` of frame networks, and against them: counts and bits that fit together, independent of
//! times.

use serde_json::Value;

use crate::support::{argument, default_recording, file, keys, meissner, message, text};

/// Two presses on 8 x 6 pixels with a silence between, the last event at 200 ms.
const PRESSES: &str = "# sensor 8x6\n0,1,1,1\n100,2,2,1\n9000,3,3,0\n30000,3,3,1\n200000,7,5,0\n";

fn object(arguments: &[&str]) -> Value {
    crate::support::object(&meissner(arguments))
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is a count"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is a number"))
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().expect("a list")
}

fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "expected {expected}, found {found}");
}

/// The comparison of tactigraph-past with the baseline of the contact-angle paper over `events`.
fn compare(events: &str, more: &[&str]) -> Value {
    let (_folder, path) = file("events.csv", events);
    let arguments =
        ["bench", argument(&path), "--network", "tactigraph-past", "--compare", "event-frame-cnn", "--json"];
    object(&[&arguments[..], more].concat())
}

#[test]
fn all_ways_predict_at_the_same_moments_and_both_over_frames_with_the_same_bits() {
    let report = compare(PRESSES, &[]);
    assert_eq!((count(&report["moments"]), number(&report["stream_s"])), (20, 0.2));
    let ways = &report["ways"];
    assert_eq!(keys(ways), "events frames_everything frames_skipping");
    for way in ["events", "frames_everything", "frames_skipping"] {
        assert_eq!((way, count(&ways[way]["predictions"])), (way, 20));
        assert_eq!((way, count(&ways[way]["moment_us"]["count"])), (way, 20));
    }
    assert_eq!(ways["events"]["frames"], Value::Null);
    assert_eq!([&ways["frames_everything"]["frames"], &ways["frames_skipping"]["frames"]], [20, 20]);
    assert_eq!(report["predictions_that_differ"], 0);
}

#[test]
fn a_comparison_of_a_whole_recording_has_the_same_bits_with_skipping() {
    let recording = default_recording();
    let arguments = ["bench", argument(&recording), "--compare", "event-frame-cnn", "--every", "20000us"];
    let report = object(&[&arguments[..], &["--limit", "3000", "--warmup", "0", "--json"]].concat());
    assert_eq!(report["predictions_that_differ"], 0);
    assert!(count(&report["accepted"]) == 3000 && count(&report["moments"]) > 1, "{report}");
}

#[test]
fn everything_is_all_multiply_adds_but_of_pixels_that_no_pooling_reads_and_skipping_is_fewer() {
    let report = compare(PRESSES, &[]);
    let (ways, frame) = (&report["ways"], count(&report["multiply_adds_per_frame"]));
    let everything = count(&ways["frames_everything"]["multiply_adds"]);
    // An odd last row or column is left out by the pooling, and not convolved for it.
    assert!(everything <= 20 * frame && everything > 19 * frame, "{everything} of {}", 20 * frame);
    let skipping = count(&ways["frames_skipping"]["multiply_adds"]);
    assert!(skipping > 0 && skipping < frame, "{skipping} of {frame}");
    let ratio = number(&report["multiply_adds_ratio_percent"]["frames_everything"]);
    assert_close(ratio, count(&ways["events"]["multiply_adds"]) as f64 / everything as f64 * 100.0);
}

#[test]
fn compute_is_the_sum_of_its_parts_and_the_ratio_that_of_compute() {
    let report = compare(PRESSES, &["--repeat", "2"]);
    let ways = &report["ways"];
    for way in ["events", "frames_everything", "frames_skipping"] {
        let (way, compute_s) = (&ways[way], number(&ways[way]["compute_s"]));
        let push_s = way["push_s"].as_f64().unwrap_or(0.0);
        assert_close(number(&way["events_s"]) + push_s + number(&way["predict_s"]), compute_s);
        assert_close(number(&way["compute_s_per_s"]), compute_s / 0.2);
    }
    for way in ["frames_everything", "frames_skipping"] {
        let expected = number(&ways["events"]["compute_s"]) / number(&ways[way]["compute_s"]) * 100.0;
        assert_close(number(&report["ratio_percent"][way]), expected);
    }
}

#[test]
fn a_part_of_a_recording_begins_and_ends_where_it_is_asked_to() {
    let report = compare(PRESSES, &["--from", "9ms", "--for", "100ms"]);
    assert_eq!((count(&report["events"]), count(&report["moments"])), (2, 3));
    assert_eq!(report["part"], "from 0.009 s on, for 0.1 s");
    let (_folder, path) = file("events.csv", PRESSES);
    let report = object(&["bench", argument(&path), "--for", "9ms", "--json"]);
    assert_eq!(report["events"], 2);
}

#[test]
fn frames_larger_than_the_sensor_are_padded_and_smaller_ones_leave_events_out() {
    let padded = compare(PRESSES, &[]);
    assert_eq!((&padded["padded"], &padded["outside_frames"]), (&Value::Bool(true), &Value::from(0)));
    assert!(padded["field"].as_str().is_some_and(|field| field.contains("zeros")), "{}", padded["field"]);
    let cropped = compare("# sensor 640x480\n0,345,259,1\n10,346,0,1\n20,0,260,0\n", &[]);
    assert_eq!((&cropped["padded"], &cropped["outside_frames"]), (&Value::Bool(false), &Value::from(2)));
    assert_eq!(cropped["ways"]["events"]["predictions"], 1);
}

#[test]
fn dropped_events_reach_no_way() {
    let report = compare("t,x,y,p\n0,1,1,1\n100,9,9,1\n50000,3,3,0\n40000,3,3,0\n", &["--sensor", "8x6"]);
    assert_eq!((count(&report["events"]), count(&report["accepted"])), (4, 2));
    assert_eq!((count(&report["dropped"]["outside_sensor"]), count(&report["dropped"]["late"])), (1, 1));
    assert_eq!((count(&report["moments"]), &report["predictions_that_differ"]), (5, &Value::from(0)));
}

#[test]
fn a_recording_without_events_has_nothing_to_compare_and_still_a_report() {
    let report = compare("# sensor 8x6\nt,x,y,p\n", &[]);
    assert_eq!((count(&report["moments"]), &report["ratio_percent"]["frames_skipping"]), (0, &Value::Null));
    let (_folder, path) = file("none.csv", "# sensor 8x6\nt,x,y,p\n");
    for more in [["--compare", "event-frame-cnn"], ["--network", "force-tdnn"]] {
        let output = meissner(&[&["bench", argument(&path), "--sensor", "346x260"][..], &more].concat());
        assert!(output.status.success(), "{}", message(&output));
    }
}

#[test]
fn the_comparison_names_every_part() {
    let (_folder, path) = file("events.csv", PRESSES);
    let output = meissner(&["bench", argument(&path), "--compare", "event-frame-cnn"]);
    let table = text(&output);
    for part in
        ["tactigraph-past", "event-frame-cnn", "events in % of", "frames, everything", "moments", "a bit"]
    {
        assert!(table.contains(part), "{part}: {table}");
    }
}

#[test]
fn a_frame_network_has_as_many_latencies_as_frames_and_pixels_that_add_up() {
    let (_folder, path) = file("events.csv", "# sensor 128x128\n0,60,60,1\n5000,61,60,0\n55000,50,60,1\n");
    let arguments = ["bench", argument(&path), "--network", "force-cnnlstm", "--repeat", "2", "--json"];
    let report = object(&arguments);
    // An event at a window's end belongs to the next one.
    assert_eq!((count(&report["frames"]), count(&report["period_us"])), (6, 10_000));
    let [skipping, everything] = [&report["skipping"], &report["everything"]];
    for way in [skipping, everything] {
        for part in ["frame", "push", "predict", "push_predict"] {
            assert_eq!(count(&way["latency_us"][part]["count"]), 12, "{part}");
        }
        assert!(count(&way["state_bytes"]) > 0);
    }
    for (layer, whole) in list(&skipping["layers"]).iter().zip(list(&everything["layers"])) {
        let name = &layer["name"];
        let [pixels, computed, skipped, absorbed] =
            ["pixels", "computed", "skipped", "absorbed"].map(|key| count(&layer[key]));
        assert_eq!((name, pixels), (&whole["name"], count(&whole["computed"])));
        // A block of pixels is computed if one of them must be.
        assert!(computed <= pixels && skipped + absorbed <= pixels, "{layer}");
        assert!(computed + skipped + absorbed >= pixels, "{layer}");
        assert_eq!((count(&whole["skipped"]), count(&whole["absorbed"])), (0, 0));
    }
    let frame = count(&report["multiply_adds_per_frame"]);
    assert_eq!(count(&everything["multiply_adds"]), 6 * frame);
    assert!(count(&skipping["multiply_adds"]) < 6 * frame);
}

#[test]
fn a_frame_networks_periods_are_its_frames() {
    let (_folder, path) = file("events.csv", "# sensor 128x128\n0,60,60,1\n5000,61,60,0\n55000,50,60,1\n");
    let report = object(&["bench", argument(&path), "--network", "force-lstm", "--json"]);
    let deadline = &report["deadline"];
    assert_eq!((count(&deadline["period_us"]), count(&deadline["periods"])), (10_000, 6));
    assert_eq!((count(&deadline["periods_without_work"]), count(&deadline["work_us"]["count"])), (0, 6));
    let by_events =
        list(&deadline["bins"]).iter().map(|bin| (count(&bin["events_seen"]), count(&bin["periods"])));
    assert_eq!(by_events.collect::<Vec<_>>(), [(0, 4), (1, 1), (2, 1)]);
}

#[test]
fn a_sliding_frame_comes_as_often_as_it_is_asked_for() {
    let (_folder, events) = file("events.csv", PRESSES);
    let arguments = ["bench", argument(&events), "--network", "event-frame-cnn", "--json", "--every"];
    for (every, frames) in [("100000us", 2), ("99999us", 3), ("300000us", 1)] {
        assert_eq!(object(&[&arguments[..], &[every]].concat())["frames"], frames, "{every}");
    }
}

#[test]
fn the_table_of_a_frame_network_names_every_part() {
    let (_folder, path) = file("events.csv", "# sensor 128x128\n0,60,60,1\n");
    let table = text(&meissner(&["bench", argument(&path), "--network", "force-convlstm"]));
    for part in
        ["force-convlstm", "event-counts", "predict, everything", "absorbed", "cell1", "deadline", "of state"]
    {
        assert!(table.contains(part), "{part}: {table}");
    }
}

#[test]
fn what_does_not_go_together_is_refused_with_what_would() {
    for (status, arguments, expected) in [
        (2, &["--network", "force-tdnn", "--compare", "event-frame-cnn"][..], "--compare"),
        (2, &["--network", "event-frame-cnn", "--threads", "2"], "--threads"),
        (2, &["--compare", "event-frame-cnn", "--threads", "2"], "--threads"),
        (1, &["--compare", "graphres"], "expected a frame network"),
        (1, &["--compare", "slip-lstm"], "\"electrodes\""),
        (1, &["--network", "canf"], "\"picture\""),
        (1, &["--network", "slip-tuned"], "event-counts, signed"),
        (1, &["--compare", "nothing"], "nothing"),
        (2, &["--network", "force-tdnn", "--burst-rate", "9"], "--burst-rate"),
        (2, &["--network", "force-tdnn", "--every", "5000us"], "10ms"),
        (2, &["--network", "event-frame-cnn", "--every", "event"], "such as 10ms"),
        (2, &["--compare", "event-frame-cnn", "--every", "100"], "--every"),
        (2, &["--compare", "event-frame-cnn", "--svg", "x.svg"], "--svg"),
        (2, &["--compare-weights", "x.safetensors"], "--compare"),
        (2, &["--compare-map", "a=b"], "--compare-weights"),
        (2, &["--from", "1"], "--from"),
        (2, &["--for", "0s"], "--for"),
    ] {
        let output = meissner(&[&["bench"][..], arguments].concat());
        let message = message(&output);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {message}");
        assert!(message.contains(expected) && output.stdout.is_empty(), "{arguments:?}: {message}");
    }
}

#[test]
fn a_silence_of_years_is_too_many_frames_and_a_part_is_not() {
    let (_folder, path) = file("far.csv", "# sensor 346x260\n0,1,1,1\n9000000000000000,1,1,1\n");
    let arguments = ["bench", argument(&path), "--compare", "event-frame-cnn", "--json"];
    let output = meissner(&arguments);
    assert_eq!(output.status.code(), Some(2));
    assert!(message(&output).contains("--for "), "{}", message(&output));
    assert_eq!(object(&[&arguments[..], &["--for", "1s"]].concat())["moments"], 1);
}
