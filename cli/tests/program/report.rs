//! `meissner report`: pages of results of the other commands, and refused files.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{
    argument, default_recording, meissner, meissner_reading, message, picture_network, text,
};

/// Writes the output of `command` into a file of `folder`.
fn result(folder: &Path, name: &str, command: &[&str]) -> PathBuf {
    let output = meissner(command);
    assert!(output.status.success(), "{}", message(&output));
    let path = folder.join(name);
    fs::write(&path, output.stdout).expect("it is written");
    path
}

/// The page of `results`.
fn page(folder: &Path, results: &[&str]) -> String {
    let out = folder.join("page.html");
    let output = meissner(&[&["report"], results, &["--out", argument(&out)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).is_empty());
    let page = fs::read_to_string(out).expect("a page");
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    assert!(!page.contains("<script") && !page.contains("http://") || page.contains("xmlns"), "{page}");
    page
}

#[test]
fn a_page_compares_runs_benches_and_plays_and_says_which_command_made_them() {
    let folder = TempDir::new().expect("a folder");
    let at = folder.path();
    let run = result(at, "run.json", &["run", "--every", "10ms", "--json"]);
    let bench = result(at, "bench.json", &["bench", "--limit", "300", "--warmup", "0", "--json"]);
    let play = result(at, "play.json", &["play", "--limit", "300", "--speed", "1000", "--json"]);
    let page = page(at, &[argument(&run), argument(&bench), argument(&play)]);
    for expected in [
        "3 results compared",
        "meissner run --every 10ms --json",
        "meissner bench --limit 300 --warmup 0 --json",
        "roll, true",
        "Rows by layer",
        "Where the time goes",
        "from an event to its report",
        "conv1",
        "level 0: events",
    ] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
}

#[test]
fn a_soak_and_a_study_have_their_pages() {
    let folder = TempDir::new().expect("a folder");
    let recording = default_recording();
    let recording = recording.to_str().expect("text");
    let soak = folder.path().join("soak.json");
    let command = ["verify", "tactigraph-past", recording, "--soak", "--events", "2000", "--out"];
    assert!(meissner(&[&command[..], &[argument(&soak)]].concat()).status.success());
    let study = ["pareto", "angle", recording, "--timed-events", "300", "--repeat", "1", "--json"];
    let study =
        result(folder.path(), "study.json", &[&study[..], &["--network", "tactigraph-past"]].concat());
    let page = page(folder.path(), &[argument(&soak), argument(&study)]);
    for expected in ["kept every promise over 2,000 events", "relative RMS error", "on the front"] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
}

#[test]
fn a_verification_stress_and_a_loop_have_their_pages() {
    let folder = TempDir::new().expect("a folder");
    let at = folder.path();
    let verify = result(at, "verify.json", &["verify", "tactigraph-past", "--cases", "2", "--json"]);
    let only = ["--only", "one instant", "--only", "ordinary", "--only", "tanh"];
    let stress = [&["verify", "--stress", "--quick", "--json"], &only[..]].concat();
    let stress = result(at, "stress.json", &stress);
    let [network, weights] = picture_network(at);
    let weights = ["--network", argument(&network), "--weights", argument(&weights)];
    let of_loop =
        [&["simulate", "loop", "--seconds", "2", "--stale", "80ms", "--json"], &weights[..]].concat();
    let of_loop = result(at, "loop.json", &of_loop);
    let page = page(at, &[argument(&verify), argument(&stress), argument(&of_loop)]);
    for expected in [
        "3 results compared",
        "tactigraph-past equals full recomputation bit for bit at",
        "Every promise held in",
        "streams: error by condition",
        "Error by layer",
        "units in the last place",
        "the force is off its saw-tooth by",
        "80 ms later",
        "distance from the goal",
    ] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
}

#[test]
fn a_table_says_what_was_true_of_a_run_from_standard_input() {
    let folder = TempDir::new().expect("a folder");
    let recording = default_recording();
    let run = meissner(&["run", argument(&recording), "--every", "20ms", "--json"]);
    let [labels, out] = ["labels.csv", "page.html"].map(|name| folder.path().join(name));
    fs::write(&labels, "t_us,roll_deg,pitch_deg\n0,5.71,-1.85\n300000,5.71,-1.85\n").expect("it is written");
    let words = ["report", "-", "--truth", argument(&labels), "--out", argument(&out)];
    let output = meissner_reading(&words, &text(&run));
    assert!(output.status.success(), "{}", message(&output));
    let page = fs::read_to_string(&out).expect("a page");
    assert!(page.contains("Against the truth it is off by") && page.contains("pitch, true"), "{page}");
    // A constant truth has no picture over true values.
    assert!(!page.contains("predicted (degrees)"), "{page}");
    fs::write(&labels, "t_us,roll_deg,pitch_deg\n0,0,-1.85\n300000,9,-1.85\n").expect("it is written");
    assert!(meissner_reading(&words, &text(&run)).status.success());
    let page = fs::read_to_string(&out).expect("a page");
    assert_eq!(page.matches(">predicted (degrees)<").count(), 1, "{page}");
    fs::write(&labels, "recording,class\na,b\n").expect("it is written");
    fails(&meissner_reading(&words, &text(&run)), 2, &["labels.csv", "times of the sensor"]);
}

#[test]
fn what_is_no_result_is_refused_by_its_name_and_leaves_the_page_as_it_was() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("page.html");
    fs::write(&out, "before").expect("it is written");
    let report = |of: &Path| meissner(&["report", argument(of), "--out", argument(&out)]);
    fails(&report(&default_recording()), 1, &["expected a result", "a recording of events (EVT3)"]);
    fails(&report(folder.path()), 1, &["expected a result", "a folder"]);
    fails(&report(&folder.path().join("none.json")), 1, &["none.json"]);
    let list = result(folder.path(), "networks.json", &["networks", "--json"]);
    fails(&report(&list), 1, &["`meissner networks`"]);
    let table = result(folder.path(), "table.txt", &["run", "--every", "50ms"]);
    fails(&report(&table), 1, &["--json?"]);
    assert_eq!(fs::read_to_string(&out).expect("a file"), "before");
}

#[test]
fn a_stream_that_was_cut_is_shown_as_far_as_it_goes_and_a_long_one_is_small() {
    let folder = TempDir::new().expect("a folder");
    let run = result(folder.path(), "run.json", &["run", "--every", "50ms", "--json"]);
    let whole = fs::read_to_string(&run).expect("lines");
    let mut lines: Vec<&str> = whole.lines().collect();
    let (header, prediction) = (lines.remove(0), lines.remove(0));
    let mut long = format!("{header}\n");
    for i in 1..=50_000 {
        let _ = writeln!(long, "{}", prediction.replacen("\"t_us\":", &format!("\"t_us\":{i}"), 1));
    }
    long.push_str(&prediction[..prediction.len() / 2]);
    fs::write(&run, long).expect("it is written");
    let out = folder.path().join("page.html");
    let output = meissner(&["report", argument(&run), "--out", argument(&out)]);
    assert!(
        output.status.success() && message(&output).contains("Line 50002 is cut short"),
        "{}",
        message(&output)
    );
    let page = fs::read_to_string(&out).expect("a page");
    assert!(page.contains("50,000 predictions") && page.len() < 200_000, "{}", page.len());
}

#[test]
fn a_full_disk_is_an_error() {
    if Path::new("/dev/full").exists() {
        let folder = TempDir::new().expect("a folder");
        let run = result(folder.path(), "run.json", &["run", "--every", "50ms", "--json"]);
        fails(&meissner(&["report", argument(&run), "--out", "/dev/full"]), 1, &["/dev/full"]);
    }
}
