//! MCAP in and out: a log that is read again, also when damaged. Other readers and writers are in
//! `tests/peers/test_mcap.py`.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use meissner_engine::{Event, Sensor};
use meissner_io::{McapWriter, ReadOptions, encode_png, read, read_with};
use serde_json::Value;
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, bits, command, default_recording, lines, meissner, message, picture_network};

/// A folder with the log of a run with these arguments in it, and the predictions.
fn logged(arguments: &[&str]) -> (TempDir, PathBuf, Vec<Value>) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("log.mcap");
    let all = [arguments, &["--mcap", argument(&path), "--json"]].concat();
    let (predictions, _) = lines(&meissner(&all));
    (folder, path, predictions)
}

#[test]
fn a_log_has_the_events_and_gives_the_same_predictions_again() {
    let recording = default_recording();
    for network in ["tactigraph-past", "force-lstm"] {
        let input = argument(&recording);
        let (_folder, log, predictions) = logged(&["run", input, "--network", network, "--limit", "9000"]);
        let events = read(&log).expect("it can be read").events;
        let all = read(&recording).expect("it can be read").events;
        let stride = if all[1] == events[1] { 1 } else { 2 };
        let expected: Vec<_> = all.into_iter().step_by(stride).take(9000).collect();
        assert_eq!(events, expected, "{network}");
        let topics = read(&log).expect("it can be read").other_streams;
        let found: Vec<_> = topics.iter().map(|topic| (&*topic.name, topic.elements)).collect();
        let made = predictions.len() as u64;
        assert_eq!(found[1..], [("/prediction", made), ("/latency", made)], "{network}");
        assert!(found[0].0 == "/events/image" && found[0].1 > 0);
        if stride == 1 {
            let (again, _) = lines(&meissner(&["run", argument(&log), "--network", network, "--json"]));
            assert_eq!(
                again.iter().map(bits).collect::<Vec<_>>(),
                predictions.iter().map(bits).collect::<Vec<_>>(),
                "{network}"
            );
        }
    }
}

#[test]
fn a_play_logs_every_event_that_it_takes() {
    let recording = default_recording();
    let input = argument(&recording);
    let arguments = ["play", input, "--speed", "4", "--limit", "20000", "--overload", "block"];
    let (_folder, log, predictions) = logged(&arguments);
    let all = read(&recording).expect("it can be read").events;
    let taken = read(&log).expect("it can be read");
    assert_eq!(taken.events, all[..taken.events.len()]);
    assert_eq!(taken.events.len(), 20_000);
    let reports = taken.other_streams.iter().find(|topic| topic.name == "/prediction");
    assert_eq!(reports.map(|topic| topic.elements), Some(predictions.len() as u64));
    // With several inputs, each has its own topics.
    let (_folder, log, _) = logged(&["play", input, input, "--speed", "9", "--limit", "900"]);
    let second = read_with(&log, ReadOptions::default().stream(std::num::NonZeroU16::new(2)));
    let second = second.expect("it can be read");
    assert_eq!(second.events, all[..900]);
    assert!(second.other_streams.iter().any(|topic| topic.name == "/input0/prediction"));
}

#[test]
fn pictures_in_a_file_are_run_with_their_numbers_and_overlays() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let [network, weights] = picture_network(folder.path());
    let [bag, drawn] = ["bag.mcap", "drawn"].map(|name| folder.path().join(name));
    let mut writer = McapWriter::new(Vec::new()).expect("memory");
    let channel = writer.json_channel("/camera", "foxglove.CompressedImage", "{}").expect("memory");
    for level in [10, 60, 200] {
        let png = encode_png(32, 24, &[level; 32 * 24 * 3]).expect("an image");
        let message = format!(r#"{{"format":"png","data":"{}"}}"#, base64(&png));
        writer.message(channel, level.into(), message.as_bytes()).expect("memory");
    }
    std::fs::write(&bag, writer.finish().expect("memory")).expect("it is written");
    let (network, weights) = (argument(&network), argument(&weights));
    let arguments = ["run", argument(&bag), "--network", network, "--weights", weights, "--json"];
    let output = meissner(&[&arguments[..], &["--overlay", argument(&drawn)]].concat());
    let (predictions, _) = lines(&output);
    let names: Vec<_> = predictions.iter().map(|line| line["image"].as_str().expect("a path")).collect();
    assert_eq!(names.len(), 3);
    assert!(names[2].ends_with("bag.mcap/000003.png"), "{names:?}");
    assert!(drawn.join("000003.png").is_file());
    fails(&meissner(&["run", argument(&bag)]), 1, &["found /camera (frames)"]);
}

/// Base64 with padding.
fn base64(bytes: &[u8]) -> String {
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let bits = (0..3).fold(0_u32, |bits, i| bits << 8 | u32::from(*three.get(i).unwrap_or(&0)));
        let digit = |i: usize| char::from(alphabet[(bits >> (18 - 6 * i) & 63) as usize]);
        text.extend((0..4).map(|i| if i <= three.len() { digit(i) } else { '=' }));
    }
    text
}

#[test]
fn a_log_is_not_replaced_unless_asked_and_is_for_events() {
    let (_folder, log, _) = logged(&["run", "--limit", "500"]);
    let arguments = ["run", "--limit", "800", "--mcap", argument(&log)];
    fails(&meissner(&arguments), 2, &["expected no such file, found one: --force replaces it"]);
    assert_eq!(read(&log).expect("it can be read").events.len(), 500);
    assert!(meissner(&[&arguments[..], &["--force"]].concat()).status.success());
    assert_eq!(read(&log).expect("it can be read").events.len(), 800);
    let output = meissner(&["run", "a.png", "--network", "canf", "--mcap", "b.mcap"]);
    fails(&output, 2, &["--mcap is for"]);
    let output = meissner(&["run", "--mcap", "no/such/folder/a.mcap"]);
    fails(&output, 1, &["no/such/folder/a.mcap"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_takes_no_prediction_away_and_is_told() {
    let (whole, _) = lines(&meissner(&["run", "--limit", "9000", "--json"]));
    let output = meissner(&["run", "--limit", "9000", "--json", "--mcap", "/dev/full"]);
    assert_eq!(output.status.code(), Some(1));
    let told = message(&output);
    assert!(told.contains("cannot write /dev/full") && told.contains("No space left on device"), "{told}");
    let text = crate::support::text(&output);
    let shown: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    // The header, the predictions and the summary.
    assert_eq!(shown.len(), whole.len() + 2);
    assert_eq!(
        shown[1..=whole.len()].iter().map(bits).collect::<Vec<_>>(),
        whole.iter().map(bits).collect::<Vec<_>>()
    );
}

#[test]
fn a_program_that_is_killed_leaves_all_but_the_last_second() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let log = folder.path().join("log.mcap");
    let arguments = ["run", "-", "--sensor", "346x260", "--json", "--every", "1", "--mcap", argument(&log)];
    let mut child = command(&arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let mut input = child.stdin.take().expect("it is piped");
    let output = BufReader::new(child.stdout.take().expect("it is piped"));
    // The time at which each event was predicted. The first line is the header.
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        output.lines().skip(1).map_while(Result::ok).try_for_each(|_| sender.send(Instant::now()))
    });
    let mut shown: Vec<Instant> = Vec::new();
    let mut sent = 0;
    // Several flushes lie between the first prediction and the last.
    while shown.len() <= 1_000 || shown[0].elapsed() < Duration::from_secs(2) {
        shown.extend(receiver.try_iter());
        writeln!(input, "{},{},7,1", sent * 100, sent % 300).expect("the program reads");
        sent += 1;
        std::thread::sleep(Duration::from_millis(1));
    }
    // During a silence, nothing waits longer than this.
    std::thread::sleep(Duration::from_millis(900));
    child.kill().expect("it runs");
    let killed = Instant::now();
    child.wait().expect("it ends");
    shown.extend(receiver);
    let before = shown.iter().filter(|at| killed.duration_since(**at) > Duration::from_millis(850)).count();
    let found = read_with(&log, ReadOptions::default().salvage(true)).expect("it can be read");
    assert!(before > 1_000 && found.events.len() >= before, "{} of {before}", found.events.len());
    let expected = |i: i64| Event::new(i * 100, (i % 300) as u16, 7, true);
    assert!(found.events.iter().zip(0..).all(|(event, i)| *event == expected(i)));
    assert_eq!(found.sensor, Some(Sensor::new(346, 260)));
    let output = meissner(&["info", argument(&log)]);
    fails(&output, 1, &["is cut short", "--salvage"]);
    let output = meissner(&["run", argument(&log), "--salvage", "--json"]);
    assert!(output.status.success(), "{}", message(&output));
}

#[test]
fn a_recording_is_converted_to_a_bag_and_back() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let [bag, back] = ["a.mcap", "a.evt3"].map(|name| folder.path().join(name));
    let recording = default_recording();
    assert!(meissner(&["convert", argument(&recording), argument(&bag)]).status.success());
    assert!(meissner(&["convert", argument(&bag), argument(&back)]).status.success());
    assert_eq!(read(&back).expect("it can be read").events, read(&recording).expect("it can be read").events);
}
