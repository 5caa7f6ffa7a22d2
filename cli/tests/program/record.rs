//! Events that are recorded as they arrive.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, ReadOptions, Recording};

use crate::support::{argument, command, file, meissner, meissner_reading, message, object, text};

const SENSOR: Sensor = Sensor { width: 64, height: 64 };

/// `number` events that grow from pixel to pixel, one every `step_us` from `first_us` on.
fn burst(first_us: i64, number: i64, step_us: i64) -> Vec<Event> {
    (0..number)
        .map(|i| Event::new(first_us + i * step_us, (i % 60) as u16, (i % 50) as u16, i % 3 > 0))
        .collect()
}

fn as_text(events: &[Event]) -> String {
    let line = |e: &Event| format!("{},{},{},{}\n", e.t_us, e.x, e.y, u8::from(e.on));
    events.iter().map(line).collect()
}

fn read(path: &Path) -> Recording {
    read_with(path, ReadOptions::default().strict(true))
}

fn read_with(path: &Path, options: ReadOptions) -> Recording {
    meissner_io::read_with(path, options).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The files of a folder that end in `.aedat4`, in order.
fn presses(folder: &Path) -> Vec<Recording> {
    let mut paths: Vec<_> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("it").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "aedat4"));
    paths.sort();
    paths.iter().map(|path| read(path)).collect()
}

/// The running program that records standard input.
fn started(arguments: &[&str]) -> Child {
    let mut command = command(&[&["record", "-", "--sensor", "64x64"], arguments].concat());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

/// Waits for `condition`.
fn until(condition: impl Fn() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(begun.elapsed() < Duration::from_secs(20), "nothing happens");
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn what_is_recorded_is_what_came_and_nothing_is_replaced_without_force() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("all.aedat4");
    let events = burst(-5_000, 30_000, 7);
    let record = ["record", "-", "--sensor", "64x64", "--out", argument(&path)];
    let summary = object(&meissner_reading(&[&record[..], &["--json"]].concat(), &as_text(&events)));
    assert_eq!((read(&path).sensor, read(&path).events), (Some(SENSOR), events.clone()));
    assert_eq!(read(&path).format, Format::Aedat4);
    assert_eq!([&summary["events"], &summary["recordings"][0]["events"]], [30_000, 30_000], "{summary}");
    assert_eq!(summary["recordings"][0]["first_us"], -5_000);
    assert!(summary["recordings"][0]["host_us"].as_i64() > Some(1_700_000_000_000_000), "{summary}");

    let refused = meissner_reading(&record, &as_text(&events[..10]));
    assert_eq!(refused.status.code(), Some(2), "{}", message(&refused));
    assert!(message(&refused).contains("--force replaces it"), "{}", message(&refused));
    assert_eq!(read(&path).events.len(), 30_000);
    let outside = [events[..10].to_vec(), vec![Event::new(0, 64, 3, true)]].concat();
    let output = meissner_reading(&[&record[..], &["--force"]].concat(), &as_text(&outside));
    assert_eq!(read(&path).events, events[..10]);
    assert!(text(&output).contains("1 events outside the sensor are left out"), "{}", text(&output));
}

#[test]
fn a_silence_ends_a_press_and_the_table_names_each_with_the_time_of_the_host() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("presses");
    // The third has a pause that is too short for a silence; the clock restarts before the last.
    let bursts = [burst(0, 50, 100), burst(400_000, 60, 100), burst(900_000, 10, 29_000), burst(5, 20, 100)];
    let record = ["record", "-", "--sensor", "64x64", "--out", argument(&out), "--split-on-silence", "300ms"];
    let output = meissner_reading(&record, &as_text(&bursts.concat()));
    assert!(text(&output).contains("4 presses"), "{}{}", text(&output), message(&output));
    let found: Vec<_> = presses(&out).into_iter().map(|press| press.events).collect();
    assert_eq!(found, bursts);
    // The next files follow after them.
    let (_input, path) = file("more.csv", as_text(&bursts.concat()));
    let more = [&["record", argument(&path)], &record[2..]].concat();
    assert!(meissner(&more).status.success());
    assert_eq!(presses(&out).len(), 8);
    let table = fs::read_to_string(out.join("recordings.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0], ["recording", "first_us", "last_us", "events", "host_us"]);
    assert_eq!(rows[2][..4], ["press-0002.aedat4", "400000", "405900", "60"]);
    assert!(rows[1..5].iter().all(|row| row[4].parse::<u64>().is_ok_and(|us| us > 1_700_000_000_000_000)));
    assert_eq!(
        rows[8],
        ["press-0008.aedat4", "5", "1905", "20", ""],
        "from a file, no time of arrival is known"
    );
}

#[test]
fn noise_in_a_silence_is_left_out_and_noise_in_a_press_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("presses");
    // An event every 50 ms at pixels that no neighbour of fires.
    let noise =
        (0..40_i64).map(|i| Event::new(i * 50_000, (i * 13 % 7 * 9) as u16, (i * 29 % 5 * 12) as u16, true));
    let mut events: Vec<_> =
        noise.chain(burst(600_000, 400, 250)).chain(burst(1_500_000, 400, 250)).collect();
    events.sort_by_key(|event| event.t_us);
    let record = ["record", "-", "--sensor", "64x64", "--out", argument(&out), "--split-on-silence", "300ms"];
    let filtered = [&record[..], &["--activity-filter", "2ms", "--json"]].concat();
    let summary = object(&meissner_reading(&filtered, &as_text(&events)));
    let found = presses(&out);
    assert_eq!(found.len(), 2, "{summary}");
    assert_eq!(summary["in_silence"].as_u64(), Some(840 - summary["events"].as_u64().expect("a count")));
    // All but the first event of a press have a neighbour before them.
    assert!(found.iter().all(|press| press.events.len() >= 399), "{summary}");
    // Without the filter, noise continues without end.
    fs::remove_dir_all(&out).expect("it is there");
    meissner_reading(&record, &as_text(&events));
    assert_eq!(presses(&out).len(), 1);
}

#[test]
fn a_press_is_closed_while_the_source_is_silent() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("presses");
    let mut child = started(&["--out", argument(&out), "--split-on-silence", "50ms"]);
    let mut input = child.stdin.take().expect("it is piped");
    input.write_all(as_text(&burst(0, 500, 10)).as_bytes()).expect("it reads");
    until(|| out.join("recordings.csv").is_file());
    assert_eq!(presses(&out)[0].events, burst(0, 500, 10));
    drop(input);
    assert!(child.wait().expect("it ends").success());
    assert_eq!(presses(&out).len(), 1);
}

#[test]
fn a_signal_ends_a_recording_with_its_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("all.aedat4");
    let mut child = started(&["--out", argument(&path), "--json"]);
    let mut input = child.stdin.take().expect("it is piped");
    let events = burst(0, 500, 10);
    input.write_all(as_text(&events).as_bytes()).expect("it reads");
    until(|| fs::metadata(&path).is_ok_and(|file| file.len() > 1_500));
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-s", "INT", &id]).status().expect("kill").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", message(&output));
    assert!(text(&output).contains("\"events\":500"), "{}", text(&output));
    assert_eq!(read(&path).events, events);
    assert_ne!(fs::read(&path).expect("it is there")[46..54], [0xff; 8], "the place of the table");
}

/// The time for which the threads of a process were ready and had no processor; 0 where the system
/// does not count it.
fn waited(id: u32) -> Duration {
    let threads = fs::read_dir(format!("/proc/{id}/task")).into_iter().flatten().flatten();
    let waited = threads.filter_map(|thread| {
        let counts = fs::read_to_string(thread.path().join("schedstat")).ok()?;
        counts.split_whitespace().nth(1)?.parse::<u64>().ok()
    });
    Duration::from_nanos(waited.sum())
}

/// Number of times that the program is killed.
const KILLS: u64 = 6;

#[test]
fn a_recording_that_is_killed_is_readable_and_has_all_but_the_newest_events() {
    let folder = tempfile::tempdir().expect("a folder");
    for kill in 0..KILLS {
        let path = folder.path().join(format!("{kill}.aedat4"));
        let mut child = started(&["--out", argument(&path)]);
        let mut input = child.stdin.take().expect("it is piped");
        // Events that wait for the program to start are not lost by it.
        until(|| path.exists());
        let (begun, end) = (Instant::now(), Duration::from_millis(1_100 + 173 * kill));
        let mut sent: Vec<(Instant, Event)> = Vec::new();
        while begun.elapsed() < end {
            let some = burst(sent.len() as i64 * 10, 300, 10);
            input.write_all(as_text(&some).as_bytes()).expect("it reads");
            sent.extend(some.into_iter().map(|event| (Instant::now(), event)));
            thread::sleep(Duration::from_millis(3));
        }
        let waited = waited(child.id());
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        let killed = Instant::now();
        // A signal may end a write at any page of the file.
        let found = read_with(&path, ReadOptions::default().strict(true).salvage(true)).events;
        assert!(found.iter().eq(sent[..found.len()].iter().map(|(_, event)| event)), "the events that came");
        let lost = sent.get(found.len()).map_or(Duration::ZERO, |(at, _)| killed - *at);
        let most = Duration::from_secs(1) + waited;
        assert!(lost < most, "{lost:?} are lost of {:?}, {waited:?} waited", begun.elapsed());
    }
}

#[cfg(unix)]
#[test]
fn where_the_disk_is_full_the_recording_is_whole_up_to_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("all.aedat4");
    // Of forty blocks of 512 bytes or of 1024.
    let script = "ulimit -f 40; trap '' XFSZ; exec \"$0\" \"$@\"";
    let mut command = std::process::Command::new("sh");
    command.args(["-c", script, env!("CARGO_BIN_EXE_meissner"), "record", "-", "--sensor", "64x64"]);
    command
        .args(["--out", argument(&path)])
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .stdout(Stdio::piped());
    let mut child = command.spawn().expect("a shell");
    let mut input = child.stdin.take().expect("it is piped");
    let events = burst(0, 200_000, 10);
    for some in events.chunks(50) {
        if input.write_all(as_text(some).as_bytes()).is_err() {
            break;
        }
        thread::sleep(Duration::from_millis(10));
    }
    drop(input);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    assert!(
        message(&output).contains("cannot write") && message(&output).contains("all.aedat4"),
        "{}",
        message(&output)
    );
    let found = read(&path).events;
    assert!(found.len() >= 100 && found[..] == events[..found.len()], "{} events", found.len());
}
