//! Inputs that break off half-way: one message with the place, and every output of before as it
//! was.

use std::fs;
use std::path::PathBuf;

use meissner_engine::Sensor;
use meissner_io::{Format, encode};
use meissner_models::TensorFile;
use tempfile::TempDir;

use crate::digits_data::{DigitsFolder, Runs, bytes, digits, small};
use crate::exit_status::fails;
use crate::slip_data::{SlipFolder, csv, readings};
use crate::support::{argument, default_recording, meissner, meissner_reading, message};

/// A folder with a file of before.
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

    /// Runs the program with each of `options`, first naming the file of before, then one that is
    /// not there: it fails with `expected`, the file is as it was, and there is no other.
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

/// The default recording in every format that is written, N-MNIST and others cut within an event;
/// the message's place.
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
        // Without it, a line of a text is passed over.
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
    // A line without an end, behind which nothing can be read.
    let broken = lines + &"9".repeat(5000);
    let run = ["run", "-", "--network", "tactigraph-past", "--sensor", "30x30", "--every", "end"];
    let output = meissner_reading(&[&run[..], &["--save-state", argument(&kept)]].concat(), &broken);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("standard input: CSV: line at line 401"), "{}", message(&output));
    // The state is that behind the last event: a run can go on from it.
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
