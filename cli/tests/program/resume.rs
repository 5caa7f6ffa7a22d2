//! A run that continues from a state makes the same predictions as one run over both inputs.

use std::path::Path;

use meissner_engine::Event;
use serde_json::Value;
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::frames::OwnNetwork;
use crate::support::{INCREMENTAL, argument, lines, meissner};

/// Events on 30 x 30 pixels: bursts, equal stamps, a gap, and a pixel that fires all the time.
fn events() -> Vec<Event> {
    let at = |i: i64| 777 + i / 3 * 400 + 90_000 * (i / 150);
    let pixel = |i: i64| if i % 3 == 1 { (7, 7) } else { ((i * 37 % 30) as u16, (i * 11 % 30) as u16) };
    (0..400).map(|i| Event::new(at(i), pixel(i).0, pixel(i).1, i % 4 > 1)).collect()
}

/// A folder with the first events, the others, and all of them; other files are added later.
fn recordings(cut: usize) -> TempDir {
    let folder = tempfile::tempdir().expect("a place for temporary files");
    let events = events();
    for (name, part) in [("first", &events[..cut]), ("second", &events[cut..]), ("all", &events[..])] {
        let line = |e: &Event| format!("{},{},{},{}\n", e.t_us, e.x, e.y, u8::from(e.on));
        let csv = part.iter().map(line).collect::<Vec<_>>().concat();
        std::fs::write(folder.path().join(name), format!("# sensor 30x30\n{csv}"))
            .expect("it can be written");
    }
    folder
}

/// Everything of a prediction that depends on no clock and on no work.
fn told(lines: &[Value]) -> Vec<Value> {
    let told = |line: &Value| {
        let line = line.as_object().expect("a line is an object");
        line.iter()
            .filter(|(key, _)| !["rows", "update_us"].contains(&key.as_str()))
            .map(|(k, v)| (k.clone(), v.clone()))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    lines.iter().map(told).collect()
}

/// Runs `arguments`, with the input's name instead of `INPUT`, over all events and over both
/// halves; returns the output.
fn halves(folder: &Path, arguments: &[String]) -> (Vec<Value>, Vec<Value>) {
    let path = |name: &str| argument(&folder.join(name)).to_owned();
    let run = |input: &str, more: &[String]| {
        let input = path(input);
        let place = |a: &String| if a == "INPUT" { input.clone() } else { a.clone() };
        let arguments: Vec<String> = arguments.iter().map(place).chain(more.iter().cloned()).collect();
        lines(&meissner(&arguments))
    };
    let (whole, summary) = run("all", &[]);
    let (mut parts, first) = run("first", &["--save-state".into(), path("state")]);
    let resume = ["--resume".into(), path("state"), "--save-state".into(), path("state")];
    let (mut second, rest) = run("second", &resume);
    parts.append(&mut second);
    // A run without events ends it, with the predictions that are due at the end of the input.
    std::fs::write(path("nothing"), "# sensor 30x30\nt,x,y,p\n").expect("it can be written");
    let (mut last, _) = run("nothing", &resume[..2]);
    parts.append(&mut last);
    for count in ["/accepted", "/dropped/network_filter"] {
        let of = |summary: &Value| summary.pointer(count).and_then(Value::as_u64).expect("a count");
        assert_eq!(of(&first) + of(&rest), of(&summary), "each run counts its own events");
        assert!(of(&summary) > 20, "{count}: {summary}");
    }
    (told(&parts), told(&whole))
}

#[test]
fn two_halves_of_a_recording_print_what_one_run_prints() {
    let cuts = [(1, "event"), (150, "7"), (151, "2500us"), (222, "90000us"), (399, "1000us")];
    for (place, (cut, every)) in cuts.into_iter().enumerate() {
        let folder = recordings(cut);
        for (network, name) in INCREMENTAL.into_iter().enumerate() {
            let mut own =
                vec!["run", "INPUT", "--network", name, "--every", every, "--span", "20ms", "--json"];
            // Every network is run both ways, and so is every cut.
            if (place + network).is_multiple_of(2) {
                own.extend(["--tolerance", "0.05"]);
            }
            let arguments: Vec<String> = own.into_iter().map(str::to_owned).collect();
            let (parts, whole) = halves(folder.path(), &arguments);
            assert!(!whole.is_empty());
            assert_eq!(parts, whole, "{arguments:?}, cut at {cut}");
        }
    }
}

const FRAMES: &str = r#"
[network]
name = "own"
[input]
kind = "image"
channels = CHANNELS
height = 20
width = 20
crop = "centre"
[[layer]]
name = "pool"
kind = "average_pool"
size = 5
[[layer]]
name = "flat"
kind = "flatten"
[[layer]]
name = "lstm"
kind = "lstm"
hidden = 5
[[layer]]
name = "force"
kind = "dense"
outputs = 1
[output]
names = ["force"]
unit = "N"
"#;

#[test]
fn two_halves_print_what_one_run_prints_over_frames_of_events_too() {
    let consecutive =
        FRAMES.replace("CHANNELS", "2\nframes = \"event-counts\"\nperiod_us = 1000\nmaximum = 8");
    let sliding = FRAMES.replace("CHANNELS", "1\nframes = \"signed\"\nspan_us = 3000");
    let filter = "[[filter]]\nkind = \"hot_pixel\"\nperiod_us = 2000\nburst = 4\n";
    let (consecutive, sliding) = (consecutive + filter, sliding + filter);
    for (description, every) in
        [(&consecutive, &["1000us", "3000us"][..]), (&sliding, &["event", "7", "1500us"][..])]
    {
        let network = OwnNetwork::new(description);
        for cut in [1, 150, 298] {
            let folder = recordings(cut);
            for every in every {
                let more = ["--every", every, "--longest-silence", "20", "--json"];
                let (parts, whole) = halves(folder.path(), &network.arguments(Path::new("INPUT"), &more));
                assert!(whole.len() > 10);
                assert_eq!(parts, whole, "--every {every}, cut at {cut}");
            }
        }
    }
}

#[test]
fn a_state_is_written_as_time_passes() {
    let folder = recordings(200);
    let path = |name: &str| argument(&folder.path().join(name)).to_owned();
    let state = path("state");
    let run = |input: &str, more: &[&str]| {
        let own = ["run", &path(input), "--network", "tactigraph-past", "--every", "event", "--json"];
        lines(&meissner(&[&own, more].concat()))
    };
    run("first", &["--save-state", &state, "--save-every", "5ms"]);
    let first = std::fs::read(&state).expect("it was written");
    // Over the same events again, all except those at the last time are late.
    assert!(run("first", &["--resume", &state, "--save-state", &state]).0.len() < 4);
    let (rest, summary) = run("second", &["--resume", &state]);
    let count = |of: &str| summary.pointer(of).and_then(Value::as_u64).expect("a count");
    assert_eq!(rest.len() as u64, count("/accepted"));
    assert_eq!(count("/accepted") + count("/dropped/network_filter"), 200);
    assert_ne!(std::fs::read(&state).expect("it was written"), first);
}

#[test]
fn a_state_that_does_not_fit_is_refused_by_name_and_the_file_stays() {
    let folder = recordings(200);
    let path = |name: &str| argument(&folder.path().join(name)).to_owned();
    let (input, state) = (path("first"), path("state"));
    let run = |more: &[&str]| meissner(&[&["run", &input, "--every", "end"], more].concat());
    assert!(run(&["--network", "tactigraph-past", "--save-state", &state]).status.success());
    let bytes = std::fs::read(&state).expect("it was written");
    let resume = ["--save-state", &state, "--resume", &state];
    for (more, expected) in [
        (&["--network", "tactigraph-frozen"][..], "snapshot: expected network \"tactigraph-past\""),
        (&["--network", "tactigraph-past", "--capacity", "77"], "expected network"),
        (&["--network", "tactigraph-past", "--sensor", "31x30"], "expected sensor 31x30, found 30x30"),
        (&["--network", "tactigraph-past", "--tolerance", "1"], "expected tolerance 1, found 0"),
        (&["--network", "tactigraph-past", "--late", "clamp"], "expected late policy clamp, found drop"),
        (
            &["--network", "force-lstm", "--sensor", "120x120"],
            "expected state of a frame engine, found an engine over events",
        ),
    ] {
        let expected = expected.replace("\"tactigraph-past\"", "\"tactigraph-frozen\"");
        fails(&run(&[more, &resume].concat()), 1, &["--resume", &expected]);
    }
    for (at, expected) in [(0, "first bytes"), (8, "format version"), (70, "checksum")] {
        let mut wrong = bytes.clone();
        wrong[at] ^= 4;
        std::fs::write(path("wrong"), wrong).expect("it can be written");
        let output =
            run(&["--network", "tactigraph-past", "--save-state", &state, "--resume", &path("wrong")]);
        fails(&output, 1, &[expected]);
    }
    let output = run(&["--network", "tactigraph-past", "--resume", &path("none")]);
    fails(&output, 1, &["cannot open"]);
    let output = run(&["--network", "tactigraph-past", "--save-state", &path("none/state")]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(std::fs::read(&state).expect("it is there"), bytes);
}

#[test]
fn a_state_of_what_has_none_is_bad_usage() {
    for more in [
        &["--save-state", "s", "--mode", "batch"][..],
        &["--resume", "s", "--stride", "2"],
        &["--save-state", "s", "--stale-time", "100us"],
        &["--save-state", "s", "--network", "canf"],
        &["--resume", "s", "--network", "slip-lstm"],
        &["--save-every", "100us"],
        &["--save-state", "s", "--save-every", "0us"],
    ] {
        let output = meissner(&[&["run"], more].concat());
        assert_eq!(output.status.code(), Some(2), "{more:?}");
    }
    assert!(!Path::new("s").exists());
}

/// `state` with `note` instead of its note, and with the right length and checksum (FNV-1a).
fn with_note(state: &[u8], note: &str) -> Vec<u8> {
    let old = meissner_engine::snapshot_note(state).expect("a state").len();
    let mut bytes = state[..state.len() - 16 - old].to_vec();
    bytes.extend(note.as_bytes());
    bytes.extend((note.len() as u64).to_le_bytes());
    let length = (bytes.len() + 8) as u64;
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    let mix = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let checksum = bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

#[test]
fn a_state_whose_note_was_made_up_is_refused_with_what_was_expected_and_found() {
    let counts = FRAMES.replace("CHANNELS", "2\nframes = \"event-counts\"\nperiod_us = 1000\nmaximum = 8");
    let network = OwnNetwork::new(&counts);
    let folder = recordings(149);
    let path = |name: &str| argument(&folder.path().join(name)).to_owned();
    let run = |input: &str, more: &[&str]| meissner(&network.arguments(Path::new(&path(input)), more));
    lines(&run("first", &["--json", "--save-state", &path("state")]));
    let state = std::fs::read(path("state")).expect("it was written");
    let note = meissner_engine::snapshot_note(&state).expect("a state");
    let note: Value = serde_json::from_slice(note).expect("the note is JSON");
    let resume = |note: &str| {
        std::fs::write(path("made-up"), with_note(&state, note)).expect("it can be written");
        run("second", &["--json", "--resume", &path("made-up")])
    };
    assert!(resume(&note.to_string()).status.success(), "with its own note");
    let (least, most) = (i64::MIN, i64::MAX);
    for (key, value, expected) in [
        ("now_us", (least).into(), "expected newest time in the note from 777 to 2^63 after it, found -9223"),
        ("epoch_us", least.into(), "expected newest time in the note from -9223"),
        ("epoch_us", most.into(), "expected newest time in the note from 9223"),
        ("open_us", least.into(), "expected open window in the note from 777 to"),
        ("open_us", most.into(), "found 9223372036854775807"),
        ("accepted", 0.into(), "expected accepted events in the note at least"),
        ("events", serde_json::json!([[most, 1, 1, true]]), "expected kept event in the note from"),
        ("events", serde_json::json!([[least, 1, 1, true]]), "expected kept event in the note from"),
        ("events", serde_json::json!([[note["feed"]["now_us"], 30, 1, true]]), "us at (30, 1)"),
        (
            "events",
            serde_json::json!([[777, 70_000, 1, true]]),
            "expected note where the making of frames stands",
        ),
        ("events", 1e300.into(), "expected note where the making of frames stands"),
    ] {
        let mut wrong = note.clone();
        wrong["feed"][key] = value;
        fails(&resume(&wrong.to_string()), 1, &["--resume", "made-up", "snapshot: ", expected]);
    }
    let deep = "[".repeat(1 << 20);
    for wrong in ["", "null", "{}", &deep, &format!("{{\"made\": {deep}")] {
        fails(&resume(wrong), 1, &["snapshot: expected note where the making of frames stands", "found"]);
    }
    // Counts of any size are accepted.
    for key in ["silence", "since"] {
        let mut large = note.clone();
        large[key] = u64::MAX.into();
        assert!(resume(&large.to_string()).status.success(), "{key}");
    }
    let mut large = note.clone();
    large["feed"]["accepted"] = u64::MAX.into();
    assert!(resume(&large.to_string()).status.success(), "accepted");
}

#[cfg(unix)]
#[test]
fn a_state_goes_to_a_file_or_the_run_does_not_begin() {
    use std::fs;
    use std::os::unix::fs::{FileTypeExt, symlink};

    let folder = recordings(100);
    let path = |name: &str| folder.path().join(name);
    symlink(path("nothing"), path("dangling")).expect("links can be made");
    symlink("/dev/null", path("device")).expect("links can be made");
    symlink(path("file"), path("link")).expect("links can be made");
    fs::write(path("file"), "former").expect("it can be written");
    let made = std::process::Command::new("mkfifo").arg(path("fifo")).status();
    assert!(made.expect("there is such a program").success());
    let recording = path("first");
    let run = |network: &str, state: &Path| {
        let run = ["run", argument(&recording), "--network", network, "--save-state", argument(state)];
        meissner(&run)
    };
    for network in ["tactigraph-past", "force-tdnn"] {
        for (state, why) in [
            (path("device"), "a device"),
            (path("fifo"), "a pipe"),
            (path("dangling"), "a link"),
            (path("."), "a folder"),
            (path("no/such/folder"), "cannot create"),
        ] {
            let output = run(network, &state);
            assert_eq!(output.status.code(), Some(1), "{}", state.display());
            assert!(output.stdout.is_empty(), "the run has not begun");
            let said = crate::support::message(&output);
            assert!(said.contains(why), "{said}");
        }
    }
    assert!(fs::symlink_metadata("/dev/null").expect("it is there").file_type().is_char_device());
    assert!(fs::symlink_metadata(path("fifo")).expect("it is there").file_type().is_fifo());
    assert!(
        fs::symlink_metadata(path("dangling")).expect("it is there").is_symlink()
            && !path("nothing").exists()
    );
    let output = run("tactigraph-past", &path("link"));
    assert!(output.status.success(), "{}", crate::support::message(&output));
    assert!(fs::symlink_metadata(path("link")).expect("it is there").is_symlink());
    assert!(fs::read(path("file")).expect("it is there").starts_with(b"MEISSNER"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_state_without_an_end_is_refused_for_its_first_bytes() {
    let folder = recordings(100);
    let recording = folder.path().join("first");
    let run = ["run", argument(&recording), "--network", "tactigraph-past", "--resume", "/dev/zero"];
    fails(&meissner(&run), 1, &["/dev/zero", "expected MEISSNER"]);
}
