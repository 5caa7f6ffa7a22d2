//! Inputs as users have them: other layouts, other kinds, cut short, broken half-way; and outputs
//! that exist already.

use std::fs;
use std::path::PathBuf;

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, encode};
use meissner_models::TensorFile;
use tempfile::TempDir;

use crate::data::slip::{SlipFolder, csv, readings};
use crate::data::{DigitsFolder, Runs, bytes, digits, small};
use crate::exit_status::fails;
use crate::support::{
    argument, default_recording, file, lines, meissner, meissner_reading, message, object, text,
};

fn scene() -> Vec<Event> {
    (0..300_u16)
        .map(|i| Event::new(i64::from(i) * 40, i * 7 % 128, i * 31 % 97, i.is_multiple_of(3)))
        .collect()
}

fn rows(line: impl Fn(&Event) -> String) -> String {
    scene().iter().map(|event| line(event) + "\n").collect()
}

fn encoded(format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(format, Some(Sensor::new(128, 128)), &scene(), &mut bytes).expect("the format holds them");
    bytes
}

/// The predictions of a run with `more`, of `path` as text.
fn predictions(path: &str, more: &[&str]) -> Vec<String> {
    let run =
        ["run", path, "--sensor", "128x128", "--network", "tactigraph-past", "--every", "5000us", "--json"];
    let (lines, summary) = lines(&meissner(&[&run[..], more].concat()));
    assert_eq!(summary["accepted"], 300, "{path}");
    lines.iter().map(|line| line["value"].to_string()).collect()
}

#[test]
fn texts_in_the_layouts_of_public_data_sets_give_the_same_predictions() {
    let p = |e: &Event| u8::from(e.on);
    let (_a, plain) = file("plain.csv", rows(|e| format!("{},{},{},{}", e.t_us, e.x, e.y, p(e))));
    let expected = predictions(argument(&plain), &[]);
    let (_b, mnist_dvs) =
        file("mnist.txt", rows(|e| format!("{} {} {} {}", e.x, e.y, e.t_us, i8::from(e.on) * 2 - 1)));
    let seconds = |e: &Event| format!("0.{:06}000", e.t_us);
    let (_c, davis) = file("events.txt", rows(|e| format!("{} {} {} {}", seconds(e), e.x, e.y, p(e))));
    assert_eq!(predictions(argument(&mnist_dvs), &[]), expected);
    assert_eq!(predictions(argument(&davis), &[]), expected);
    let (_d, odd) =
        file("odd.txt", rows(|e| format!("{};{};-;{};{}", p(e), e.y, e.x, e.t_us as f64 / 1000.0)));
    assert_eq!(predictions(argument(&odd), &["--columns", "py_xt", "--time-unit", "ms"]), expected);
}

#[test]
fn an_ambiguous_text_is_bad_usage_that_shows_the_line_and_the_options() {
    let (_folder, path) = file("short.txt", "14 27 38 1\n15 28 39 1\n");
    let expected = ["short.txt", "`14 27 38 1`", "txyp or xytp", "--columns xytp", "--time-unit"];
    for command in ["run", "play", "bench", "info", "soak"] {
        let more: &[&str] = if command == "soak" { &["--events", "10"] } else { &[] };
        fails(&meissner(&[&[command, argument(&path)], more].concat()), 2, &expected);
    }
    fails(&meissner(&["convert", argument(&path), "out.npy"]), 2, &expected);
    fails(&meissner(&["pareto", "angle", argument(&path)]), 2, &expected);
    let arriving = meissner_reading(&["run", "-", "--sensor", "64x64"], "14 27 38 1\n15 28 39 1\n");
    assert_eq!(arriving.status.code(), Some(2));
    for expected in ["standard input", "`14 27 38 1`", "--columns xytp"] {
        assert!(message(&arriving).contains(expected), "{}", message(&arriving));
    }
    let output = meissner(&["info", argument(&path), "--columns", "xytp", "--json"]);
    let info = object(&output);
    assert_eq!((&info["first_t_us"], &info["last_t_us"]), (&38.into(), &39.into()));
    for wrong in [&["--columns", "xyt"][..], &["--time-unit", "min"]] {
        fails(&meissner(&[&["info", argument(&path)], wrong].concat()), 2, &["error: "]);
    }
    let (_folder, path) = file("five.txt", "1 2 70000 1 9\n");
    fails(&meissner(&["info", argument(&path)]), 1, &["five.txt", "--columns xytp"]);
    assert!(meissner(&["info", argument(&path), "--columns", "xytp_"]).status.success());
    let recording = default_recording();
    fails(&meissner(&["info", argument(&recording), "--columns", "xytp"]), 2, &["--columns", "EVT3"]);
}

#[test]
fn an_input_of_another_kind_is_named_with_the_networks_that_read_it() {
    let recording = default_recording();
    let names: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
    let (_a, electrodes) = file("slip.csv", format!("{}\n{}\n", names.join(","), ["3500"; 24].join(",")));
    let (_b, picture) = file("picture.pgm", "P5 1 1 255\n\x07");
    let (folder, events) = file("events.csv", "# sensor 8x8\nt,x,y,p\n1,2,3,1\n");
    let of_events = ["a recording of events", "graphres", "force-lstm", "event-frame-cnn"];
    for network in ["slip-best", "canf"] {
        for path in [&recording, &events] {
            fails(&meissner(&["run", argument(path), "--network", network]), 1, &of_events);
        }
    }
    let of_pictures = ["picture", "canf", "canf-live", "canf-plain"];
    let of_electrodes = ["readings of electrodes", "slip-best", "slip-regularised"];
    for network in ["tactigraph-past", "force-lstm"] {
        let run = |path| meissner(&["run", path, "--sensor", "8x8", "--network", network]);
        fails(&run(argument(&electrodes)), 1, &of_electrodes);
        fails(&run(argument(&picture)), 1, &of_pictures);
        fails(&run(argument(folder.path())), 1, &["a folder", "canf"]);
    }
    fails(&meissner(&["run", argument(&electrodes), "--network", "canf"]), 1, &of_electrodes);
    fails(&meissner(&["run", argument(&picture), "--network", "slip-best"]), 1, &of_pictures);
    fails(&meissner(&["run", argument(folder.path()), "--network", "slip-best"]), 1, &["a folder", "canf"]);
    fails(&meissner(&["info", argument(&electrodes)]), 1, &of_electrodes);
    fails(&meissner(&["convert", argument(folder.path()), "out.csv"]), 1, &["a folder"]);
}

#[test]
fn a_format_that_is_not_read_is_named_with_what_converts_it_whatever_the_network() {
    for (name, bytes, expected) in [
        ("a.csv.xz", &b"\xfd7zXZ\0\0\0"[..], ["xz", "unxz"]),
        ("a.bag", b"#ROSBAG V2.0\n", ["ROS bag", "rosbags"]),
        ("a.aedat", b"#!AER-DAT1.0\r\n\0\0", ["AEDAT 1", "DV"]),
        ("b.aedat", b"#!AER-DAT3.0\r\n\0\0", ["AEDAT 3.0", "DV"]),
    ] {
        let (_folder, path) = file(name, bytes);
        for network in ["tactigraph-past", "force-lstm", "slip-best", "canf"] {
            fails(
                &meissner(&["run", argument(&path), "--network", network]),
                1,
                &[name, expected[0], expected[1]],
            );
        }
        fails(&meissner(&["info", argument(&path)]), 1, &[name, expected[0], expected[1]]);
        fails(&meissner_reading(&["info", "-"], bytes), 1, &["standard input", expected[0], expected[1]]);
    }
}

#[test]
fn a_binary_recording_on_standard_input_is_named_with_how_it_is_read() {
    for format in [Format::Evt3, Format::Dat, Format::Npy] {
        let bytes = encoded(format);
        for arguments in
            [&["info", "-"][..], &["convert", "-", "out.csv"], &["run", "-", "--network", "graphres"]]
        {
            let name = format.to_string();
            let instead = if format == Format::Evt3 { "--format evt3" } else { "its path instead of -" };
            fails(&meissner_reading(arguments, &bytes), 1, &["standard input", &name, instead]);
        }
    }
}

#[test]
fn a_recording_that_was_cut_short_names_salvage_and_salvage_counts_what_is_whole() {
    for format in [Format::Evt3, Format::Dat, Format::Npy, Format::Csv] {
        let bytes = encoded(format);
        let (_folder, path) = file("cut", &bytes[..bytes.len() - 5]);
        let path = argument(&path);
        fails(&meissner(&["info", path, "--strict"]), 1, &["cut", "--salvage"]);
        assert_eq!(meissner(&["info", path]).status.success(), format == Format::Csv);
        // A text is read without its last line, which is counted as refused, unless the reader is
        // strict.
        fails(&meissner(&["run", path, "--sensor", "128x128", "--strict"]), 1, &["cut", "--salvage"]);
        let output = meissner(&["info", path, "--salvage", "--json"]);
        assert!(output.status.success(), "{}", message(&output));
        let info = object(&output);
        let (salvaged, events) = (&info["salvaged"], info["events"].as_u64().expect("a count"));
        assert!((290..300).contains(&events), "{format}: {events}");
        assert_eq!(salvaged["events"], events);
        assert!(salvaged["bytes_not_read"].as_u64().is_some_and(|bytes| bytes > 0), "{salvaged}");
        assert!(salvaged["place"].is_string() && salvaged["what"].is_string(), "{salvaged}");
        assert!(message(&output).contains("salvaged: ") && message(&output).contains("not read"));
        let read = ["--sensor", "128x128", "--salvage"];
        for network in ["tactigraph-past", "force-lstm"] {
            let run = [&["run", path, "--json", "--network", network][..], &read].concat();
            let (_, summary) = lines(&meissner(&run));
            assert_eq!(&summary["salvaged"], salvaged, "{summary}");
            assert_eq!(summary["events"], events);
        }
        assert!(text(&meissner(&["info", path, "--salvage"])).contains("salvaged    "));
    }
    // Complete recordings cause no message, and a strict reader refuses a damaged one with and
    // without the option.
    let recording = default_recording();
    let output = meissner(&["info", argument(&recording), "--salvage", "--json"]);
    assert!(text(&output).contains("\"salvaged\":null") && message(&output).is_empty());
    let (_folder, path) = file("bad.csv", "t,x,y,p\n1,2,3,1\noops\n2,2,3,1\n");
    fails(&meissner(&["info", argument(&path), "--salvage", "--strict"]), 1, &["bad.csv", "line 3"]);
    fails(&meissner(&["info", "-", "--salvage"]), 2, &["--salvage", "standard input"]);
}

#[test]
fn convert_replaces_a_file_only_when_told_to() {
    let (_folder, path) = file("out.csv", "kept");
    let recording = default_recording();
    let convert = ["convert", argument(&recording), argument(&path)];
    fails(&meissner(&convert), 2, &["out.csv", "--force"]);
    assert_eq!(fs::read(&path).expect("it is still there"), b"kept");
    for force in ["--force", "-f"] {
        let output = meissner(&[&convert[..], &[force]].concat());
        assert!(output.status.success(), "{}", message(&output));
    }
    assert!(fs::read(&path).expect("it is there").starts_with(b"# sensor"));
}

#[test]
fn convert_reads_and_writes_the_standard_streams() {
    let text = rows(|e| format!("{},{},{},{}", e.t_us, e.x, e.y, u8::from(e.on)));
    for format in [Format::Csv, Format::Npy, Format::Dat, Format::Evt3] {
        let to = format.to_string().to_lowercase();
        let output = meissner_reading(&["convert", "-", "-", "--to", &to, "--sensor", "128x128"], &text);
        assert!(output.status.success(), "{}", message(&output));
        assert_eq!(output.stdout, encoded(format), "{format}");
        assert!(message(&output).contains("standard output: 300 events"), "{}", message(&output));
    }
    fails(&meissner_reading(&["convert", "-", "-"], &text), 2, &["--to aedat4|csv|npy|dat|evt3|es"]);
}

/// A folder with an older file.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("there is a place for temporary files"));
        folder.write("kept", b"of before");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: &[u8]) -> PathBuf {
        fs::write(self.path(name), content).expect("a temporary file can be written");
        self.path(name)
    }

    /// Runs the program with each of `options`, first with the older file, then with a missing one.
    /// It fails with `expected`, the file is unchanged, and there is no other.
    fn stays(&self, arguments: &[&str], options: &[&str], expected: &[&str]) {
        for option in options {
            for name in ["kept", "new"] {
                let path = self.path(name);
                let output = [&[option, argument(&path)][..], &[argument(&path)]];
                // An empty option is an argument without a name.
                let output = output[usize::from(option.is_empty())];
                let ran = meissner(&[arguments, output].concat());
                fails(&ran, 1, expected);
                let kept = fs::read(self.path("kept")).expect("it is still there");
                assert_eq!(kept, b"of before", "{arguments:?} {option}");
                assert!(!self.path("new").exists(), "{arguments:?} {option}");
            }
        }
    }
}

/// The default recording in every written format, N-MNIST and others cut within an event; and the
/// location in the message.
fn broken(folder: &Folder) -> Vec<(PathBuf, &'static str)> {
    let recording = meissner_io::read(&default_recording()).expect("the recording is sound");
    let events = &recording.events[..2000];
    let encoded = |format| {
        let mut bytes = Vec::new();
        encode(format, Some(Sensor::new(346, 260)), events, &mut bytes).expect("the format holds them");
        bytes
    };
    let cut = |format, less: usize| {
        let bytes = encoded(format);
        bytes[..bytes.len() / 2 / 26 * 26 - less].to_vec()
    };
    let csv = String::from_utf8(encoded(Format::Csv)).expect("text");
    let csv: String = csv.split_inclusive('\n').take(1000).collect();
    let mut evt3 = encoded(Format::Evt3);
    evt3.pop();
    vec![
        (folder.write("cut.csv", (csv + "17,3").as_bytes()), "line 1001"),
        (folder.write("cut.npy", &cut(Format::Npy, 1)), "array at byte"),
        (folder.write("cut.dat", &encoded(Format::Dat)[..1003]), "at byte"),
        (folder.write("cut.evt3", &evt3), "at byte"),
        (folder.write("cut.raw", b"% evt 2.0\n% end\n\0\0\0\x80\0\0"), "at byte"),
        (folder.write("cut.bin", &bytes(&digits()[0].events)[1..]), "unknown format"),
    ]
}

#[test]
fn a_recording_that_breaks_off_leaves_every_output_as_it_was() {
    let folder = Folder::new();
    for (path, place) in broken(&folder) {
        let name = path.file_name().and_then(|name| name.to_str()).expect("text");
        let path = argument(&path);
        for format in ["csv", "npy", "dat", "evt3"] {
            folder.stays(&["convert", path, "--to", format, "--force", "--strict"], &[""], &[name, place]);
        }
        // Without it, a line of a text is skipped.
        let strict = [path, "--sensor", "346x260", "--strict"];
        folder.stays(&[&["run"], &strict[..]].concat(), &["--save-state"], &[name, place]);
        let every = [&["run", "--every", "1ms", "--save-every", "1ms"], &strict[..]].concat();
        folder.stays(&every, &["--save-state"], &[name, place]);
        folder.stays(&[&["bench"], &strict[..]].concat(), &["--svg"], &[name, place]);
        let soak = ["verify", "tactigraph-past", path, "--soak", "--events", "1000", "--strict"];
        folder.stays(&soak, &["--out"], &[name, place]);
        let angle = ["pareto", "angle", path, "--network", "tactigraph-past", "--strict"];
        folder.stays(&angle, &["--svg", "--csv", "--out"], &[name, place]);
    }
}

#[test]
fn a_stream_that_breaks_off_leaves_the_file_or_the_state_behind_its_last_event() {
    let folder = Folder::new();
    let line = |i| format!("{},{},{},1\n", i * 100, i % 30, i * 7 % 30);
    let lines = (0..400).map(line).collect::<Vec<_>>().concat();
    let broken = format!("{lines}oh no\n");
    let kept = folder.path("kept");
    let convert = ["convert", "-", argument(&kept), "--to", "npy", "--force", "--strict"];
    let output = meissner_reading(&convert, &broken);
    fails(&output, 1, &["standard input", "line 401"]);
    // A line without an end, after which nothing can be read.
    let broken = lines + &"9".repeat(5000);
    let run = ["run", "-", "--network", "tactigraph-past", "--sensor", "30x30", "--every", "end"];
    let output = meissner_reading(&[&run[..], &["--save-state", argument(&kept)]].concat(), &broken);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("standard input: CSV: line at line 401"), "{}", message(&output));
    // The state is the one after the last event: a run can continue from it.
    let state = fs::read(&kept).expect("it was written");
    assert!(state.starts_with(b"MEISSNER"));
    let resumed = meissner_reading(&[&run[..], &["--resume", argument(&kept)]].concat(), "50000,1,2,1\n");
    assert!(resumed.status.success(), "{}", message(&resumed));
    let names = fs::read_dir(folder.0.path()).expect("it is there").count();
    assert_eq!(names, 1, "no temporary file stays behind");
}

#[test]
fn data_sets_that_break_off_leave_every_output_as_it_was() {
    let (folder, data) = (Folder::new(), SlipFolder::new());
    let text = csv(&readings(3, 2));
    fs::write(data.path().join("n/case1.csv"), &text[..text.len() - 70]).expect("it can be written");
    let path = argument(data.path());
    let place = ["n/case1.csv", "line 17", "24 fields"];
    folder.stays(&["prepare", "slip", path, "--network", "slip-lstm", "--force"], &["--out"], &place);
    let outputs = ["--svg", "--out", "--logits"];
    folder.stays(&["eval", "slip", path, "--network", "slip-lstm"], &outputs, &place);

    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (network, description) = runs.network(&small("own", &[]));
    runs.training("own.safetensors", &description, 5, &[]);
    let events = bytes(&digits()[0].events);
    fs::write(data.path().join("test/0/77.bin"), &events[..events.len() - 1]).expect("it can be written");
    let path = argument(data.path());
    let place = ["test/0/77.bin", "the last event at byte", "cut short"];
    folder.stays(&["prepare", "digits", path, "--force"], &["--out"], &place);
    let weights = runs.path().join("own.safetensors");
    let own = ["--network", argument(&network), "--weights", argument(&weights)];
    folder.stays(&[&["eval", "digits", path], &own[..]].concat(), &outputs, &place);

    let mut tensors = TensorFile::new([("sensor".to_owned(), "[30, 30]".to_owned())].into());
    for name in ["t_us", "x", "y", "on"] {
        tensors.i64(name, &[3], &[0, 1, 1]);
    }
    tensors.i64("start", &[2], &[0, 3]);
    let whole = tensors.into_bytes();
    let events = folder.write("events.safetensors", &whole[..whole.len() - 8]);
    let graphs = ["prepare", "graphs", argument(&events), "--network", argument(&network), "--force"];
    folder.stays(&graphs, &["--out"], &["events.safetensors", "expected a safetensors file"]);
}

#[test]
fn networks_and_weights_that_break_off_leave_every_output_as_it_was() {
    let folder = Folder::new();
    let text = small("own", &[]);
    let half = folder.write("half.toml", &text.as_bytes()[..text.len() / 2]);
    folder.stays(&["inspect", argument(&half)], &["--svg"], &["half.toml", "line"]);
    let runs = Runs::new();
    let (network, description) = runs.network(&text);
    runs.training("own.safetensors", &description, 5, &[]);
    let weights = fs::read(runs.path().join("own.safetensors")).expect("it was written");
    let weights = folder.write("half.safetensors", &weights[..weights.len() / 2]);
    let recording = default_recording();
    let own = [argument(&recording), "--network", argument(&network), "--weights", argument(&weights)];
    folder.stays(&[&["run"], &own[..]].concat(), &["--save-state"], &["half.safetensors"]);
    folder.stays(&[&["bench"], &own[..]].concat(), &["--svg"], &["half.safetensors"]);
    folder.stays(&[&["soak", "--events", "1000"], &own[..]].concat(), &["--json"], &["half.safetensors"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_description_without_an_end_is_refused_at_its_bound() {
    fails(&meissner(&["inspect", "/dev/zero"]), 1, &["/dev/zero", "at most 262144 bytes, found 262145"]);
}
