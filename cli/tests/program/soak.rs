//! `meissner verify --soak` in its short form: bits, every kind of disturbance, and runs that are
//! determined by their seed.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{argument, file, meissner, message, text, written};

/// A run that ends well, and what it wrote.
fn soak(arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("soak.json");
    let output = meissner(&[&["verify"], arguments, &["--soak", "--out", argument(&path)]].concat());
    assert!(output.status.success(), "{}\n{}", message(&output), text(&output));
    assert!(text(&output).contains("equal to the batch at"), "{}", text(&output));
    written(&path)
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is a count"))
}

/// What no clock and no allocator reaches.
fn deterministic(report: &Value) -> Vec<String> {
    let checkpoints = report["checkpoints"].as_array().expect("checkpoints");
    let of = |row: &Value| {
        ["events", "t_us", "nodes", "compared", "bits"].map(|key| row[key].to_string()).join(" ")
    };
    let mut told: Vec<String> = checkpoints.iter().map(of).collect();
    told.push(report["disturbances"].to_string());
    told
}

/// Every promise holds over a run of so many checkpoints, and everything was done that a soak does.
fn holds(report: &Value, checkpoints: usize) {
    assert_eq!(report["broken"], Value::Array(Vec::new()));
    let rows = report["checkpoints"].as_array().expect("checkpoints");
    assert_eq!(rows.len(), checkpoints);
    for row in rows {
        assert_eq!(row["equal"], true, "{row}");
        let quantiles =
            ["p50", "p90", "p99", "p999", "max"].map(|key| row["latency_us"]["push"][key].as_f64());
        assert!(quantiles.is_sorted() && quantiles[0] > Some(0.0), "{row}");
    }
    let done = &report["disturbances"];
    for kind in ["silences", "advances", "bytes", "snapshots", "resets"] {
        assert!(count(&done[kind]) > 0, "{kind}: {done}");
    }
    assert_eq!(done["returns_that_differ"], 0);
    assert!(rows.iter().any(|row| count(&row["nodes"]) > 500), "windows are full at some checkpoints");
}

#[test]
fn a_network_over_the_past_soaks_without_a_changed_bit() {
    let network = ["tactigraph-past", "--events", "2e5", "--checkpoint-every", "1e4"];
    let report = soak(&[&network[..], &["--disturb-every", "5e3", "--memory-growth", "25"]].concat());
    holds(&report, 20);
    assert_eq!((count(&report["events"]), count(&report["rounds"])), (200_000, 6));
    let known = report["checkpoints"][0]["resident_bytes"].is_u64();
    assert_eq!((known, report["memory"].is_object()), (cfg!(target_os = "linux"), true));
    assert!(report["checkpoints"][0]["live_bytes"].as_u64() > Some(100_000), "{report}");
}

#[test]
fn a_network_over_all_neighbours_soaks_without_a_changed_bit() {
    let network = ["graphres", "--events", "2e4", "--checkpoint-every", "2e3"];
    let report = soak(&[&network[..], &["--disturb-every", "1e3", "--every", "10"]].concat());
    holds(&report, 10);
    assert_eq!(report["memory"], Value::Null, "ten checkpoints are too few");
}

#[test]
fn a_run_is_its_seeds() {
    let run = |seed| {
        let network = ["tactigraph-past", "--events", "3e4", "--checkpoint-every", "5e3"];
        deterministic(&soak(
            &[&network[..], &["--disturb-every", "1e3", "--every", "100", "--seed", seed]].concat(),
        ))
    };
    let first = run("5");
    assert_eq!(first, run("5"));
    assert_ne!(first, run("6"));
}

#[test]
fn several_recordings_follow_one_another_on_the_largest_sensor() {
    let (_one, small) = file("small.csv", "# sensor 8x20\n0,1,1,1\n100,2,2,1\n90,3,3,0\n");
    let (_two, wide) = file("wide.csv", "# sensor 30x8\n5000000,29,7,1\n5000100,2,2,1\n");
    let recordings = ["tactigraph-past", argument(&small), argument(&wide)];
    let arguments = ["--events", "1000", "--checkpoint-every", "100", "--disturb-every", "10"];
    let report = soak(&[&recordings[..], &arguments].concat());
    assert_eq!(report["header"]["input"]["sensor"].to_string(), "[30,20]");
    assert_eq!(
        (count(&report["rounds"]), count(&report["accepted"]) < 1_000),
        (399, true),
        "one stamp steps back"
    );
    assert_eq!(report["broken"], Value::Array(Vec::new()));
}

#[test]
fn what_cannot_be_soaked_is_refused() {
    let (_folder, empty) = file("empty.csv", "# sensor 8x8\nt,x,y,p\n");
    let soak = |network: &str, more: &[&str]| meissner(&[&["verify", network, "--soak"], more].concat());
    fails(&soak("graphres", &[argument(&empty), "--events", "10"]), 2, &["empty.csv", "events"]);
    fails(&soak("graphres", &["--events", "1.5"]), 2, &["--events"]);
    fails(&soak("graphres", &[]), 2, &["--events"]);
    fails(&soak("graphres", &["--events", "10", "--cases", "3"]), 2, &["--soak", "--cases"]);
    fails(&soak("canf", &["--events", "10"]), 1, &["canf", "frame network"]);
    fails(&meissner(&["verify", "graphres", "--events", "10"]), 2, &["--soak"]);
}

#[test]
fn the_former_name_soaks_with_its_options() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("soak.json");
    let options = ["--events", "3000", "--checkpoint-every", "1000", "--disturb-every", "500"];
    let former = ["soak", "--network", "tactigraph-past", "--json", argument(&path)];
    let output = meissner(&[&former[..], &options].concat());
    assert!(
        output.status.success() && text(&output).contains("equal to the batch at"),
        "{}",
        message(&output)
    );
    let former = written(&path);
    assert_eq!(deterministic(&former), deterministic(&soak(&[&["tactigraph-past"], &options[..]].concat())));
    fails(&meissner(&["soak", "--events", "1.5"]), 2, &["--events"]);
}
