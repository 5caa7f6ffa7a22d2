//! Networks over readings of 24 electrodes, and their decisions.

use std::path::Path;

use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use meissner_models::systems::slip::DecisionFilter;
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::{OwnNetwork, predicted, shipped_engine};
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
            let expected = "class decision held line probabilities time_s unlike update_us value";
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
    // Readings every 10 ms, except: 50 ms before index 6, 51 ms before 12, back by 5 ms before 18,
    // twice the same at 24.
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

#[test]
fn decisions_are_those_of_the_filter_over_all_windows() {
    let network = OwnNetwork::new(THREE);
    let input = header() + &(0..300).map(|i| row(reading(i * i))).collect::<String>();
    let run = |options: &[&str]| {
        let arguments = network.arguments(Path::new("-"), &[options, &["--json"]].concat());
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        lines(&meissner_reading(&arguments, &input))
    };
    let (windows, each) = run(&[]);
    for (hold, least) in [(1, "0"), (2, "0"), (3, "0"), (2, "0.5"), (1, "0.55")] {
        let least_probability: f32 = least.parse().expect("a number");
        let mut filter = DecisionFilter::new(hold, least_probability).expect("in range");
        let expected = windows.iter().map(|line| {
            let list: Vec<f64> = line["probabilities"]
                .as_array()
                .expect("of classes")
                .iter()
                .filter_map(Value::as_f64)
                .collect();
            let class = ["a", "b", "c"].iter().position(|&name| line["class"] == name).expect("a class");
            let decision = filter.push(class, list[class] as f32);
            decision.map(|decision| (["a", "b", "c"][decision.class].to_owned(), decision.held))
        });
        let expected: Vec<_> = expected.collect();
        let (found, summary) = run(&["--hold", &hold.to_string(), "--least-probability", least]);
        let decision = |line: &Value| Some((line["decision"].as_str()?.to_owned(), line["held"].as_u64()?));
        assert_eq!(found.iter().map(decision).collect::<Vec<_>>(), expected, "hold {hold}, least {least}");
        let made = expected.iter().flatten().filter(|(_, held)| *held == 1).count() as u64;
        assert_eq!(counts(&summary, ["decisions"]), [made]);
        assert!(made > 1, "the decision changes");
        let fewer = made < counts(&each, ["decisions"])[0];
        assert_eq!(fewer, (hold, least) != (1, "0"), "{made} decisions, hold {hold}, least {least}");
    }
}

#[test]
fn behind_a_row_that_is_no_reading_the_decision_is_forgotten() {
    let rows: Vec<String> = (0..18).map(|i| row(reading(i))).collect();
    let arguments = ["run", "-", "--network", "slip-lstm", "--hold", "2", "--json"];
    let run = |input: &str| {
        let windows = lines(&meissner_reading(&arguments, input)).0;
        windows.iter().map(|line| [line["decision"].clone(), line["held"].clone()]).collect::<Vec<_>>()
    };
    let parts = [rows[..9].concat(), rows[9..].concat()];
    let found = run(&(header() + &parts[0] + "no reading\n" + &parts[1]));
    let alone = parts.map(|part| run(&(header() + &part)));
    assert_eq!(found, alone.concat());
    assert_eq!((found.len(), &found[5]), (10, &[Value::Null, Value::Null]));
}

#[test]
fn a_decision_before_the_first_is_a_dash_for_people() {
    let people = text(&meissner_reading(&["run", "-", "--network", "slip-lstm", "--hold", "9"], &csv(6)));
    let window = people.lines().find(|line| line.trim_start().starts_with("6 ")).expect("a window");
    assert!(people.contains("class  probability       decision") && window.contains("  -  "), "{people}");
    assert!(
        ["anticlockwise", "clockwise", "east", "north", "south", "touch", "west"]
            .iter()
            .any(|word| window.contains(word))
    );
    assert!(people.contains("decisions    0 made"), "{people}");
}

#[test]
fn the_time_from_a_reading_to_its_decision_covers_the_windows_steps() {
    let (_, summary) = run("slip-regularised", &csv(40));
    let us = |what: &str, quantile: &str| summary["latency_us"][what][quantile].as_f64().expect("measured");
    for quantile in ["p50", "p90", "p99", "p999", "max"] {
        assert!(us("decision", quantile) > 0.0);
    }
    // A median of sums is not a sum of medians, but five steps take longer than two.
    assert!(us("decision", "p50") > 2.0 * us("push", "p50"), "{summary}");
    let people = text(&meissner_reading(&["run", "-", "--network", "slip-lstm"], &csv(9)));
    assert!(people.lines().any(|line| line.trim_start().starts_with("decision  ")), "{people}");
}

#[test]
fn values_that_are_not_of_classes_have_no_decision() {
    let network = OwnNetwork::new(&THREE.replace("\"logit\"", "\"N\""));
    let (_folder, path) = file("readings.csv", csv(5));
    let (predictions, summary) = lines(&meissner(&network.arguments(&path, &["--json"])));
    for key in ["probabilities", "class", "decision", "held"] {
        assert!(predictions.iter().all(|line| line[key].is_null()));
    }
    assert!(summary["decisions"].is_null());
    for option in ["--hold=3", "--least-probability=0.5"] {
        let name = option.split('=').next().expect("an option has a name");
        fails(&meissner(&network.arguments(&path, &[option])), 2, &[name, "classes", "(N)"]);
    }
    assert!(!text(&meissner(&network.arguments(&path, &[]))).contains("decisions"));
}

/// Three classes, a window of two readings.
const THREE: &str = r#"
[network]
name = "own"

[input]
kind = "vector"
values = 24
frames = "electrodes"
steps = 2
sampling = "sliding"
scaling = "reading"

[[layer]]
name = "fc"
kind = "dense"
outputs = 3

[output]
names = ["a", "b", "c"]
unit = "logit"
"#;
