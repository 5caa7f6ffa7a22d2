//! Printed output: keys of JSON against `docs/json.md`, lines, help, completions, pages of the
//! manual.

use meissner_models::{AnyDescription, Description, FrameDescription};

use crate::exit_status::fails;
use crate::support::{argument, command as command_of, keys, lines, meissner, message, text, words};

#[test]
fn a_json_line_has_the_documented_keys_and_no_others() {
    let (predictions, summary) = lines(&meissner(&["run", "--every", "50000us", "--json"]));
    for line in &predictions {
        assert_eq!(keys(line), "nodes rows t_us unlike update_us value");
        assert!(line["update_us"].as_f64() > Some(0.0));
        assert_eq!(line["value"].as_array().map(Vec::len), Some(2));
        assert_eq!(line["rows"].as_array().map(Vec::len), Some(3), "a count for each layer");
    }
    let expected = "accepted dropped events events_per_s latency_us lines_refused nodes_max outside_training predictions real_time restarts skips unlike_training warnings";
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

#[test]
fn completions_know_the_commands_and_their_options() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = text(&meissner(&["completions", shell]));
        for word in ["meissner", "pareto", "completions", "report-every"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(meissner(&["completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn every_command_has_a_page_of_its_whole_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let man1 = folder.path().join("man1");
    for _ in 0..2 {
        assert!(text(&meissner(&["man", argument(&man1)])).is_empty());
    }
    let page = |name: &str| std::fs::read_to_string(man1.join(format!("{name}.1"))).expect("a page");
    assert!(page("meissner").contains("meissner\\-run(1)"), "{}", page("meissner"));
    assert!(page("meissner-run").contains("\\-\\-every"));
    assert!(page("meissner-eval-digits").starts_with(".ie") || page("meissner-eval-digits").contains(".TH"));
    assert!(std::fs::read_dir(&man1).expect("a folder").count() > 20);
}

pub(crate) mod page {
    //! The keys of JSON outputs against `docs/json.md`. Every report and every line that a test
    //! reads passes [`documented`].

    use std::collections::BTreeSet;

    use serde_json::Value;

    use crate::support::{default_recording, headed_lines, meissner, meissner_reading, object};

    const PAGE: &str = include_str!("../../../docs/json.md");
    /// The heading between the keys that the commands share and the keys of each command.
    const EACH: &str = "## Keys of each command";
    /// Keys whose values have other keys: reasons, indenters, sets, and those of a description.
    const NAMES: [&str; 4] = ["dropped", "kinds", "preparation", "references"];

    /// The words in code of `text`.
    fn words(text: &str) -> impl Iterator<Item = &str> {
        let code = text.split('`').skip(1).step_by(2);
        code.flat_map(|code| code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')))
    }

    /// The title and the text of each section on a command.
    fn sections() -> impl Iterator<Item = (&'static str, &'static str)> {
        let (_, each) = PAGE.split_once(EACH).expect("the page has this heading");
        each.split("\n### ").skip(1).filter_map(|section| section.split_once('\n'))
    }

    /// The section on `command`, as the header names it.
    fn section(command: &str) -> (&'static str, &'static str) {
        let title = match command {
            "stress" => "verify --stress",
            "sweep" => "bench --sweep",
            "soak" => "verify --soak",
            _ => command,
        };
        let is_named = |name: &str| title == name || title.starts_with(&format!("{name} "));
        let exact = sections().find(|&(named, _)| named == title);
        exact.or_else(|| sections().find(|(named, _)| named.split(", ").any(is_named))).expect(title)
    }

    /// All keys in `value`.
    fn keys_in<'a>(value: &'a Value, keys: &mut BTreeSet<&'a str>) {
        match value {
            Value::Array(all) => all.iter().for_each(|value| keys_in(value, keys)),
            Value::Object(object) => {
                for (key, value) in object {
                    keys.insert(key);
                    if !NAMES.contains(&key.as_str()) {
                        keys_in(value, keys);
                    }
                }
            }
            _ => {}
        }
    }

    /// Refuses a key in `value`, an output of `command`, that is not on the page.
    pub(crate) fn documented(command: &str, value: &Value) {
        let (shared, _) = PAGE.split_once(EACH).expect("the page has this heading");
        let (title, text) = section(command);
        let others = sections().filter(|(other, _)| text.contains(&format!("as in `{other}`")));
        let known: BTreeSet<&str> =
            [text, shared].into_iter().chain(others.map(|(_, text)| text)).flat_map(words).collect();
        let mut keys = BTreeSet::new();
        keys_in(value, &mut keys);
        let missing: Vec<_> = keys.difference(&known).collect();
        assert!(missing.is_empty(), "docs/json.md, {title}: {missing:?}");
    }

    /// Refuses a key in a first column of the section on `command` that none of `outputs` has.
    fn are_there(command: &str, outputs: &[Value]) {
        let mut keys = BTreeSet::new();
        outputs.iter().for_each(|value| keys_in(value, &mut keys));
        let rows = section(command).1.lines().filter_map(|line| line.strip_prefix("| `")?.split_once(" | "));
        for (first, _) in rows.filter(|(_, value)| !value.contains("over pictures:")) {
            for key in words(&format!("`{first}")).filter(|key| !key.is_empty()) {
                assert!(keys.contains(key), "docs/json.md, {command}: no output has {key}");
            }
        }
    }

    #[test]
    fn every_key_of_the_page_is_in_an_output() {
        let lines = |output| {
            let (_, mut lines, summary) = headed_lines(&output);
            lines.push(summary);
            lines
        };
        let names: Vec<String> = (1..=24).map(|i| format!("e{i}")).collect();
        let readings = format!("{}\n{}", names.join(","), format!("{}\n", ["1"; 24].join(",")).repeat(60));
        let run = [
            lines(meissner(&["run", "--limit", "300", "--every", "100", "--stride", "2", "--json"])),
            lines(meissner(&["run", "--limit", "300", "--network", "force-tdnn", "--json"])),
            lines(meissner(&[
                "run",
                "--limit",
                "300",
                "--network",
                "digits-past",
                "--every",
                "end",
                "--json",
            ])),
            lines(meissner_reading(&["run", "-", "--network", "slip-lstm", "--json"], &readings)),
        ];
        let mut run = run.concat();
        // Only for a value outside the range of the training.
        run.push(serde_json::json!({ "outside_training": [] }));
        are_there("run", &run);
        let play = ["play", "--limit", "300", "--speed", "1000", "--json"];
        let stride = lines(meissner(&[&play[..], &["--stride", "2"]].concat()));
        let classes = lines(meissner(&[&play[..], &["--network", "digits-past"]].concat()));
        are_there("play", &[stride, classes].concat());
        let bench = ["bench", "--limit", "300", "--warmup", "0", "--json"];
        let of = |more: &[&str]| object(&meissner(&[&bench[..], more].concat()));
        are_there("bench", &[of(&[]), of(&["--network", "force-tdnn"]), of(&["--compare", "force-tdnn"])]);
        are_there("sweep", &[object(&meissner(&["bench", "--sweep=rate", "--limit", "2", "--json"]))]);
        are_there("verify", &[object(&meissner(&["verify", "graphres", "--cases", "1", "--json"]))]);
        let recording = default_recording();
        for command in [&["info", recording.to_str().expect("text")][..], &["networks"]] {
            let output = object(&meissner(&[command, &["--json"]].concat()));
            documented(command[0], &output);
            are_there(command[0], &[output]);
        }
    }
}
