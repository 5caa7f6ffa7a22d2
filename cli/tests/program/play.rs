//! Recordings at real speed: every report is made, every event is counted, and the end equals
//! batch.

use serde_json::Value;

use crate::shared_files::shared;
use crate::support::{argument, bits, file, lines, meissner, message, text};

const POLICIES: [&str; 7] =
    ["block", "drop-oldest", "drop-newest", "thin:4", "filter:1250us", "refractory:1000us", "rate:400000"];

/// Asserts that every event of `summary` is somewhere, and that each of its reports was made.
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
        (0..2000).map(|i| format!("{},{},{},{}\n", i * 10, i * 7 % 32, i / 9 % 24, i % 2)).collect();
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
    assert_eq!(report.split_whitespace().count(), 7, "a report fits one line: {report}");
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
