//! Lines and events that are left out, refused or lost: reported on standard error and in JSON, and
//! an error with `--strict`.

use std::io::{BufRead, BufReader, Write};
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{
    argument, command, default_recording, file, lines, meissner, meissner_reading, message, object, text,
    times,
};

/// The last line of standard output, or its summary.
fn report(output: &Output) -> Value {
    assert!(output.status.success(), "{}", message(output));
    let text = crate::support::text(output);
    let last: Value = serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    if last["summary"].is_object() { last["summary"].clone() } else { last }
}

/// The reasons of a report; each is printed on standard error with `advice`.
fn reasons(output: &Output, advice: &str) -> Vec<String> {
    let report = report(output);
    let warnings = report["warnings"].as_array().expect("a list");
    // The warning that the weights were trained on another sensor is not a loss of input.
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
    let line = |i: u32| format!("{i},{},{},1\n", i % 16 * 43, i / 16);
    let events: String = (0..1000).map(line).collect();
    input.write_all(events.as_bytes()).expect("the program reads");
    // This would wait without end if the warning were printed only at the end.
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

#[test]
fn info_convert_and_run_tell_what_is_left_out_and_refuse_it_when_they_are_strict() {
    // Time, row and an event; two words of padding; events in a row outside the sensor and of
    // another system; a good one.
    let words =
        [0x8000_u16, 0x6001, 0x0005, 0x2807, 0x9999, 0x9999, 0x07ff, 0x2001, 0x1005, 0x2002, 0x0004, 0x2803];
    let header = b"% evt 3.0\n% format EVT3;height=60;width=80\n% end\n";
    let words: Vec<u8> = words.into_iter().flat_map(u16::to_le_bytes).collect();
    let lines_of_text = b"# sensor 80x60\n1,7,5,1\noops\n1,3,4,1\n1,3,70,1\n2,7,5,1\n".to_vec();
    for (content, kinds, events) in [
        (
            [&header[..], &words].concat(),
            vec![("other_words", 2), ("outside_sensor", 1), ("other_events", 1)],
            2,
        ),
        (lines_of_text, vec![("lines", 2)], 3),
    ] {
        let (folder, path) = file("odd", content);
        let (path, to) = (argument(&path), folder.path().join("to.csv"));
        let output = meissner(&["info", path, "--json"]);
        let info = object(&output);
        let left_out = info["left_out"].as_array().expect("a list");
        let found: Vec<_> =
            left_out.iter().map(|kind| (kind["kind"].as_str(), kind["count"].as_u64())).collect();
        let kinds: Vec<_> = kinds.into_iter().map(|(kind, count)| (Some(kind), Some(count))).collect();
        assert_eq!((found, &info["events"]), (kinds, &events.into()));
        assert!(left_out[0]["first"].as_str().is_some_and(|first| first.contains("expected")), "{info}");
        assert!(text(&meissner(&["info", path])).contains("left out    "));
        let convert = ["convert", path, argument(&to)];
        let run = ["run", path, "--network", "tactigraph-past", "--every", "end"];
        for command in [&convert[..], &run] {
            let output = meissner(&[command, &["--strict"]].concat());
            assert_eq!(output.status.code(), Some(1), "{}", message(&output));
            let output = meissner(command);
            assert!(
                output.status.success() && message(&output).contains("warning: "),
                "{}",
                message(&output)
            );
            assert!(message(&output).contains("expected"), "{}", message(&output));
        }
        assert_eq!(meissner_io::read(&to).expect("it is CSV").events.len(), events);
    }
}

#[test]
fn the_chip_of_a_recording_that_names_none_can_be_given() {
    let record = |x: u32, y: u32, t: u32| {
        [(259 - y) << 22 | (345 - x) << 12 | 1 << 11, t].map(u32::to_be_bytes).concat()
    };
    let records: Vec<u8> = (0..50).flat_map(|i| record(i, 2 * i, 1000 * i)).collect();
    let content = [&b"#!AER-DAT2.0\n# Creation time: now\n"[..], &records].concat();
    let (_folder, path) = file("v2e.aedat", content);
    let path = argument(&path);
    fails(&meissner(&["info", path]), 1, &["v2e.aedat", "--chip DAVIS346", "--sensor 346x260"]);
    for option in [["--chip", "DAVIS346"], ["--sensor", "346x260"]] {
        let output = meissner(&[&["info", path, "--json"][..], &option].concat());
        assert!(text(&output).contains("\"sensor\":[346,260],\"events\":50"), "{}", text(&output));
        let run = ["run", path, "--network", "tactigraph-past", "--every", "end", "--json"];
        let (_, summary) = lines(&meissner(&[&run[..], &option].concat()));
        assert_eq!(summary["events"], 50, "{summary}");
    }
    fails(&meissner(&["info", path, "--chip", "CAT9"]), 2, &["--chip", "DAVIS346"]);
    let recording = default_recording();
    fails(&meissner(&["info", argument(&recording), "--chip", "DVS128"]), 2, &["--chip", "AEDAT2"]);
    fails(&meissner(&["info", argument(&recording), "--stream", "2"]), 1, &["stream 2 asked for"]);
}

/// A hundred events, 100 us apart, with `bad` instead of every `nth`.
fn events(nth: usize, bad: &str) -> String {
    let line = |i: usize| {
        if (i + 1).is_multiple_of(nth) {
            format!("{bad}\n")
        } else {
            format!("{},{},{},1\n", i * 100, i % 8, i / 8 % 8)
        }
    };
    (0..100).map(line).collect()
}

const RUN: [&str; 6] = ["run", "--sensor", "346x260", "--every", "event", "--json"];

fn run(input: &str, more: &[&str]) -> std::process::Output {
    meissner_reading(&[&RUN[..], &["-"], more].concat(), input)
}

/// The last line of standard output.
fn summary(output: &std::process::Output) -> Value {
    let text = text(output);
    let last = text.lines().last().expect("there is a line");
    serde_json::from_str::<Value>(last).expect("JSON")["summary"].clone()
}

#[test]
fn a_line_that_is_no_event_is_named_and_counted_and_the_stream_goes_on() {
    let input = "1,2,3,1\nnot an event\n5,2,3,1\n";
    let (_folder, path) = file("events.csv", input);
    for output in [run(input, &[]), meissner(&[&RUN[..], &[argument(&path)]].concat())] {
        let (predictions, summary) = lines(&output);
        assert_eq!(times(&predictions), [Some(1), Some(5)]);
        assert_eq!((&summary["events"], &summary["lines_refused"]), (&2.into(), &1.into()));
        assert_eq!(summary["warnings"][0]["reason"], "lines_refused");
        let message = message(&output);
        assert!(message.starts_with("warning: ") && message.contains("line 2"), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    let people = text(&meissner_reading(&["run", "-", "--sensor", "8x8"], input));
    assert!(people.contains("1 lines or records that are no events"), "{people}");
    let frames = ["run", "-", "--sensor", "120x120", "--network", "force-tdnn", "--json"];
    let (_, summary) = lines(&meissner_reading(&frames, input));
    assert_eq!(summary["lines_refused"], 1);
}

#[test]
fn the_first_refused_lines_are_named_and_the_others_counted() {
    let output = run(&events(5, "oh no"), &[]);
    let (_, summary) = lines(&output);
    assert_eq!((&summary["events"], &summary["lines_refused"]), (&80.into(), &20.into()));
    let message = message(&output);
    for line in [5, 10, 15, 20, 25] {
        assert!(message.contains(&format!("line {line}: ")), "{message}");
    }
    assert!(!message.contains("line 30") && message.contains("20 of 100 (20.0 %) lines"), "{message}");
    assert_eq!(message.lines().count(), 7, "{message}");
}

#[test]
fn with_strict_a_stream_ends_at_the_line_after_its_summary_and_state() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let state = folder.path().join("state");
    let output = run(&events(41, "oh no"), &["--strict", "--save-state", argument(&state)]);
    assert_eq!(output.status.code(), Some(1));
    let told = message(&output);
    assert!(told.starts_with("error: standard input: ") && told.contains("line 41"), "{told}");
    assert_eq!(summary(&output)["events"], 40);
    let (_, resumed) = lines(&run("50000,1,2,1\n", &["--resume", argument(&state)]));
    assert_eq!(resumed["accepted"], 1);
}

#[test]
fn with_strict_nothing_is_run_over_a_file_with_such_a_line() {
    let (_folder, path) = file("events.csv", events(41, "oh no"));
    for command in ["run", "bench", "play"] {
        let arguments = [command, argument(&path), "--sensor", "8x8", "--strict"];
        fails(&meissner(&arguments), 1, &["events.csv", "line 41"]);
    }
}

#[test]
fn a_text_of_which_most_first_lines_are_no_events_is_an_error_and_leaves_the_state() {
    let (_folder, state) = file("state", "of before");
    let save = ["--save-state", argument(&state)];
    let other = "17,4\n".repeat(500);
    let ends = "17,4\n".repeat(3);
    for (input, counts) in [(&other, "51 of the first 100 lines"), (&ends, "3 of the first 3 lines")] {
        let output = run(input, &save);
        assert_eq!(output.status.code(), Some(1));
        assert!(message(&output).contains(counts), "{}", message(&output));
        assert_eq!(summary(&output)["events"], 0);
        assert_eq!(std::fs::read(&state).expect("it is there"), b"of before");
    }
    let (_folder, path) = file("other.csv", &ends);
    fails(&meissner(&[&RUN[..], &[argument(&path)]].concat()), 1, &["other.csv", "line 1"]);
}

#[test]
fn readings_are_refused_as_events_are() {
    let names: Vec<String> = (1..=24).map(|e| format!("e{e}")).collect();
    let row = |i: usize| if i == 7 { "1,2,3\n".to_owned() } else { ["2000"; 24].join(",") + "\n" };
    let input = names.join(",") + "\n" + &(0..20).map(row).collect::<String>();
    let arguments = ["run", "-", "--network", "slip-lstm", "--json"];
    let (_, passed) = lines(&meissner_reading(&arguments, &input));
    assert_eq!((&passed["readings"], &passed["lines_refused"]), (&19.into(), &1.into()));
    assert_eq!(passed["warnings"][0]["reason"], "lines_refused");
    let output = meissner_reading(&[&arguments[..], &["--strict"]].concat(), &input);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(summary(&output)["readings"], 7);
    assert!(message(&output).contains("line 9"), "{}", message(&output));
    let bad = names.join(",") + "\n" + &"1,2,3\n".repeat(70);
    let output = meissner_reading(&arguments, &bad);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("51 of the first 100 lines"), "{}", message(&output));
}

#[cfg(unix)]
#[test]
fn a_bad_line_from_a_pipe_loses_nothing_else() {
    let text = "# sensor 8x8\n1,2,3,1\noh no\n2,2,3,1\n3,2,4,1\n";
    let more = ["--network", "tactigraph-past", "--json"];
    for (subcommand, at) in
        [("run", "/dev/stdin"), ("bench", "/dev/stdin"), ("play", "/dev/stdin"), ("run", "-")]
    {
        let output = meissner_reading(&[&[subcommand, at], &more[..]].concat(), text);
        assert!(output.status.success(), "{subcommand}: {}", message(&output));
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            said.contains("\"lines_refused\":1") && said.contains("\"accepted\":3"),
            "{subcommand} {at}: {said}"
        );
        assert!(message(&output).contains("line 3"), "{}", message(&output));
    }
    for arguments in [&["info", "/dev/stdin"][..], &["convert", "/dev/stdin", "-", "--to", "csv"]] {
        let output = meissner_reading(arguments, text);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        assert!(message(&output).contains("line 3"), "{}", message(&output));
        let output = meissner_reading(&[arguments, &["--strict"]].concat(), text);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(message(&output).contains("line 3"), "{}", message(&output));
    }
}

#[cfg(unix)]
#[test]
fn a_named_pipe_with_a_bad_line_is_read_once() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    assert!(made.expect("there is such a program").success());
    let to = path.clone();
    // The end of the only writer is the end of the text: a second reader would wait without end.
    let writer = std::thread::spawn(move || std::fs::write(to, "1,2,3,1\noops\n2,2,3,1\n"));
    let output = meissner(&[&RUN[..], &[argument(&path)]].concat());
    writer.join().expect("it writes").expect("the program reads");
    let found = summary(&output);
    assert_eq!((&found["events"], &found["lines_refused"]), (&2.into(), &1.into()), "{}", message(&output));
}
