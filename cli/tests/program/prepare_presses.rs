//! `prepare presses`: labels and recordings of users, from a folder to a file that `eval` reads.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, meissner, meissner_reading, message, text, words};

/// A folder of four recordings of CSV, and a table.
fn folder(labels: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    for press in 0..4_i64 {
        let mut events = "# sensor 346x260\nt,x,y,p\n".to_owned();
        for i in 0..150 {
            let (t_us, x, y) = (press * 1_000_000 + i * 1_000, (i * 7 + press) % 346, (i * 3) % 260);
            writeln!(events, "{t_us},{x},{y},{}", i % 2).expect("a text takes everything");
        }
        put(folder.path(), &format!("press{press}.csv"), &events);
    }
    put(folder.path(), "labels.csv", labels);
    folder
}

fn refused(arguments: &[&str], status: i32, expected: &[&str]) {
    fails(&meissner(arguments), status, expected);
}

fn put(folder: &Path, name: &str, content: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, content).expect("it can be written");
    path
}

const LABELS: &str = "recording,t_ms,roll_deg,pitch_deg,class\n\
                      press0,0,0,0,a\npress0,140,3,1,a\npress1,1140,2,2,b\npress2,2140,1,3,a\npress3,3140,0,4,b\n";

#[test]
fn a_folder_without_oddities_is_described_and_written_for_training() {
    let folder = folder(LABELS);
    let out = folder.path().join("mine.safetensors");
    let arguments =
        ["prepare", "presses", argument(folder.path()), "--out", argument(&out), "--folds", "2", "--strict"];
    let output = meissner(&arguments);
    assert!(output.status.success(), "{}", message(&output));
    assert_eq!(message(&output), "");
    let said = words(&output);
    for part in [
        "recordings 4, 346x260",
        "presses 4 with labels",
        "events 600",
        "median 149,000 us, 1,007 events/s",
        "labels 5 instants from",
        "offset none: the labels have times of the sensor, or none",
        "roll deg 5 4 0 1.200 3.000",
        "pitch deg 5 5 0 2.000 4.000",
        "class presses instants",
        "a 2 3",
        "b 2 2",
        "mine.safetensors: 600 events of 4 presses, in 2 folds",
    ] {
        assert!(said.contains(part), "{part}: {}", text(&output));
    }
    // The file is not mistaken for a recording, and is not replaced silently.
    refused(&arguments, 2, &["no such file", "--force replaces it"]);
    let forced = meissner(&[&arguments[..], &["--force"]].concat());
    assert!(forced.status.success(), "{}", message(&forced));
    let judged =
        meissner(&["eval", "angle", argument(&out), "--network", "tactigraph-past", "--every", "50ms"]);
    assert!(judged.status.success(), "{}", message(&judged));
    let graphs = folder.path().join("graphs.safetensors");
    let graphs = meissner(&[
        "prepare",
        "graphs",
        argument(&out),
        "--network",
        "tactigraph",
        "--out",
        argument(&graphs),
    ]);
    assert!(graphs.status.success(), "{}", message(&graphs));
}

#[test]
fn oddities_are_notes_and_with_strict_an_error() {
    let folder = folder(&format!("{LABELS}press9,0,1,1,a\npress3,3140,0,4,b\n"));
    put(folder.path(), "notes.txt", "it was cold\n");
    put(folder.path(), "press4.bag", "#ROSBAG V2.0\n");
    let output = meissner(&["prepare", "presses", argument(folder.path())]);
    assert!(output.status.success(), "{}", message(&output));
    let notes = message(&output);
    for part in [
        "note: files that are no recordings: ",
        "press4.bag",
        "note: labels that name no recording: line 7: \"press9\" (similar: press",
        "note: rows that repeat another one: line 8, after line 6",
    ] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
    assert_eq!(notes.lines().count(), 3, "{notes}");
    let strict = meissner(&["prepare", "presses", argument(folder.path()), "--strict"]);
    let error = "error: --strict: expected nothing odd about the presses, found 3 kinds of oddities";
    assert_eq!((message(&strict), strict.status.code()), (format!("{notes}{error}\n"), Some(1)));
    assert_eq!(text(&strict), "");
}

#[test]
fn a_log_of_poses_joins_with_an_offset_of_either_sign() {
    let folder = folder(LABELS);
    let poses = (0..200).map(|i| format!("{},{}\n", 500.0 + f64::from(i) * 0.02, i % 9));
    let poses = poses.collect::<Vec<_>>().concat();
    let poses = put(folder.path(), "robot.csv", &format!("host_s,z_mm\n{poses}"));
    let folder = argument(folder.path());
    let joined = ["prepare", "presses", folder, "--labels", argument(&poses), "--offset", "-500s"];
    let output = meissner(&joined);
    assert!(output.status.success(), "{}", message(&output));
    assert!(words(&output).contains("offset -500s"), "{}", text(&output));
    assert!(words(&output).contains("z mm 36 "), "{}", text(&output));
    let apart = ["prepare", "presses", folder, "--labels", argument(&poses), "--offset", "500s"];
    refused(&apart, 2, &["--offset", "an offset that puts poses into recordings"]);
    let odd = ["prepare", "presses", folder, "--labels", argument(&poses), "--offset", "soon"];
    refused(&odd, 2, &["--offset", "a time with its unit"]);
}

#[test]
fn what_is_no_table_or_no_folder_is_a_named_error() {
    let folder = folder("recording,t_ms,x\npress0,soon,1\n");
    let presses = ["prepare", "presses", argument(folder.path())];
    refused(&presses, 1, &["labels.csv", "time at line 2", "`soon` in column 2"]);
    fs::remove_file(folder.path().join("labels.csv")).expect("it is there");
    refused(&presses, 2, &["--labels", "a table of labels"]);
    let missing = folder.path().join("missing");
    refused(&["prepare", "presses", argument(&missing)], 2, &["--labels", "labels.csv"]);
    let few = put(folder.path(), "labels.csv", "recording,x\npress0,1\npress1,2\n");
    let out = few.with_file_name("out.safetensors");
    let folds = meissner(&[&presses[..], &["--out", argument(&out)]].concat());
    assert!(message(&folds).contains("error: folds: expected 2 to 2"), "{}", message(&folds));
    assert_eq!((folds.status.code(), text(&folds)), (Some(2), String::new()));
    assert!(!out.exists());
}

/// From a stream to labelled presses, as docs/own-sensor.md describes it.
#[test]
fn what_record_split_from_a_stream_joins_with_labels_of_the_host_by_its_list() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let presses = folder.path().join("mine");
    // Three presses of 100 ms, one second apart.
    let mut events = String::new();
    for i in 0..300 {
        let (x, y) = (i % 64, i / 64);
        writeln!(events, "{},{x},{y},1", 7_000_000 + i / 100 * 1_000_000 + i % 100 * 1_000).expect("a text");
    }
    let out = argument(&presses);
    let record = ["record", "-", "--sensor", "64x64", "--out", out, "--split-on-silence", "300ms"];
    let recorded = meissner_reading(&record, &events);
    assert!(recorded.status.success(), "{}", message(&recorded));
    let list = fs::read_to_string(presses.join("recordings.csv")).expect("the list is there");
    let host =
        |line: &str| line.rsplit(',').next().and_then(|host| host.parse::<i64>().ok()).expect("a time");
    let host = host(list.lines().nth(1).expect("a row"));
    // All arrived at once, so that only the first one has the right time.
    let mut labels = "host_us,force_n\n".to_owned();
    for i in -10..300 {
        writeln!(labels, "{},{}", host + i * 10_000, i * i % 7).expect("a text");
    }
    put(&presses, "labels.csv", &labels);
    let offset = format!("{}us", 7_000_000 - host);
    for arguments in [&["prepare", "presses", out][..], &["prepare", "presses", out, "--offset", &offset]] {
        let output = meissner(arguments);
        assert!(output.status.success(), "{}", message(&output));
        assert!(words(&output).contains("recordings 3, 64x64"), "{}", text(&output));
    }
    let output = meissner(&["prepare", "presses", out, "--offset", &offset]);
    assert!(words(&output).contains("presses 3 with labels events 300"), "{}", text(&output));
    assert!(words(&output).contains("force N 33 7 "), "{}", text(&output));
}
