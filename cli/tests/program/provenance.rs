//! Weights contain their preparation, and results name themselves: statements of every output about
//! the origin of its numbers.

use std::collections::BTreeMap;
use std::path::PathBuf;

use meissner_models::{Description, Weights, draw};
use safetensors::SafeTensors;
use serde_json::Value;

use crate::data::{DigitsFolder, Runs, digits, said, small};
use crate::shared_files::shared;
use crate::support::{
    argument, bits, default_recording, file, headed_lines, keys, lines, meissner, message, object, text,
    words, written,
};

/// Weights of `name` with these remarks in their metadata, as a file.
fn weights(name: &str, remarks: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let description = Description::shipped(name).expect("shipped");
    let remarks: BTreeMap<String, String> =
        remarks.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    file("weights.safetensors", draw(&description, 3).to_safetensors(&remarks))
}

/// Commands that run a network over events for a moment, with JSON.
const COMMANDS: [&[&str]; 3] = [
    &["run", "--limit", "300", "--every", "end", "--json"],
    &["play", "--limit", "300", "--speed", "1000", "--json"],
    &["bench", "--limit", "300", "--warmup", "0", "--json"],
];

/// The header of a successful run of one of [`COMMANDS`] with `more`.
fn header(command: &[&str], more: &[&str]) -> (Value, String) {
    let output = meissner(&[command, more].concat());
    let header = match command[0] {
        "bench" => object(&output)["header"].clone(),
        _ => headed_lines(&output).0,
    };
    (header, message(&output))
}

#[test]
fn weights_of_another_preparation_are_refused_and_run_only_where_told_to_with_every_output_saying_so() {
    let other =
        Description::shipped("tactigraph-past").expect("shipped").preparation().replace("\"k\":8", "\"k\":9");
    let (_folder, path) = weights("tactigraph-past", &[("preparation", &other), ("trained", "true")]);
    let network = ["--network", "tactigraph-past", "--weights", argument(&path)];
    for command in COMMANDS {
        let output = meissner(&[command, &network].concat());
        assert_eq!(output.status.code(), Some(1));
        let refusal = message(&output);
        assert!(refusal.contains("\"k\":9") && refusal.contains("--ignore-preparation"), "{refusal}");
        assert!(output.stdout.is_empty(), "nothing is printed as if it were a result");
        let (header, warned) = header(command, &[&network[..], &["--ignore-preparation"]].concat());
        assert_eq!(header["weights"]["preparation"], "other");
        assert!(warned.contains("not those that they were trained for"), "{warned}");
        assert!(header["warnings"].to_string().contains("not those that they were trained for"), "{header}");
    }
    let people = meissner(&[&["run", "--limit", "300", "--ignore-preparation"], &network[..]].concat());
    assert!(words(&people).contains("trained, on another preparation"), "{}", text(&people));
}

#[test]
fn weights_that_say_nothing_are_run_and_said_not_to_say_how_they_were_prepared() {
    let (_folder, path) = weights("tactigraph-past", &[]);
    for command in COMMANDS {
        let (header, warned) =
            header(command, &["--network", "tactigraph-past", "--weights", argument(&path)]);
        assert!(warned.contains("weights do not say how they were prepared"), "{warned}");
        let said = &header["weights"];
        assert_eq!((&said["preparation"], &said["trained"]), (&"unstated".into(), &Value::Null));
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_refuses_the_published_checkpoint_by_name_and_the_published_network_runs_it() {
    let path = shared("data/checkpoints/contact_angle_graphres.safetensors");
    let run = |more: &[&str]| {
        let arguments = ["run", "--weights", argument(&path), "--limit", "400", "--every", "end", "--json"];
        meissner(&[&arguments, more].concat())
    };
    let refused = run(&["--network", "graphres"]);
    assert_eq!(refused.status.code(), Some(1));
    let refusal = message(&refused);
    for part in ["published GraphRes checkpoint", "--network graphres-published --mode batch"] {
        assert!(refusal.contains(part), "{refusal}");
    }
    let (header, fixed, _) = headed_lines(&run(&["--network", "graphres", "--ignore-preparation"]));
    assert_eq!(
        (&header["weights"]["preparation"], &header["weights"]["trained"]),
        (&"other".into(), &true.into())
    );
    let (header, published, _) = headed_lines(&run(&["--network", "graphres-published", "--mode", "batch"]));
    assert_eq!(
        (&header["weights"]["preparation"], &header["warnings"]),
        (&"same".into(), &serde_json::json!([]))
    );
    assert_ne!(bits(&fixed[0]), bits(&published[0]), "the two networks are not the same");
}

#[test]
fn run_play_and_bench_take_every_so_many_events_one_as_the_weights_say() {
    let (runs, data) = (Runs::new(), DigitsFolder::new());
    let (network, description) = runs.network(&small("own", &[]));
    let drawn = runs.training("own.safetensors", &description, 5, &[("stride", "3")]);
    let own = runs.path().join("own.safetensors");
    let own = ["--network", argument(&network), "--weights", argument(&own)];
    for digit in digits().iter().take(6) {
        let recording = data.path().join(format!("{}.bin", digit.name));
        let run = ["run", argument(&recording), "--every", "end", "--json"];
        let (predictions, summary) = lines(&meissner(&[&run[..], &own].concat()));
        let expected = said(&description, &drawn, &digit.events, 3);
        assert_eq!(bits(&predictions[0]), expected.bits, "{}", digit.name);
        let class = expected.answers.last().expect("one at the end").to_string();
        assert_eq!(predictions[0]["class"], class);
        assert_eq!(summary["events"], digit.events.len().div_ceil(3));
        let all = lines(&meissner(&[&run[..], &own, &["--stride", "1"]].concat())).0;
        assert_eq!(bits(&all[0]), said(&description, &drawn, &digit.events, 1).bits, "--stride replaces it");
        let bench = ["bench", argument(&recording), "--warmup", "0", "--json"];
        let bench = object(&meissner(&[&bench[..], &own].concat()));
        assert_eq!(
            (&bench["events"], &bench["header"]["network"]["stride"]),
            (&summary["events"], &3.into())
        );
        let play = ["play", argument(&recording), "--speed", "1000", "--overload", "block", "--json"];
        let (_, played) = lines(&meissner(&[&play[..], &own].concat()));
        assert_eq!(played["offered"], summary["events"]);
    }
    let state = runs.path().join("state");
    let save = meissner(&[&["run", "--save-state", argument(&state)], &own[..]].concat());
    assert_eq!(save.status.code(), Some(2), "which event is next is not in a state");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn run_over_the_test_split_gives_the_classes_that_eval_gives_and_names_them() {
    let data = shared("data/nmnist");
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let logits = folder.path().join("logits.safetensors");
    let arguments = ["eval", "digits", argument(&data), "--network", "digits-past", "--json"];
    let report = object(&meissner(&[&arguments[..], &["--logits", argument(&logits)]].concat()));
    let judged = std::fs::read(&logits).expect("it was written");
    let (_, metadata) = SafeTensors::read_metadata(&judged).expect("a valid file");
    let metadata = metadata.metadata().as_ref().expect("it names the recordings");
    let names: Vec<String> = serde_json::from_str(&metadata["test"]).expect("a list");
    let judged = Weights::from_bytes(&judged).expect("a valid file");
    let (_, judged) = judged.iter().next().expect("one training");
    let judged = judged.values().expect("numbers").chunks_exact(10);
    assert_eq!((names.len(), judged.len()), (100, 100));
    let mut right = 0;
    for (number, (name, logits)) in names.iter().zip(judged).enumerate() {
        let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let class = logits.iter().position(|&value| value == most).expect("one is the largest");
        right += u64::from(name.split('/').nth(1) == Some(&class.to_string()));
        // Each takes a process: a third of them is enough.
        if !number.is_multiple_of(3) {
            continue;
        }
        let recording = data.join(format!("{name}.bin"));
        let run = ["run", argument(&recording), "--network", "digits-past", "--every", "end", "--json"];
        let (predictions, _) = lines(&meissner(&run));
        assert_eq!(predictions[0]["class"], class.to_string(), "{name}");
        let expected: Vec<u32> = logits.iter().map(|value| value.to_bits()).collect();
        assert_eq!(bits(&predictions[0]), expected, "{name}");
    }
    let accuracy = report["networks"][0]["test"]["accuracy"]["mean"].as_f64().expect("a share");
    assert_eq!(right, (accuracy * 100.0).round() as u64);
}

#[test]
fn digits_on_another_sensor_are_warned_of() {
    let (header, warned) = header(COMMANDS[0], &[argument(&default_recording()), "--network", "digits-past"]);
    assert!(warned.contains("a sensor of 34x34 pixels"), "{warned}");
    assert!(header["warnings"][0].as_str().is_some_and(|warning| warning.contains("34x34")), "{header}");
    assert_eq!(header["weights"]["sensor"], serde_json::json!([34, 34]));
}

#[test]
fn classes_have_names_and_probabilities_and_lines_fit_in_80_columns() {
    let data = DigitsFolder::new();
    let recording = data.path().join(format!("{}.bin", digits()[0].name));
    let run = ["run", argument(&recording), "--network", "digits-past", "--every", "20"];
    let (header, predictions, _) = headed_lines(&meissner(&[&run[..], &["--json"]].concat()));
    assert_eq!(header["classes"], serde_json::json!(["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"]));
    for line in &predictions {
        let list = |key: &str| -> Vec<f64> {
            line[key].as_array().expect("a list").iter().filter_map(Value::as_f64).collect()
        };
        let (values, probabilities) = (list("value"), list("probabilities"));
        assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{line}");
        let class: usize = line["class"].as_str().and_then(|class| class.parse().ok()).expect("a digit");
        assert!(values.iter().all(|&value| value <= values[class]), "{line}");
        assert!(probabilities.iter().all(|&p| p <= probabilities[class]), "{line}");
    }
    let people = text(&meissner(&run));
    assert!(people.contains("class  probability"), "{people}");
    let play = ["play", "--speed", "1000"];
    let bench = text(&meissner(&["bench", "--limit", "1500", "--warmup", "0"]));
    // Rows of tables are indented; the others are sentences.
    let rows = bench.lines().filter(|line| line.starts_with("  ") && line.split("  ").count() > 4);
    assert!(rows.clone().count() > 10 && rows.clone().all(|line| line.chars().count() <= 80), "{bench}");
    for people in [people, text(&meissner(&["run", "--network", "graphres"])), text(&meissner(&play))] {
        let table = people.lines().skip_while(|line| !line.contains("time (ms)"));
        let table: Vec<&str> = table.take_while(|line| !line.is_empty() && !line.starts_with('(')).collect();
        assert!(table.len() > 1, "{people}");
        assert!(table.iter().all(|line| line.chars().count() <= 80), "{people}");
    }
}

#[test]
fn weights_from_a_seed_are_said_to_mean_nothing() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let weights = folder.path().join("drawn.safetensors");
    assert!(meissner(&["draw", "force-tdnn", "--out", argument(&weights)]).status.success());
    let run = ["run", "--limit", "100", "--network", "force-tdnn", "--weights", argument(&weights)];
    let drawn = words(&meissner(&run));
    assert!(drawn.contains("drawn from a seed: predictions mean nothing"), "{drawn}");
    let digits = words(&meissner(&["run", "--limit", "100", "--network", "digits-past"]));
    assert!(
        digits.contains("weights trained, on every 2 events one") && !digits.contains("seed: predictions"),
        "{digits}"
    );
}

#[test]
fn values_outside_the_range_of_the_training_are_marked_and_counted_and_angles_are_in_degrees() {
    let run = |ranges: &str, more: &[&str]| {
        let (_folder, weights) = weights("tactigraph-past", &[("ranges", ranges)]);
        let run = ["run", "--limit", "2000", "--every", "20ms", "--weights", argument(&weights)];
        meissner(&[&run[..], more].concat())
    };
    // Roll can only be near 0.
    let (narrow, wide) = ("[[100, 101], [-1000, 1000]]", "[[-1000, 1000], [-1000, 1000]]");
    let output = run(narrow, &["--json"]);
    let (predictions, summary) = lines(&output);
    assert!(predictions.iter().all(|line| line["outside_training"] == serde_json::json!(["roll"])));
    assert_eq!(summary["outside_training"], predictions.len());
    assert!(message(&output).contains("outside the range of the training (roll 5729.6 to 5786.9 deg)"));
    let roll = predictions[0]["value"][0].as_f64().expect("a number").to_degrees();
    let people = words(&run(narrow, &[]));
    assert!(people.contains("roll (deg) pitch (deg)") && people.contains(&format!("*{roll:.4}")), "{people}");
    assert!(people.contains("times real time"), "{people}");
    let (predictions, summary) = lines(&run(wide, &["--json"]));
    assert!(predictions.iter().all(|line| line["outside_training"].is_null()));
    assert_eq!(summary["outside_training"], 0);
    let refused = message(&run("[[0, 1]]", &[]));
    assert!(refused.contains("expected metadata \"ranges\" with [low, high] of each output"), "{refused}");
}

#[test]
fn run_bench_play_eval_and_soak_share_one_schema() {
    let data = DigitsFolder::new();
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let soaked = folder.path().join("soak.json");
    let soak = ["soak", "--events", "2000", "--checkpoint-every", "1000", "--json", argument(&soaked)];
    assert!(meissner(&soak).status.success());
    let soak = written(&soaked);
    let eval = object(&meissner(&["eval", "digits", argument(data.path()), "--json"]));

    let model = |value: &Value| {
        assert_eq!(keys(&value["network"]), "capacity fingerprint kind name preparation span_us stride");
        assert_eq!(keys(&value["weights"]), "about preparation sensor source stride trained");
        assert_eq!(keys(&value["outputs"][0]), "name range unit");
        assert!(value["classes"].is_null() || value["classes"].is_array());
    };
    let mut headers: Vec<Value> = COMMANDS.iter().map(|command| header(command, &[]).0).collect();
    headers.push(soak["header"].clone());
    let commands = ["run", "play", "bench", "soak"];
    for (header, command) in headers.iter().zip(commands) {
        let shared = "classes command input made meissner network outputs schema warnings weights";
        assert_eq!(keys(header), shared);
        model(header);
        assert_eq!(header["command"], command);
        assert_eq!(header["weights"]["trained"], true);
    }
    headers.push(eval["header"].clone());
    for header in &headers {
        assert_eq!((&header["schema"], &header["meissner"]), (&1.into(), &env!("CARGO_PKG_VERSION").into()));
        assert_eq!(keys(&header["input"]), "events format name sensor");
        assert_eq!(keys(&header["made"]), "arguments machine");
        assert_eq!(keys(&header["made"]["machine"]), "isa processor processors system");
        assert_eq!(header["made"]["arguments"][0], "meissner");
    }
    assert_eq!(keys(&eval["header"]), "command input made meissner schema warnings");
    eval["networks"].as_array().expect("a list").iter().for_each(model);
    assert_eq!(eval["networks"][0]["weights"]["trained"], true);

    let summary = |command: usize| lines(&meissner(COMMANDS[command])).1;
    let (run, play) = (summary(0), summary(1));
    let bench = object(&meissner(COMMANDS[2]));
    for counts in [&run, &play, &bench] {
        for key in ["events", "accepted", "dropped", "latency_us"] {
            assert!(!counts[key].is_null(), "{key}: {counts}");
        }
        let dropped: u64 =
            counts["dropped"].as_object().expect("reasons").values().filter_map(Value::as_u64).sum();
        assert_eq!(counts["accepted"].as_u64().map(|n| n + dropped), counts["events"].as_u64());
    }
    for timed in [&run["latency_us"], &bench["latency_us"], &soak["first"]["latency_us"]] {
        for call in ["push", "predict"] {
            assert!(timed[call]["p50"].as_f64() > Some(0.0), "{timed}");
        }
    }
    assert!(play["latency_us"]["waited"]["p50"].as_f64() > Some(0.0), "{play}");
}
