//! Standard input as it arrives, and standard output that is no longer read.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Stdio};

use serde_json::Value;

use crate::support::{command, lines, meissner_reading, message};

/// The running program, its standard input, and the lines of its standard output.
fn piped(arguments: &[&str]) -> (Child, ChildStdin, impl Iterator<Item = String> + use<>) {
    let mut child =
        command(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the program starts");
    let input = child.stdin.take().expect("standard input is piped");
    let output = BufReader::new(child.stdout.take().expect("standard output is piped")).lines();
    let output = output.map(|line| line.expect("it is text"));
    (child, input, output.filter(|line| !line.starts_with("{\"header\":")))
}

#[test]
fn a_prediction_is_written_before_the_next_event_is_sent() {
    for geometry in [&["--sensor", "8x8"][..], &[]] {
        let arguments = [&["run", "-", "--every", "event", "--json"], geometry].concat();
        let (mut child, mut input, mut output) = piped(&arguments);
        writeln!(input, "# sensor 8x8").expect("the program reads");
        for t in [100, 150, 151] {
            writeln!(input, "{t},1,2,1").expect("the program reads");
            // This would wait without end if the line were held back.
            let line = output.next().expect("there is a line");
            let line: Value = serde_json::from_str(&line).expect("the line is JSON");
            assert_eq!(line["t_us"], t);
        }
        drop(input);
        let line = output.next().expect("there is a line");
        assert!(line.starts_with("{\"summary\":"), "{line}");
        assert!(child.wait().expect("the program ends").success());
    }
}

#[test]
fn a_frames_prediction_is_written_before_more_is_sent_than_completes_it() {
    let header = (1..=24).map(|e| format!("e{e}")).collect::<Vec<_>>().join(",");
    let reading = ["2000"; 24].join(",") + "\n";
    let windows = [format!("{header}\n{}", reading.repeat(5)), reading.repeat(5)];
    // The second event completes the first one's window.
    let frames = ["0,60,60,1\n10000,60,60,1\n".to_owned(), "20000,60,60,1\n".to_owned()];
    for (arguments, parts) in [
        (&["run", "-", "--network", "slip-regularised", "--json"][..], windows),
        (&["run", "-", "--network", "force-tdnn", "--sensor", "120x120", "--json"], frames),
    ] {
        let (mut child, mut input, mut output) = piped(arguments);
        for part in parts {
            input.write_all(part.as_bytes()).expect("the program reads");
            // This would wait without end if the line were held back.
            let line = output.next().expect("there is a line");
            let line: Value = serde_json::from_str(&line).expect("the line is JSON");
            assert!(line["value"].is_array(), "{line}");
        }
        drop(input);
        assert!(child.wait().expect("the program ends").success());
    }
}

#[test]
fn a_decision_is_written_before_the_next_reading_is_sent() {
    let header = (1..=24).map(|e| format!("e{e}")).collect::<Vec<_>>().join(",");
    for json in [&["--json"][..], &[]] {
        let arguments = [&["run", "-", "--network", "slip-lstm", "--hold", "3"], json].concat();
        let (mut child, mut input, mut output) = piped(&arguments);
        writeln!(input, "{header}").expect("the program reads");
        for reading in 1..=12 {
            let row = (0..24).map(|e| (2000 + 7 * reading + e * e).to_string()).collect::<Vec<_>>();
            writeln!(input, "{}", row.join(",")).expect("the program reads");
            if reading < 5 {
                continue;
            }
            if json.is_empty() {
                // This would wait without end if the line were held back.
                let starts = format!("{:>7}  ", reading + 1);
                assert!(output.any(|line| line.starts_with(&starts)), "there is a line");
            } else {
                let line: Value =
                    serde_json::from_str(&output.next().expect("there is a line")).expect("JSON");
                assert_eq!(line["line"], reading + 1);
                assert_eq!(line["decision"].is_string(), reading >= 7, "three windows agree: {line}");
                assert_eq!(line["held"].as_i64(), (reading >= 7).then(|| reading - 6), "{line}");
            }
        }
        drop(input);
        assert!(output.next().is_some(), "there is a summary");
        drop(output);
        assert!(child.wait().expect("the program ends").success());
    }
}

#[test]
fn with_a_limit_the_program_ends_before_the_stream_does() {
    let mut child = command(&["run", "-", "--sensor", "8x8", "--limit", "2", "--every", "event", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut input = child.stdin.take().expect("standard input is piped");
    input.write_all(b"1,1,1,1\n2,2,2,1\n").expect("the program reads");
    let mut text = String::new();
    child.stdout.take().expect("standard output is piped").read_to_string(&mut text).expect("it is text");
    assert_eq!(text.lines().count(), 4, "{text}");
    assert!(child.wait().expect("the program ends").success());
    drop(input);
}

#[test]
fn standard_input_and_a_file_give_the_same_predictions() {
    let events: Vec<String> =
        (0..200).map(|i| format!("{},{},{},{}\n", i * 37, i % 8, i / 8 % 8, i % 2)).collect();
    let events = events.concat();
    let (_folder, path) = crate::support::file("events.csv", &events);
    let arguments = |recording| ["run", recording, "--sensor", "8x8", "--every", "500us", "--json"];
    let values = |output| lines(&output).0.iter().map(crate::support::bits).collect::<Vec<_>>();
    let streamed = values(meissner_reading(&arguments("-"), &events));
    let read = values(crate::support::meissner(&arguments(crate::support::argument(&path))));
    assert!(streamed.len() > 10);
    assert_eq!(streamed, read);
}

#[test]
fn people_see_every_prediction_of_a_live_stream() {
    let events: Vec<String> = (0..100).map(|i| format!("{i},{},{},1\n", i % 8, i / 8 % 8)).collect();
    let events = events.concat();
    let output = meissner_reading(&["run", "-", "--sensor", "8x8", "--every", "event"], &events);
    let text = crate::support::text(&output);
    assert!(!text.contains("predictions shown"), "{text}");
    assert!(text.lines().count() > 100, "{text}");
}

#[test]
fn a_closed_pipe_ends_the_program_quietly() {
    for json in [&["--json"][..], &[]] {
        let arguments = [&["run", "--every", "event"], json].concat();
        let mut child = command(&arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut first = [0; 16];
        let mut output = child.stdout.take().expect("standard output is piped");
        output.read_exact(&mut first).expect("there is output");
        drop(output);
        let output = child.wait_with_output().expect("the program ends");
        assert_eq!(output.status.code(), Some(0));
        assert_eq!(message(&output), "");
    }
}
