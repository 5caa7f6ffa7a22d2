//! `play`: one recording, and several at a time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use meissner_models::{Description, Tensor, Weights, draw};
use serde_json::Value;

use crate::data::small;
use crate::shared_files::shared;
use crate::support::{argument, bits, file, lines, meissner, message, text};

const POLICIES: [&str; 7] =
    ["block", "drop-oldest", "drop-newest", "thin:4", "filter:1250us", "refractory:1000us", "rate:400000"];

/// Asserts that `summary` accounts for every event, and that each of its reports was made.
fn check(summary: &Value, reports: &[Value]) {
    let count = |value: &Value| value.as_u64().unwrap_or_else(|| panic!("no count: {value}"));
    let dropped: u64 =
        ["oldest", "newest", "thinned", "filtered"].map(|r| count(&summary["dropped"][r])).iter().sum();
    assert_eq!(count(&summary["offered"]), count(&summary["delivered"]) + dropped, "{summary}");
    let all: u64 = summary["dropped"].as_object().expect("reasons").values().map(count).sum();
    assert_eq!(count(&summary["delivered"]), count(&summary["accepted"]) + all - dropped, "{summary}");
    assert!(count(&summary["queue"]["high_water"]) <= count(&summary["queue"]["capacity"]), "{summary}");
    let made = &summary["reports"];
    assert_eq!(made["due"], made["made"], "{summary}");
    assert_eq!(count(&made["made"]), reports.len() as u64);
    let states = ["fresh", "behind", "old"].map(|state| {
        let lines = reports.iter().filter(|line| line["state"] == state).count() as u64;
        assert_eq!(count(&made[state]), lines, "{summary}");
        lines
    });
    assert_eq!(states.iter().sum::<u64>(), reports.len() as u64);
    for line in reports {
        assert!(line["state"] != "fresh" || line["behind_events"] == 0, "{line}");
    }
}

#[test]
fn under_every_policy_each_report_is_made_and_the_end_equals_batch() {
    // 2,000 events in 20 ms at a hundred times their speed, through a queue of 100: most will not
    // find room.
    let events: Vec<String> =
        (0..2000).map(|i| format!("{},{},{},{}\n", i * 10, i * 7 % 32, i / 32 % 24, i % 2)).collect();
    let (_folder, path) = file("events.csv", events.concat());
    for policy in POLICIES {
        let output = meissner(&[
            "play",
            argument(&path),
            "--sensor",
            "32x24",
            "--network",
            "tactigraph-past",
            "--speed",
            "100",
            "--queue",
            "100",
            "--overload",
            policy,
            "--report-every",
            "1ms",
            "--deadline",
            "100us",
            "--verify",
            "--json",
        ]);
        let (reports, summary) = lines(&output);
        check(&summary, &reports);
        assert_eq!(summary["events"], 2000, "{policy}");
        assert_eq!(summary["reports"]["due"], 20, "{policy}: up to 20 ms, behind the last event at 19.99 ms");
        assert_eq!(summary["verified"]["equal"], true, "{policy}");
        assert_eq!(summary["verified"]["events"], summary["accepted"], "{policy}");
        assert_eq!(summary["dropped"]["oldest"].as_u64() > Some(0), policy == "drop-oldest", "{summary}");
        if policy == "block" {
            assert_eq!(summary["delivered"], 2000);
        }
    }
}

#[test]
fn without_drops_the_end_has_the_bits_of_a_run() {
    let play = ["play", "--network", "tactigraph-past", "--speed", "1000", "--overload", "block", "--json"];
    let (reports, summary) = lines(&meissner(&play));
    check(&summary, &reports);
    let (predictions, run) = lines(&meissner(&["run", "--network", "tactigraph-past", "--json"]));
    let last = predictions.last().expect("there is a prediction");
    assert_eq!(bits(&summary["final"]), bits(last));
    assert_eq!(summary["final"]["t_us"], last["t_us"]);
    assert_eq!(summary["accepted"], run["accepted"]);
    assert!(summary["verified"].is_null() && summary["approximations"].is_null());
}

#[test]
fn filters_before_the_queue_are_reported_beside_it() {
    let arguments =
        ["play", "--network", "tactigraph-past", "--speed", "1000", "--stride", "10", "--verify", "--json"];
    let (reports, summary) = lines(&meissner(&arguments));
    check(&summary, &reports);
    let stride = &summary["approximations"]["filters"][0];
    let counts =
        [&stride["passed"], &stride["dropped"], &summary["events"]].map(|v| v.as_u64().expect("a count"));
    assert_eq!(counts[0] + counts[1], counts[2]);
    assert_eq!(summary["offered"], stride["passed"]);
    assert_eq!(summary["verified"]["equal"], true);
}

#[test]
fn an_empty_recording_has_no_reports_and_a_prediction_at_the_end() {
    let (_folder, path) = file("events.csv", "t,x,y,p\n");
    let output = meissner(&["play", argument(&path), "--sensor", "8x8", "--verify", "--json"]);
    let (reports, summary) = lines(&output);
    assert!(reports.is_empty());
    assert!(summary["final"]["t_us"].is_null() && summary["final"]["value"].is_array(), "{summary}");
    assert_eq!(summary["verified"]["equal"], true);
}

#[test]
fn people_see_states_and_a_table() {
    let output = meissner(&["play", "--network", "tactigraph-past", "--speed", "1000", "--verify"]);
    let text = text(&output);
    assert!(output.status.success(), "{}", message(&output));
    for word in [
        "waited us",
        "reports      ",
        "queue        drop oldest: ",
        "verified     the last prediction equals",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let report = text.lines().find(|line| line.starts_with("   10.000")).expect("a report at 10 ms");
    assert_eq!(report.split_whitespace().count(), 8, "a report fits one line: {report}");
}

#[test]
fn what_has_no_time_or_no_batch_is_refused_as_usage() {
    for (arguments, named) in [
        (&["play", "--verify", "--tolerance", "0.1"][..], "--tolerance"),
        (&["play", "--verify", "--stale-time", "100us"], "--stale-time"),
        (&["play", "--overload", "thin:0"], "thin:4"),
        (&["play", "--queue", "0"], "--queue"),
        (&["play", "--deadline", "5"], "500us, 1.5ms or 2s"),
        (&["play", "--report-every", "0ms"], "from 1us"),
        (&["play", "--speed", "0"], "0.000001"),
    ] {
        let output = meissner(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(message(&output).contains(named), "{arguments:?}: {}", message(&output));
    }
    let output = meissner(&["play", "--network", "canf"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("frame network"), "{}", message(&output));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn recordings_of_an_overload_miss_no_report() {
    for (name, sensor, limit, policy) in [
        ("gen3_640x480_burst.evt2.raw", "640x480", "60000", "drop-oldest"),
        ("evk3_1280x720_peak.evt3.raw", "1280x720", "60000", "drop-newest"),
    ] {
        let path = shared(&format!("data/events/{name}"));
        let output = meissner(&[
            "play",
            argument(&path),
            "--sensor",
            sensor,
            "--network",
            "tactigraph-past",
            "--limit",
            limit,
            "--queue",
            "4096",
            "--overload",
            policy,
            "--report-every",
            "1ms",
            "--deadline",
            "500us",
            "--verify",
            "--json",
        ]);
        let (reports, summary) = lines(&output);
        check(&summary, &reports);
        assert_eq!(summary["verified"]["equal"], true, "{name}");
        assert_eq!(summary["queue"]["high_water"], 4096, "{name}: it is too fast");
    }
}

/// Writes `count` events, one every `period_us`, beginning at `first_us`.
fn recording(folder: &Path, name: &str, first_us: i64, period_us: i64, count: i64) -> PathBuf {
    let event =
        |i: i64| format!("{},{},{},{}\n", first_us + i * period_us, i * 7 % 32, i / 32 % 24, i % 3 % 2);
    let path = folder.join(name);
    let events = (0..count).map(event).collect::<String>();
    std::fs::write(&path, format!("t,x,y,p\n{events}")).expect("it can be written");
    path
}

/// Plays `recordings` with `more`, and returns the output's lines.
fn played(recordings: &[&Path], more: &[&str]) -> (Option<i32>, Vec<Value>) {
    let play = ["play", "--sensor", "32x24", "--json"];
    let paths: Vec<_> = recordings.iter().copied().map(argument).collect();
    let output = meissner(&[&play[..], &paths, more].concat());
    let lines: Vec<Value> =
        text(&output).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert!(!lines.is_empty(), "{}", message(&output));
    (output.status.code(), lines)
}

/// The lines of `lines` with this key, in order.
fn with<'a>(lines: &'a [Value], key: &str) -> Vec<&'a Value> {
    lines.iter().map(|line| &line[key]).filter(|value| value.is_object()).collect()
}

#[test]
fn each_of_several_recordings_has_its_reports_and_ends_as_it_does_alone() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let long = recording(folder.path(), "long.csv", 1_700_000_000_000_000, 10, 2000);
    let short = recording(folder.path(), "short.csv", 5, 100, 40);
    let empty = recording(folder.path(), "empty.csv", 0, 1, 0);
    let all = [&*long, &short, &empty];
    let network = ["--network", "tactigraph-past", "--report-every", "1ms", "--overload", "block"];
    let more = ["--speed", "10", "--deadline", "1ms", "--verify", "--pin", "0"];
    let (code, lines) = played(&all, &[&network[..], &more].concat());
    assert_eq!(code, Some(0), "{lines:?}");

    let (headers, summaries) = (with(&lines, "header"), with(&lines, "summary"));
    let names: Vec<_> = headers.iter().map(|header| header["input"]["name"].clone()).collect();
    assert_eq!(names, all.map(|path| argument(path).to_owned()));
    for (input, (summary, (events, reports))) in
        summaries.iter().zip([(2000, 20), (40, 4), (0, 0)]).enumerate()
    {
        assert_eq!(summary["input"], input, "{summary}");
        for key in ["events", "offered", "delivered", "accepted"] {
            assert_eq!(summary[key], events, "{key}: {summary}");
        }
        let own = lines.iter().filter(|line| line["at_us"].is_number() && line["input"] == input).count();
        assert_eq!((&summary["reports"]["made"], own), (&reports.into(), reports));
        assert_eq!(summary["verified"]["equal"], true, "{summary}");
        assert_eq!(summary["latency_us"]["event"].is_null(), events == 0, "{summary}");
        assert!(summary["bytes"].as_u64() > Some(1 << 20), "{summary}");
        let (_, alone) = lines_of(all[input], &network);
        assert_eq!(bits(&summary["final"]), bits(&alone["final"]), "input {input}");
    }
    assert_eq!(summaries.len(), 3);
}

fn lines_of(path: &Path, network: &[&str]) -> (Vec<Value>, Value) {
    let alone = ["play", argument(path), "--sensor", "32x24", "--json", "--speed", "100"];
    lines(&meissner(&[&alone[..], network].concat()))
}

#[test]
fn a_recording_that_repeats_goes_on_in_time() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = recording(folder.path(), "events.csv", 1000, 10, 500);
    let again = ["--repeat", "3", "--speed", "10", "--report-every", "1ms", "--network", "tactigraph-past"];
    let (code, lines) = played(&[&path], &[&again[..], &["--verify", "--overload", "block"]].concat());
    let summary = with(&lines, "summary")[0];
    assert_eq!((code, &summary["verified"]["equal"]), (Some(0), &true.into()), "{summary}");
    // Events at 0 to 4.99 ms have five reports, and the next lap begins with the last of them.
    assert_eq!((&summary["accepted"], &summary["reports"]["due"]), (&1500.into(), &15.into()), "{summary}");
    assert_eq!(summary["final"]["t_us"], 1000 + 2 * 5000 + 4990, "{summary}");
}

#[test]
fn an_input_whose_engine_fails_ends_and_the_others_go_on() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let network = small("tall", &[]);
    let description = Description::parse(&network).expect("it is consistent");
    // The values of an event without neighbours stay finite; sums over neighbours overflow.
    let drawn = draw(&description, 3);
    let tall = drawn.iter().map(|(name, tensor)| {
        let factor = if name.contains("norm") || name.contains("fc") { 1.0 } else { 1e30 };
        let values = tensor.values().expect("drawn").iter().map(|value| value * factor).collect();
        (name.to_owned(), Tensor::new(tensor.shape().to_vec(), values).expect("the same size"))
    });
    let remarks = BTreeMap::from([("trained".to_owned(), "false".to_owned())]);
    let [toml, weights] = ["tall.toml", "tall.safetensors"].map(|name| folder.path().join(name));
    std::fs::write(&toml, network).expect("it can be written");
    std::fs::write(&weights, Weights::new(tall).to_safetensors(&remarks)).expect("it can be written");

    let lone = recording(folder.path(), "lone.csv", 0, 1_000_000, 2);
    let dense = recording(folder.path(), "dense.csv", 0, 100, 300);
    let own = ["--network", argument(&toml), "--weights", argument(&weights), "--speed", "20"];
    let (code, lines) = played(&[&lone, &dense, &lone], &own);
    assert_eq!(code, Some(1));
    let (failed, summaries) = (with(&lines, "failed"), with(&lines, "summary"));
    assert_eq!((failed.len(), &failed[0]["input"]), (1, &1.into()), "{lines:?}");
    assert!(failed[0]["error"].as_str().expect("a text").contains("conv2"), "{}", failed[0]);
    let accepted: Vec<_> =
        summaries.iter().map(|summary| (&summary["input"], &summary["accepted"])).collect();
    assert_eq!(accepted, [(&0.into(), &2.into()), (&2.into(), &2.into())]);
}

#[test]
fn people_see_a_row_for_each_input() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let fine = recording(folder.path(), "fine.csv", 0, 100, 300);
    let burst = recording(folder.path(), "burst.csv", 0, 1, 3000);
    let output = meissner(&[
        "play",
        argument(&fine),
        argument(&burst),
        "--sensor",
        "32x24",
        "--network",
        "tactigraph-past",
        "--queue",
        "1000",
        "--speed",
        "1000",
    ]);
    let text = text(&output);
    assert!(output.status.success(), "{}", message(&output));
    for words in ["input 0 ", "input 1 ", "from input 1 by the queue: oldest", "engines and queues"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(!text.contains("from input 0"), "{text}");
    let report = text.lines().find(|line| line.starts_with("  1    10.000")).expect("a report at 10 ms");
    assert_eq!(report.split_whitespace().count(), 8, "a report fits one line: {report}");
}

#[test]
fn what_several_inputs_cannot_have_is_refused_as_usage() {
    let (folder, path) = crate::support::file("events.csv", "0,1,1,1\n");
    let path = argument(&path);
    for (arguments, named) in [
        (&["play", path, "-"][..], "recordings, if there are several"),
        (&["play", "udp://127.0.0.1:0", path], "recordings, if there are several"),
        (&["play", "-", "--repeat", "2"], "--repeat"),
        (&["play", path, "--pin", "0,4096"], "4096"),
        (&["play", path, "--repeat", "0"], "--repeat"),
    ] {
        let output = meissner(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", message(&output));
        assert!(message(&output).contains(named), "{arguments:?}: {}", message(&output));
    }
    drop(folder);
}
