//! Decisions over readings of 24 electrodes: how they are held, forgotten and timed.

use std::path::Path;

use meissner_models::systems::slip::DecisionFilter;
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::OwnNetwork;
use crate::frames_electrodes::{counts, csv, header, reading, row, run};
use crate::support::{file, lines, meissner, meissner_reading, text};

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
    // A median of sums is no sum of medians, but five steps take longer than two.
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
