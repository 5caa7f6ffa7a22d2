//! Input that is lost without anybody having asked for it: told on standard error with the likely
//! reason, and in JSON.

use std::io::{BufRead, BufReader, Write};
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::support::{argument, command, default_recording, file, meissner, message};

/// The last line of standard output, or what it has as its summary.
fn report(output: &Output) -> Value {
    assert!(output.status.success(), "{}", message(output));
    let text = crate::support::text(output);
    let last: Value = serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    if last["summary"].is_object() { last["summary"].clone() } else { last }
}

/// The reasons of a report, each of which is told on standard error with `advice`.
fn reasons(output: &Output, advice: &str) -> Vec<String> {
    let report = report(output);
    let warnings = report["warnings"].as_array().expect("a list");
    // That the weights were trained on another sensor is no loss of input.
    let said = message(output)
        .lines()
        .filter(|line| !line.starts_with("warning: weights"))
        .collect::<Vec<_>>()
        .join("\n");
    for warning in warnings {
        let [count, of] = ["count", "of"].map(|key| warning[key].as_u64().expect("a count"));
        assert!(count * 100 > of, "{warning}");
        let message = warning["message"].as_str().expect("a sentence");
        assert!(said.contains(message) && message.contains(advice), "{said}");
    }
    assert_eq!(said.lines().filter(|line| line.starts_with("warning: ")).count(), warnings.len(), "{said}");
    warnings.iter().map(|warning| warning["reason"].as_str().expect("a name").to_owned()).collect()
}

#[test]
fn events_outside_a_wrong_sensor_are_told_by_every_command_that_takes_one() {
    let recording = default_recording();
    for command in [
        &["run", "--json"][..],
        &["bench", "--json"],
        &["bench", "--json", "--compare", "force-tdnn", "--limit", "1000"],
        &["play", "--json", "--speed", "1000"],
    ] {
        let arguments = [command, &[argument(&recording), "--sensor", "120x120"]].concat();
        let output = meissner(&arguments);
        assert!(reasons(&output, "").contains(&"outside_sensor".to_owned()), "{command:?}");
        assert!(message(&output).contains("--sensor"), "{}", message(&output));
    }
    for command in ["run", "bench"] {
        let frames = [command, "--json", "--network", "force-tdnn", "--sensor", "120x120"];
        assert!(reasons(&meissner(&frames), "").contains(&"outside_sensor".to_owned()), "{command}");
    }
    assert!(reasons(&meissner(&["run", "--json"]), "").is_empty(), "the right sensor loses nothing");
}

#[test]
fn late_events_of_columns_in_another_order_are_told() {
    let line = |i: u32| format!("{},{},{},1\n", i * 7 % 30, i * 11 % 30, i * 5);
    let (_folder, path) = file("xytp.csv", (0..842).map(line).collect::<String>());
    let taken = ["run", argument(&path), "--columns", "txyp", "--sensor", "30x4300"];
    let output = meissner(&[&taken[..], &["--json"]].concat());
    assert_eq!(reasons(&output, "columns"), ["late"]);
    let clamped = [&taken[..], &["--late", "clamp", "--json"]].concat();
    assert!(reasons(&meissner(&clamped), "").is_empty(), "they are let in because that was asked for");
}

#[test]
fn events_outside_the_crop_of_a_network_are_told() {
    let line = |i: u32| format!("{},{},{},1\n", i * 500, 1 + i % 9, i % 200);
    let (_folder, path) = file("edge.csv", (0..500).map(line).collect::<String>());
    let arguments = ["run", argument(&path), "--sensor", "346x260", "--network", "force-tdnn", "--json"];
    assert_eq!(reasons(&meissner(&arguments), "meissner inspect"), ["outside_crop"]);
}

#[test]
fn a_live_stream_is_told_while_it_goes_on() {
    let mut child = command(&["run", "-", "--sensor", "346x260", "--every", "end"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut input = child.stdin.take().expect("standard input is piped");
    let mut said = BufReader::new(child.stderr.take().expect("standard error is piped")).lines();
    let line = |i: u32| format!("{i},{},1,1\n", i % 16 * 43);
    let events: String = (0..1000).map(line).collect();
    input.write_all(events.as_bytes()).expect("the program reads");
    // This would wait forever if it were told at the end alone.
    let warning = said.find(|line| line.as_ref().is_ok_and(|line| line.starts_with("warning: ")));
    let line = warning.expect("a warning").expect("it is text");
    assert!(line.contains("434 of 1,000 (43.4 %) events are outside the sensor of 346x260 pixels"), "{line}");
    drop(input);
    assert!(said.next().is_none(), "it is told once");
    assert!(child.wait().expect("the program ends").success());
}

/// A sensor that is connected again after two seconds: 500 events of either clock, and one stamp
/// far ahead.
fn restarted() -> String {
    let line = |t: u32, i: u32| format!("{t},{},{},1\n", i % 100 + 20, i * 7 % 80 + 20);
    let old = (0..500).map(|i| line(2_000_000 + 100 * i, i));
    let new = (0..500).map(|i| line(100 * i, i));
    let far = std::iter::once("999000000000,30,30,1\n".to_owned());
    old.chain(new.clone().take(250)).chain(far).chain(new.skip(250)).collect()
}

#[test]
fn a_restart_of_the_clock_is_told_and_the_events_after_it_are_taken() {
    let (_folder, path) = file("restarted.csv", restarted());
    for network in ["tactigraph-past", "force-lstm"] {
        let run = |rest: &[&str]| {
            let arguments = ["run", argument(&path), "--sensor", "346x260", "--network", network, "--json"];
            meissner(&[&arguments, rest].concat())
        };
        let output = run(&[]);
        assert!(message(&output).contains("the clock of the sensor has restarted"), "{}", message(&output));
        let told = report(&output);
        assert_eq!((&told["restarts"], &told["accepted"]), (&1.into(), &1000.into()), "{network}");
        assert_eq!(
            (&told["dropped"]["late"], &told["dropped"]["outlier"]),
            (&0.into(), &1.into()),
            "{network}"
        );
        assert_eq!(told["warnings"][0]["reason"], "restart");
        let kept = report(&run(&["--restart", "keep"]));
        assert_eq!((&kept["restarts"], &kept["accepted"]), (&0.into(), &501.into()), "{network}");
    }
}

#[test]
fn reports_say_what_a_restart_of_the_clock_costs() {
    let (_folder, path) = file("restarted_play.csv", restarted());
    let arguments = ["play", "-", "--sensor", "346x260", "--report-every", "5ms", "--json"];
    let output = command(&arguments)
        .stdin(std::fs::File::open(&path).expect("the file is there"))
        .output()
        .expect("the program runs");
    let told = report(&output);
    assert_eq!((&told["restarts"], &told["accepted"]), (&1.into(), &1000.into()));
    assert_eq!(told["final"]["t_us"], 49_900);
}

#[test]
fn what_a_filter_drops_is_not_lost() {
    let output = meissner(&["run", "--stride", "10", "--json"]);
    assert!(reasons(&output, "").is_empty());
    assert_eq!(message(&output), "");
}
