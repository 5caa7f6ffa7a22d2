//! Networks over readings of 24 electrodes.

use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::{predicted, shipped_engine};
use crate::support::{argument, bits, file, lines, meissner, meissner_reading, message, text};

const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];

fn reading(i: usize) -> [f32; 24] {
    std::array::from_fn(|electrode| (2000 + (i * 131 + electrode * electrode * 17) % 1500) as f32)
}

fn header() -> String {
    (1..=24).map(|e| format!("ff_e{e}")).collect::<Vec<_>>().join(",") + "\n"
}

fn row(reading: [f32; 24]) -> String {
    reading.map(|value| value.to_string()).join(",") + "\n"
}

/// A header and `count` readings.
fn csv(count: usize) -> String {
    header() + &(0..count).map(|i| row(reading(i))).collect::<Vec<_>>().concat()
}

fn run(network: &str, input: &str) -> (Vec<Value>, Value) {
    lines(&meissner_reading(&["run", "-", "--network", network, "--json"], input))
}

#[test]
fn a_stream_of_readings_gives_the_predictions_of_the_engine_on_its_windows() {
    let mut engine = shipped_engine("slip-regularised");
    let mut window = TactileWindow::new(5, Sampling::Consecutive, Scaling::PerImage, TactileForm::Image)
        .expect("it can be");
    let mut expected = Vec::new();
    for i in 0..23 {
        if let Some(sequence) = window.push(&reading(i)).expect("finite") {
            engine.reset();
            sequence.values.chunks_exact(132).for_each(|frame| engine.push(frame).expect("a frame"));
            expected.push(predicted(&mut engine));
        }
    }
    let (predictions, summary) = run("slip-regularised", &csv(23));
    assert_eq!(expected.len(), 4);
    assert_eq!(predictions.iter().map(bits).collect::<Vec<_>>(), expected);
    assert_eq!(predictions.iter().map(|p| p["line"].as_u64()).collect::<Vec<_>>(), [6, 11, 16, 21].map(Some));
    assert_eq!((&summary["frames"], &summary["predictions"]), (&20.into(), &4.into()));
    let (_folder, path) = file("readings.csv", csv(23));
    let read = lines(&meissner(&["run", argument(&path), "--network", "slip-regularised", "--json"])).0;
    assert_eq!(read.iter().map(bits).collect::<Vec<_>>(), expected);
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
            assert_eq!(keys, ["class", "line", "probabilities", "time_s", "update_us", "value"]);
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
    assert_eq!(predictions.len(), 1);
    assert_eq!(predictions[0]["line"], 9, "five readings after the bad row");
    let undisturbed = run("slip-regularised", &(header() + &rows[2..7].concat())).0;
    assert_eq!(bits(&predictions[0]), bits(&undisturbed[0]));
    let input = &summary["input"];
    assert_eq!((&input["readings"], &input["rows_refused"]), (&9.into(), &1.into()));
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
    assert_eq!(summary["input"]["values_out_of_range"], 24);
    assert_eq!(summary["input"]["rows_off_rate"], 5);
    let people = text(&meissner_reading(&["run", "-", "--network", "slip-lstm"], &input));
    for expected in ["24 values beyond", "5 readings off their time", "p(cw)", "class"] {
        assert!(people.contains(expected), "{expected}: {people}");
    }
}

#[test]
fn the_limit_counts_rows() {
    let arguments = ["run", "-", "--network", "slip-lstm", "--json", "--limit", "7"];
    let (_, summary) = lines(&meissner_reading(&arguments, &csv(30)));
    assert_eq!(summary["input"]["readings"], 7);
}
