//! Signals that ask the program to end, and standard streams that are closed or full.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write, pipe};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{argument, command, lines, meissner_reading};

/// The running program.
pub(crate) struct Running {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Running {
    pub(crate) fn new(arguments: &[&str]) -> Self {
        let mut child = command(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let input = child.stdin.take().expect("standard input is piped");
        let output = BufReader::new(child.stdout.take().expect("standard output is piped"));
        Self { child, input, output }
    }

    pub(crate) fn send(&mut self, input: &(impl AsRef<[u8]> + ?Sized)) {
        self.input.write_all(input.as_ref()).expect("the program reads");
    }

    /// The next line of JSON after the header.
    pub(crate) fn line(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("it is text");
        let value: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
        if value["header"].is_null() { value } else { self.line() }
    }

    pub(crate) fn signal(&self, name: &str) {
        signal(&self.child, name);
    }

    /// Its final summary; it ends with status 130, with standard input still open.
    pub(crate) fn end(mut self) -> Value {
        let mut text = String::new();
        self.output.read_to_string(&mut text).expect("it is text");
        let status = ended(&mut self.child);
        assert_eq!(status.code(), Some(130), "{text}");
        let last = text.lines().last().expect("there is a summary");
        serde_json::from_str::<Value>(last).expect("JSON")["summary"].clone()
    }

    /// The status with which it ends.
    pub(crate) fn status(mut self) -> ExitStatus {
        ended(&mut self.child)
    }
}

fn signal(child: &Child, name: &str) {
    let done = Command::new("kill").args(["-s", name, &child.id().to_string()]).status();
    assert!(done.expect("there is such a program").success());
}

/// The status of a program that should end.
fn ended(child: &mut Child) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("it is a child") {
            return status;
        }
        if start.elapsed() > Duration::from_mins(1) {
            child.kill().expect("it is a child");
            panic!("the program does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn event(i: u32) -> String {
    format!("{},{},{},1\n", 1000 + i * 100, i % 8, i / 8 % 8)
}

/// The signals that ask the program to end, without the last one if it is ignored, as under
/// `nohup`.
fn signals() -> &'static [&'static str] {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    let ignores_hup = u64::from_str_radix(ignored.trim(), 16).expect("a number") & 1 == 1;
    if ignores_hup { &["INT", "TERM"] } else { &["INT", "TERM", "HUP"] }
}

#[test]
fn a_signal_ends_a_stream_of_events_with_its_summary_and_a_state_to_go_on_from() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let state = folder.path().join("state");
    let run = ["run", "-", "--sensor", "8x8", "--every", "event", "--json"];
    let whole = lines(&meissner_reading(&run, &(0..12).map(event).collect::<String>())).0;
    for name in signals() {
        let mut running = Running::new(&[&run[..], &["--save-state", argument(&state)]].concat());
        for i in 0..8 {
            running.send(&event(i));
            assert_eq!(running.line()["value"], whole[i as usize]["value"]);
        }
        // An unfinished line does not count as a line.
        running.send("1800,1,1,1");
        running.signal(name);
        let summary = running.end();
        assert_eq!((&summary["events"], &summary["lines_refused"]), (&8.into(), &0.into()), "{name}");
        let rest = (8..12).map(event).collect::<String>();
        let (resumed, _) =
            lines(&meissner_reading(&[&run[..], &["--resume", argument(&state)]].concat(), &rest));
        for (line, whole) in resumed.iter().zip(&whole[8..]) {
            assert_eq!((&line["t_us"], &line["value"]), (&whole["t_us"], &whole["value"]));
        }
        assert_eq!(resumed.len(), 4);
    }
}

#[test]
fn a_signal_ends_streams_of_frames_and_of_readings_with_their_summaries() {
    let mut running = Running::new(&["run", "-", "--network", "force-tdnn", "--sensor", "120x120", "--json"]);
    running.send("0,60,60,1\n10000,60,60,1\n");
    running.line();
    running.signal("INT");
    let summary = running.end();
    assert_eq!((&summary["events"], &summary["predictions"]), (&2.into(), &2.into()));

    let header = (1..=24).map(|e| format!("e{e}")).collect::<Vec<_>>().join(",");
    let mut running = Running::new(&["run", "-", "--network", "slip-lstm", "--json"]);
    running.send(&format!("{header}\n{}", (["2000"; 24].join(",") + "\n").repeat(6)));
    running.line();
    running.line();
    running.signal("TERM");
    assert_eq!(running.end()["readings"], 6);

    // A file may be a pipe, too, or a serial port.
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("sensor");
    assert!(Command::new("mkfifo").arg(&path).status().expect("there is such a program").success());
    let mut running = Running::new(&["run", argument(&path), "--network", "slip-lstm", "--json"]);
    let mut sensor = fs::OpenOptions::new().write(true).open(&path).expect("the program reads");
    let rows = (["2000"; 24].join(",") + "\n").repeat(5);
    sensor.write_all(format!("{header}\n{rows}").as_bytes()).expect("the program reads");
    running.line();
    running.signal("INT");
    let summary = running.end();
    assert_eq!(summary["readings"], 5);
}

#[test]
fn a_signal_ends_a_stream_before_its_first_event_too() {
    let mut running = Running::new(&["run", "-", "--sensor", "8x8"]);
    let mut line = String::new();
    running.output.read_line(&mut line).expect("it is text");
    // The headings are being written, and there is no event yet.
    running.signal("INT");
    let mut text = String::new();
    running.output.read_to_string(&mut text).expect("it is text");
    assert!(text.contains("0 taken, 0 accepted"), "{text}");
    assert_eq!(ended(&mut running.child).code(), Some(130));
}

#[test]
fn a_signal_ends_a_run_over_a_file_with_what_is_done() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let state = folder.path().join("state");
    let arguments =
        ["run", "--network", "graphres", "--every", "event", "--json", "--save-state", argument(&state)];
    let mut running = Running::new(&arguments);
    running.line();
    running.signal("INT");
    let summary = running.end();
    assert!(summary["events"].as_u64().is_some_and(|events| events < 15_000), "{summary}");
    assert!(fs::read(&state).expect("it was written").starts_with(b"MEISSNER"));
}

/// Waits until the program stops working because nobody reads its output.
#[cfg(target_os = "linux")]
fn until_it_waits(child: &Child) {
    let sleeps = || {
        let stat = fs::read_to_string(format!("/proc/{}/stat", child.id())).expect("it runs");
        std::thread::sleep(Duration::from_millis(50));
        stat.contains(") S ")
    };
    while !(0..5).all(|_| sleeps()) {}
}

/// A program whose output nobody reads, with its state in the file `state`.
#[cfg(target_os = "linux")]
fn unread(state: &std::path::Path, json: &[&str]) -> Running {
    let run = ["run", "--network", "tactigraph-past", "--every", "event", "--save-state", argument(state)];
    let running = Running::new(&[&run[..], json].concat());
    until_it_waits(&running.child);
    running
}

#[cfg(target_os = "linux")]
#[test]
fn where_nobody_reads_the_output_the_first_signal_ends_a_run_with_its_state() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    for name in signals() {
        let state = folder.path().join(name);
        let mut running = unread(&state, &["--json"]);
        running.signal(name);
        assert_eq!(ended(&mut running.child).code(), Some(130), "{name}");
        assert!(fs::read(&state).expect("it was written").starts_with(b"MEISSNER"), "{name}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_second_signal_does_not_come_between_the_first_and_the_state() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let state = folder.path().join("state");
    let mut running = unread(&state, &["--json"]);
    for name in ["INT", "TERM"] {
        running.signal(name);
    }
    assert_eq!(ended(&mut running.child).code(), Some(130));
    assert!(fs::read(&state).expect("it was written").starts_with(b"MEISSNER"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_reader_who_comes_late_gets_whole_lines_and_the_summary() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let mut running = unread(&folder.path().join("state"), &["--json"]);
    running.signal("TERM");
    std::thread::sleep(Duration::from_millis(100));
    let mut text = String::new();
    running.output.read_to_string(&mut text).expect("it is text");
    assert_eq!(ended(&mut running.child).code(), Some(130));
    let lines: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("a whole line of JSON")).collect();
    let summary = &lines.last().expect("a summary")["summary"];
    assert_eq!(summary["predictions"], lines.len() - 2, "{summary}");
}

#[cfg(target_os = "linux")]
#[test]
fn where_nobody_reads_the_first_signal_ends_a_play_and_a_sender() {
    let play = ["play", "--network", "tactigraph-past", "--report-every", "20us", "--json"];
    let mut running = Running::new(&play);
    until_it_waits(&running.child);
    running.signal("TERM");
    assert_eq!(ended(&mut running.child).code(), Some(130));

    let recording = crate::support::default_recording();
    let server = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("tcp://{}", server.local_addr().expect("it is bound"));
    let events: String = (0..400_000).map(event).collect();
    let (_folder, many) = crate::support::file("many.csv", events);
    for (input, to) in [(&recording, "-"), (&many, address.as_str())] {
        let mut running = Running::new(&["send", argument(input), to, "--speed", "1e6"]);
        let _client = to.starts_with("tcp").then(|| server.accept().expect("the program connects"));
        until_it_waits(&running.child);
        running.signal("INT");
        assert_eq!(ended(&mut running.child).code(), Some(130), "{to}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn where_nobody_reads_standard_error_a_signal_ends_a_stream_too() {
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::OpenOptionsExt;

    let (_reader, writer) = pipe().expect("there are pipes");
    let mut child = command(&["run", "-", "--sensor", "8x8", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(writer.try_clone().expect("a handle"))
        .spawn()
        .expect("the program starts");
    until_it_waits(&child);
    // It is filled up through a handle that does not wait: O_NONBLOCK.
    let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
    let mut full = fs::OpenOptions::new().write(true).custom_flags(0o4000).open(path).expect("it is there");
    while full.write(b" ").is_ok() {}
    let mut input = child.stdin.take().expect("standard input is piped");
    input.write_all(b"1,2,3,1\noh no\n2,2,3,1\n").expect("the program reads");
    until_it_waits(&child);
    signal(&child, "TERM");
    assert_eq!(ended(&mut child).code(), Some(130));
}

#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_from_the_start_ends_nothing() {
    let mut child = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" run - --sensor 8x8 --json", env!("CARGO_BIN_EXE_meissner")])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut input = child.stdin.take().expect("standard input is piped");
    let mut output = BufReader::new(child.stdout.take().expect("standard output is piped"));
    let mut line = String::new();
    output.read_line(&mut line).expect("it is text");
    signal(&child, "HUP");
    input.write_all(event(0).as_bytes()).expect("the program reads");
    drop(input);
    output.read_to_string(&mut line).expect("it is text");
    assert_eq!(ended(&mut child).code(), Some(0), "{line}");
    assert!(line.contains("\"events\":1,"), "{line}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_second_signal_ends_a_program_at_once_that_has_no_state_to_write() {
    // After the first signal, it waits a second for a reader.
    let ends_at_once = || {
        let mut running =
            Running::new(&["run", "--network", "tactigraph-past", "--every", "event", "--json"]);
        until_it_waits(&running.child);
        let start = Instant::now();
        running.signal("INT");
        std::thread::sleep(Duration::from_millis(100));
        let waits = running.child.try_wait().expect("it is a child").is_none();
        running.signal("TERM");
        assert_eq!(ended(&mut running.child).code(), Some(130));
        waits && start.elapsed() < Duration::from_millis(900)
    };
    assert!((0..10).any(|_| ends_at_once()));
}

#[test]
fn a_signal_ends_a_play_with_its_summary() {
    let mut running = Running::new(&["play", "--speed", "0.05", "--report-every", "1ms", "--json"]);
    running.line();
    let start = Instant::now();
    running.signal("INT");
    let summary = running.end();
    assert!(start.elapsed() < Duration::from_secs(20));
    let [due, made] = ["due", "made"].map(|key| summary["reports"][key].as_u64().expect("a count"));
    assert!(0 < made && made < due, "{summary}");
    let count = |key: &str| summary[key].as_u64().expect("a count");
    assert_eq!((count("events"), count("offered")), (count("offered"), count("delivered")));
}

#[test]
fn a_signal_ends_a_play_of_a_silent_stream() {
    let mut running =
        Running::new(&["play", "-", "--sensor", "8x8", "--network", "tactigraph-past", "--json"]);
    running.send(&event(0));
    running.line();
    running.signal("INT");
    assert_eq!(running.end()["events"], 1);
}

#[test]
fn a_signal_ends_a_sender_that_waits_for_its_receiver() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("events.csv");
    fs::write(&path, event(0)).expect("it can be written");
    let mut running = Running::new(&["send", argument(&path), "tcp-listen://127.0.0.1:0"]);
    // There is no sign that it waits. An earlier signal also ends it.
    std::thread::sleep(Duration::from_millis(200));
    running.signal("INT");
    assert_eq!(ended(&mut running.child).code(), Some(130));
}

#[test]
fn a_signal_ends_a_soak_with_a_last_checkpoint() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("soak.json");
    let arguments = ["soak", "--network", "tactigraph-past", "--events", "1e9", "--checkpoint-every", "2e3"];
    let mut child = command(&[&arguments[..], &["--out", argument(&path)]].concat())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut said = BufReader::new(child.stderr.take().expect("standard error is piped")).lines();
    let checkpoint = said.find(|line| line.as_ref().is_ok_and(|line| !line.starts_with("note: ")));
    checkpoint.expect("a checkpoint").expect("it is text");
    signal(&child, "INT");
    let said: Vec<String> = said.map(|line| line.expect("it is text")).collect();
    assert_eq!(ended(&mut child).code(), Some(130), "{said:?}");
    let report: Value =
        serde_json::from_slice(&fs::read(path).expect("it was written")).expect("one JSON object");
    let rows = report["checkpoints"].as_array().expect("checkpoints");
    assert_eq!(rows.last().expect("one at least")["events"], report["events"]);
    assert_eq!(report["broken"], Value::Array(Vec::new()));
}

#[test]
fn a_signal_ends_a_measurement_at_once_and_keeps_those_that_are_finished() {
    // More than a pipe can hold: once it is written, the program is reading.
    let mut running = Running::new(&["bench", "-", "--sensor", "8x8"]);
    running.send(&event(3).repeat(20_000));
    running.signal("TERM");
    let mut text = String::new();
    running.output.read_to_string(&mut text).expect("it is text");
    assert_eq!((ended(&mut running.child).code(), text.as_str()), (Some(130), ""));

    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let (recording, state) = (crate::support::default_recording(), folder.path().join("state"));
    let arguments = ["pareto", "angle", argument(&recording), "--network", "tactigraph-past"];
    let arguments = [&arguments[..], &["--timed-events", "300", "--state", argument(&state)]].concat();
    let mut running = Running::new(&arguments);
    let finished = || fs::read_to_string(&state).unwrap_or_default().matches('\n').count();
    while finished() == 0 {
        assert!(running.child.try_wait().expect("it is a child").is_none());
        std::thread::sleep(Duration::from_millis(1));
    }
    running.signal("INT");
    assert_eq!(ended(&mut running.child).code(), Some(130));
    let kept = finished();
    let only = ["--only", "exact"];
    let output = crate::support::meissner(&[&arguments[..], &only].concat());
    assert!(output.status.success(), "{}", crate::support::message(&output));
    assert_eq!(finished(), kept, "the exact network is not measured again");
}

#[test]
fn where_nobody_reads_standard_error_the_program_goes_on() {
    let unread = || {
        let (reader, writer) = pipe().expect("there are pipes");
        drop(reader);
        writer
    };
    let mut child = command(&["run", "-", "--sensor", "8x8", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(unread())
        .spawn()
        .expect("the program starts");
    let mut input = child.stdin.take().expect("standard input is piped");
    input.write_all(b"1,2,3,1\noh no\n2,2,3,1\n").expect("the program reads");
    drop(input);
    let output = child.wait_with_output().expect("the program ends");
    assert_eq!(output.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&output.stdout).contains("\"lines_refused\":1"));
    for (arguments, status) in [(&["run", "no/such/file"][..], 1), (&["run", "--every", "x"], 2)] {
        let status_found = command(arguments).stderr(unread()).status().expect("the program starts");
        assert_eq!(status_found.code(), Some(status));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error_after_which_the_state_is_there() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let state = folder.path().join("state");
    for json in [&["--json"][..], &[]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
        let arguments = ["run", "--network", "graphres", "--limit", "3000", "--save-state", argument(&state)];
        let output =
            command(&[&arguments[..], json].concat()).stdout(full).output().expect("the program starts");
        let said = crate::support::message(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: standard output: "), "{said}");
        // People see headings before there is a state.
        assert!(json.is_empty() || fs::read(&state).is_ok_and(|bytes| bytes.starts_with(b"MEISSNER")));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_standard_output_that_fills_up_between_frames_of_an_event_leaves_the_state_behind_the_event() {
    let (folder, events) = crate::support::file("silent.csv", "0,60,60,1\n4000000,60,60,1\n");
    let state = |name: &str, stdout: Stdio| {
        let path = folder.path().join(name);
        let run = ["run", argument(&events), "--sensor", "120x120", "--network", "force-tdnn", "--json"];
        let mut run = command(&[&run[..], &["--save-state", argument(&path)]].concat());
        let status = run.stdout(stdout).stderr(Stdio::null()).status().expect("the program starts");
        (status.code(), fs::read(path).expect("it was written"))
    };
    let (whole, expected) = state("whole", Stdio::null());
    let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
    let (broken, found) = state("broken", full.into());
    assert_eq!((whole, broken), (Some(0), Some(1)));
    assert_eq!(found, expected);
}
