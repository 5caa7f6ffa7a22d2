//! What a run and `inspect` print.

use meissner_models::{AnyDescription, Description, FrameDescription};

use crate::exit_status::fails;
use crate::support::{command as command_of, keys, lines, meissner, message, text, words};

#[test]
fn a_json_line_has_the_documented_keys_and_no_others() {
    let (predictions, summary) = lines(&meissner(&["run", "--every", "50000us", "--json"]));
    for line in &predictions {
        assert_eq!(keys(line), "nodes rows t_us update_us value");
        assert!(line["update_us"].as_f64() > Some(0.0));
        assert_eq!(line["value"].as_array().map(Vec::len), Some(2));
        assert_eq!(line["rows"].as_array().map(Vec::len), Some(3), "a count for each layer");
    }
    let expected = "accepted dropped events events_per_s latency_us lines_refused nodes_max outside_training predictions real_time restarts skips warnings";
    assert_eq!(keys(&summary), expected);
    for histogram in ["push", "predict"] {
        let latencies = &summary["latency_us"];
        assert_eq!(keys(&latencies[histogram]), "max p50 p90 p99 p999");
        let at = |quantile: &str| latencies[histogram][quantile].as_f64().expect("a number");
        let ascending = ["p50", "p90", "p99", "p999", "max"].map(at);
        assert!(ascending.is_sorted() && ascending[0] > 0.0, "{ascending:?}");
    }
}

#[test]
fn rows_of_the_predictions_sum_to_those_of_the_summary() {
    let (predictions, summary) = lines(&meissner(&["run", "--every", "20000us", "--json"]));
    let rows = predictions.iter().flat_map(|line| line["rows"].as_array().expect("rows of layers"));
    let sum: u64 = rows.filter_map(serde_json::Value::as_u64).sum();
    assert_eq!(summary["skips"]["rows_recomputed"], sum);
    let layers = summary["skips"]["layers"].as_array().expect("a list of layers");
    assert_eq!(layers.iter().filter_map(|layer| layer["recomputed"].as_u64()).sum::<u64>(), sum);
}

#[test]
fn an_event_changes_few_rows_and_the_summary_says_how_many_were_kept() {
    let (predictions, summary) = lines(&meissner(&[
        "run",
        "--network",
        "tactigraph-past",
        "--every",
        "event",
        "--limit",
        "3000",
        "--json",
    ]));
    let first_layer = predictions.iter().all(|line| line["rows"][0] == 1);
    assert!(first_layer, "a frozen network computes one row a layer for an event");
    let kept = &summary["skips"]["rows_kept"];
    assert!(kept.as_u64() > summary["skips"]["rows_recomputed"].as_u64(), "{summary}");
}

#[test]
fn inspect_shows_every_layer_of_every_shipped_network() {
    for name in Description::shipped_names() {
        let description = Description::shipped(name).expect("it is shipped");
        let table = text(&meissner(&["inspect", name]));
        let dot = text(&meissner(&["inspect", name, "--dot"]));
        let json: serde_json::Value =
            serde_json::from_slice(&meissner(&["inspect", name, "--json"]).stdout).expect("it is JSON");
        assert!(dot.starts_with("digraph"), "{dot}");
        assert_eq!(json["parameters"], description.parameters());
        for layer in description.layers() {
            assert!(table.contains(&layer.name) && dot.contains(&layer.name), "{}", layer.name);
        }
    }
}

#[test]
fn inspect_shows_every_layer_of_every_shipped_frame_network() {
    for name in FrameDescription::shipped_names() {
        let description = FrameDescription::shipped(name).expect("it is shipped");
        let table = text(&meissner(&["inspect", name]));
        assert!(table.split_whitespace().eq(description.to_table().split_whitespace()));
        assert_eq!(text(&meissner(&["inspect", name, "--dot"])), description.to_dot());
        let json: serde_json::Value =
            serde_json::from_slice(&meissner(&["inspect", name, "--json"]).stdout).expect("it is JSON");
        assert_eq!(json["multiply_adds"], description.multiply_adds());
        assert!(description.layers().iter().all(|layer| table.contains(&layer.name)));
    }
}

#[test]
fn an_unknown_network_is_answered_with_the_nearest_name_and_where_all_are_listed() {
    let message = crate::support::message(&meissner(&["inspect", "tactigraf"]));
    assert!(message.contains("did you mean tactigraph?"), "{message}");
    assert!(message.contains("`meissner networks`"), "{message}");
}

#[test]
fn networks_lists_every_shipped_network_with_what_it_reads_and_predicts() {
    let output = meissner(&["networks"]);
    let text = crate::support::text(&output);
    assert!(output.status.success() && text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let json = meissner(&["networks", "--json"]).stdout;
    let json: Vec<serde_json::Value> = serde_json::from_slice(&json).expect("it is a JSON array");
    let names: Vec<&str> = json.iter().filter_map(|entry| entry["name"].as_str()).collect();
    assert!(AnyDescription::shipped_names().eq(names.iter().copied()));
    assert!(names.iter().all(|name| text.contains(name)), "{text}");
    let of = |name: &str| json.iter().find(|entry| entry["name"] == name).expect("it is listed");
    let tactigraph = of("tactigraph");
    assert_eq!(tactigraph["outputs"], serde_json::json!(["roll", "pitch"]));
    assert_eq!(
        (&tactigraph["units"], &tactigraph["trained"]),
        (&serde_json::json!(["rad", "rad"]), &true.into())
    );
    assert_eq!(of("digits-past")["sensor"], serde_json::json!([34, 34]));
    assert_eq!((&of("canf")["trained"], &of("canf")["input"]), (&true.into(), &"pictures".into()));
}

#[test]
fn inspect_draws_to_a_file_and_says_so() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("graphres.svg");
    let output = meissner(&["inspect", "graphres", "--svg", crate::support::argument(&path)]);
    assert!(output.status.success() && output.stdout.is_empty());
    assert_eq!(crate::support::message(&output), format!("wrote {}\n", path.display()));
    assert!(std::fs::read_to_string(&path).expect("it was written").starts_with("<svg"));
}

#[test]
fn without_arguments_it_shows_a_simulated_press_beside_the_truth_in_less_than_30_lines() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let svg = folder.path().join("press.svg");
    let output = meissner(&["run", "--svg", crate::support::argument(&svg)]);
    assert!(output.status.success(), "{}", crate::support::message(&output));
    let said = text(&output);
    assert!(said.lines().count() < 30 && said.lines().all(|line| line.chars().count() <= 80), "{said}");
    for expected in
        ["tactigraph-past", "simulated", "predicted", "true", "5.71", "-1.85", "latency", "skipped"]
    {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    // The direction of the press is one that training has not seen.
    let error =
        said.lines().find_map(|line| line.strip_prefix("error")).expect("there is a line of the error");
    let error: f64 = error.split_whitespace().next().and_then(|word| word.parse().ok()).expect("a number");
    assert!(error < 1.5, "{said}");
    let picture = std::fs::read_to_string(&svg).expect("it was written");
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("roll, predicted"));
    fails(
        &meissner(&["run", "--json", "--svg", crate::support::argument(&svg)]),
        2,
        &["--svg", "no other option"],
    );
}

#[test]
fn an_embedded_recording_is_labelled_simulated_and_the_weights_say_what_they_are() {
    let output = meissner(&["run", "--every", "10ms"]);
    assert!(output.status.success());
    let text = words(&output);
    for expected in [
        "simulated, not a real sensor",
        "EVT3, 346x260 pixels",
        "network tactigraph-past on 346x260 pixels, weights trained incremental",
        "weights shipped with the network",
        "roll (deg)",
        "latency (us)",
        "p99.9",
        "kept",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn what_happens_is_told_where_it_is_asked_for() {
    let told = |command: &[&str], level: Option<&str>| {
        let mut command = command_of(command);
        level.map(|level| command.env("MEISSNER_LOG", level));
        let output = command.output().expect("the program starts");
        assert!(output.status.success());
        message(&output)
    };
    let run = ["run", "--limit", "300", "--every", "event"];
    assert_eq!(told(&run, None), "");
    let all = told(&run, Some("trace"));
    assert_eq!(all.matches("trace: meissner_run::run::events: predicted").count(), 300, "{all}");
    assert_eq!(told(&run, Some("debug")), "");
    assert!(told(&run, Some("loud")).contains("MEISSNER_LOG: expected off"));
    let live = told(&["play", "--limit", "300", "--speed", "1000", "--overload", "block"], Some("trace"));
    assert!(live.contains("meissner_live::worker: predicted"), "{live}");
}
