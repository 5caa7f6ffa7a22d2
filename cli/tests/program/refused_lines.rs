//! Lines of a text that are not what it should hold: passed over and counted, or an error with
//! `--strict`.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{argument, file, lines, meissner, meissner_reading, message, text, times};

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
    // The end of the only writer is the end of the text: a second reader would wait for ever.
    let writer = std::thread::spawn(move || std::fs::write(to, "1,2,3,1\noops\n2,2,3,1\n"));
    let output = meissner(&[&RUN[..], &[argument(&path)]].concat());
    writer.join().expect("it writes").expect("the program reads");
    let found = summary(&output);
    assert_eq!((&found["events"], &found["lines_refused"]), (&2.into(), &1.into()), "{}", message(&output));
}
