//! Networks over readings of 24 electrodes.

use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::{predicted, shipped_engine};
use crate::support::{argument, bits, file, lines, meissner, meissner_reading, message, text};

const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];

pub(crate) fn reading(i: usize) -> [f32; 24] {
    std::array::from_fn(|electrode| (2000 + (i * 131 + electrode * electrode * 17) % 1500) as f32)
}

pub(crate) fn header() -> String {
    (1..=24).map(|e| format!("ff_e{e}")).collect::<Vec<_>>().join(",") + "\n"
}

pub(crate) fn row(reading: [f32; 24]) -> String {
    reading.map(|value| value.to_string()).join(",") + "\n"
}

/// A header and `count` readings.
pub(crate) fn csv(count: usize) -> String {
    header() + &(0..count).map(|i| row(reading(i))).collect::<Vec<_>>().concat()
}

pub(crate) fn run(network: &str, input: &str) -> (Vec<Value>, Value) {
    lines(&meissner_reading(&["run", "-", "--network", network, "--json"], input))
}

/// Lines of the newest readings of predictions.
fn numbers(predictions: &[Value]) -> Vec<u64> {
    predictions.iter().filter_map(|prediction| prediction["line"].as_u64()).collect()
}

/// Numbers of the summary's input.
pub(crate) fn counts<const N: usize>(summary: &Value, keys: [&str; N]) -> [u64; N] {
    keys.map(|key| summary[key].as_u64().unwrap_or_else(|| panic!("{key}: {summary}")))
}

#[test]
fn a_stream_of_readings_gives_the_predictions_of_the_engine_on_its_windows() {
    let network = "slip-regularised";
    let mut engine = shipped_engine(network);
    let (_folder, path) = file("readings.csv", csv(23));
    for (options, sampling, ends) in [
        (&[][..], Sampling::Sliding, (6..=24).collect::<Vec<_>>()),
        (&["--sampling", "consecutive"], Sampling::Consecutive, vec![6, 11, 16, 21]),
        (&["--sampling", "2"], Sampling::Step { stride: 2 }, vec![10, 20]),
    ] {
        let mut window =
            TactileWindow::new(5, sampling, Scaling::PerImage, TactileForm::Image).expect("it can be");
        let mut expected = Vec::new();
        for i in 0..23 {
            if let Some(sequence) = window.push(&reading(i)).expect("finite") {
                engine.reset();
                sequence.values.chunks_exact(132).for_each(|frame| engine.push(frame).expect("a frame"));
                expected.push(predicted(&mut engine));
            }
        }
        let streamed = [&["run", "-", "--network", network, "--json"], options].concat();
        let (predictions, summary) = lines(&meissner_reading(&streamed, &csv(23)));
        assert_eq!(predictions.iter().map(bits).collect::<Vec<_>>(), expected);
        assert_eq!(numbers(&predictions), ends);
        let windows = ends.len();
        assert_eq!((&summary["frames"], &summary["predictions"]), (&(5 * windows).into(), &windows.into()));
        let read = [&["run", argument(&path), "--network", network, "--json"], options].concat();
        let (predictions, _) = lines(&meissner(&read));
        assert_eq!(predictions.iter().map(bits).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn the_report_names_the_sampling_that_was_used() {
    let arguments = ["run", "-", "--network", "slip-lstm", "--sampling", "3"];
    assert!(text(&meissner_reading(&arguments, &csv(1))).contains("steps = 5, sampling = 3"));
    assert!(text(&meissner_reading(&arguments[..4], &csv(1))).contains("sampling = \"sliding\""));
}

#[test]
fn probabilities_sum_to_1_and_the_class_has_the_largest() {
    for network in ["slip-lstm", "slip-tuned"] {
        let (predictions, _) = run(network, &csv(12));
        assert!(!predictions.is_empty());
        for line in predictions {
            let list = line["probabilities"].as_array().expect("of classes");
            let list: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
            assert!((list.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{line}");
            let class = CLASSES.iter().position(|&class| line["class"] == class).expect("a class");
            assert!(list.iter().all(|&p| p <= list[class]), "{line}");
            let keys: Vec<&String> = line.as_object().expect("an object").keys().collect();
            let expected = "class decision held line probabilities time_s update_us value";
            assert_eq!(keys, expected.split(' ').collect::<Vec<_>>());
            assert_eq!(line["decision"], line["class"], "each window decides");
        }
    }
}

#[test]
fn a_bad_row_is_reported_with_its_line_begins_a_new_window_and_the_stream_goes_on() {
    let rows: Vec<String> = (0..9).map(|i| row(reading(i))).collect();
    let input = header() + &rows[..2].concat() + "1,2,3\n" + &rows[2..].concat();
    let output = meissner_reading(&["run", "-", "--network", "slip-regularised", "--json"], &input);
    let message = message(&output);
    assert!(message.contains("line 4") && message.contains("24 fields"), "{message}");
    let (predictions, summary) = lines(&output);
    assert_eq!(numbers(&predictions), [9, 10, 11], "from five readings after the bad row on");
    let undisturbed = run("slip-regularised", &(header() + &rows[2..].concat())).0;
    assert!(predictions.iter().map(bits).eq(undisturbed.iter().map(bits)));
    assert_eq!(counts(&summary, ["readings", "lines_refused"]), [9, 1]);
}

#[test]
fn a_missing_column_is_bad_input_with_its_line() {
    let input = format!("# taken by hand\n{}", csv(3).replacen("ff_e7,", "pressure,", 1));
    let output = meissner_reading(&["run", "-", "--network", "slip-lstm"], &input);
    fails(&output, 1, &["standard input", "line 2", "ff_e7"]);
    fails(&meissner(&["run", "no/such.csv", "--network", "slip-lstm"]), 1, &["no/such.csv"]);
}

#[test]
fn the_readers_warnings_stand_in_the_summary() {
    let timed = |i: usize, reading: [f32; 24]| format!("{},{}", i as f64 * 0.02, row(reading));
    let mut rows: Vec<String> = (0..6).map(|i| timed(i, reading(i))).collect();
    rows[3] = timed(3, [5000.0; 24]);
    let input = format!("time_s,{}{}", header(), rows.concat());
    let (predictions, summary) = run("slip-lstm", &input);
    assert!(predictions.iter().all(|line| line["time_s"].is_f64()));
    assert_eq!(summary["values_out_of_range"], 24);
    assert_eq!(summary["rows_off_rate"], 5);
    let people = text(&meissner_reading(&["run", "-", "--network", "slip-lstm"], &input));
    for expected in ["24 values outside", "5 readings off their time", "probability", "class"] {
        assert!(people.contains(expected), "{expected}: {people}");
    }
}

#[test]
fn a_cell_that_is_no_finite_number_is_named_with_line_and_column() {
    for cell in ["abc", "NaN", "inf", "-inf", "1e39", "", "ff_e7"] {
        let mut rows: Vec<String> = (0..12).map(|i| row(reading(i))).collect();
        let bad: Vec<String> = reading(5).iter().map(f32::to_string).collect();
        rows[5] = [&bad[..6].join(","), cell, &bad[7..].join(",")].join(",") + "\n";
        let input = header() + &rows.concat();
        let output = meissner_reading(&["run", "-", "--network", "slip-lstm", "--json"], &input);
        let message = message(&output);
        let expected = format!("line 7: expected a finite number in column `ff_e7`, found `{cell}`");
        assert!(message.contains(&expected), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
        let (predictions, summary) = lines(&output);
        assert_eq!(numbers(&predictions), [6, 12, 13]);
        assert_eq!(counts(&summary, ["readings", "lines_refused"]), [11, 1]);
    }
}

#[test]
fn an_empty_input_is_bad_input_and_one_without_a_window_is_warned_of() {
    let arguments = ["run", "-", "--network", "slip-lstm", "--json"];
    fails(&meissner_reading(&arguments, ""), 1, &["standard input", "line 1", "the end of the input"]);
    for (input, found) in [(header(), "0 readings"), (csv(4), "4 readings")] {
        let output = meissner_reading(&arguments, &input);
        let (predictions, summary) = lines(&output);
        assert_eq!((predictions.len(), &summary["predictions"]), (0, &0.into()));
        assert!(summary["latency_us"]["decision"].is_null(), "{summary}");
        let message = message(&output);
        assert!(message.contains("no prediction") && message.contains(found), "{message}");
    }
}

#[test]
fn line_ends_of_either_kind_or_none_at_the_end_change_nothing() {
    let bits = |input: &str| run("slip-lstm", input).0.iter().map(bits).collect::<Vec<_>>();
    let plain = csv(8);
    let expected = bits(&plain);
    assert_eq!(expected.len(), 4);
    for input in [plain.replace('\n', "\r\n"), plain.trim_end().to_owned(), format!("\u{feff}{plain}\n\n")] {
        assert_eq!(bits(&input), expected);
    }
}

#[test]
fn no_window_spans_a_gap_or_a_step_back_in_time() {
    // Readings of 10 ms, but: 50 ms before index 6, 51 ms before 12, back by 5 ms before 18, twice
    // the same at 24.
    let mut time_ms = 1_000_000;
    let rows = (0..30).map(|i| {
        time_ms += match i {
            6 => 50,
            12 => 51,
            18 => -5,
            24 => 0,
            _ => 10,
        };
        format!("{time_ms},{}", row(reading(i)))
    });
    let input = format!("time_ms,{}{}", header(), rows.collect::<String>());
    let arguments = ["run", "-", "--network", "slip-lstm", "--hold", "3", "--json"];
    let (predictions, summary) = lines(&meissner_reading(&arguments, &input));
    let expected: Vec<u64> = [6..=13, 18..=19, 24..=31].into_iter().flatten().collect();
    assert_eq!(numbers(&predictions), expected);
    let keys = ["readings", "lines_refused", "rows_off_rate", "gaps", "times_backwards", "times_repeated"];
    assert_eq!(counts(&summary, keys), [30, 0, 4, 1, 1, 1]);
    for first in [6, 18, 24] {
        let line = predictions.iter().find(|line| line["line"] == first).expect("the first window");
        assert!(line["decision"].is_null() && line["held"].is_null(), "begins anew: {line}");
    }
    let people = text(&meissner_reading(&arguments[..4], &input));
    for expected in ["1 gaps of more than 50 ms", "1 readings earlier than", "1 readings with the time of"] {
        assert!(people.contains(expected), "{expected}: {people}");
    }
}

#[test]
fn options_of_electrodes_that_make_no_sense_are_bad_usage() {
    for option in [
        "--sampling=sometimes",
        "--sampling=0",
        "--sampling=65537",
        "--hold=0",
        "--hold=-1",
        "--least-probability=1.5",
        "--least-probability=NaN",
    ] {
        fails(&meissner(&["run", "x.csv", "--network", "slip-lstm", option]), 2, &["error: "]);
    }
}

#[test]
fn the_limit_counts_rows() {
    let arguments = ["run", "-", "--network", "slip-lstm", "--json", "--limit", "7"];
    let (_, summary) = lines(&meissner_reading(&arguments, &csv(30)));
    assert_eq!(summary["readings"], 7);
}
