//! Runs the program and reads its output.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use meissner_models::{FrameDescription, draw};
use serde_json::Value;
use tempfile::TempDir;

use crate::output::page::documented;

/// The shipped networks that run incrementally.
pub(crate) const INCREMENTAL: [&str; 4] = ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"];

/// The program with `arguments`, not yet started.
pub(crate) fn command<S: AsRef<OsStr>>(arguments: &[S]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_meissner"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// The program's output for `arguments`.
pub(crate) fn meissner<S: AsRef<OsStr>>(arguments: &[S]) -> Output {
    command(arguments).output().expect("the program starts")
}

/// The program's output for `arguments`, with `input` on standard input.
pub(crate) fn meissner_reading(arguments: &[&str], input: &(impl AsRef<[u8]> + ?Sized)) -> Output {
    let mut child = command(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("standard input is piped");
    // The program may end before it has read everything.
    let _ = stdin.write_all(input.as_ref());
    drop(stdin);
    child.wait_with_output().expect("the program ends")
}

/// Standard error as text, without the note of a program that is built without optimisation.
pub(crate) fn message(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let is_said = |line: &&str| !line.starts_with("note: this program was built without optimisation");
    text.split_inclusive('\n').filter(is_said).collect()
}

/// Standard output as text.
pub(crate) fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Standard output with one blank between words, however its lines are folded.
pub(crate) fn words(output: &Output) -> String {
    text(output).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The lines of a successful run with `--json`: the predictions, and the summary.
pub(crate) fn lines(output: &Output) -> (Vec<Value>, Value) {
    let (_, lines, summary) = headed_lines(output);
    (lines, summary)
}

/// The lines of a successful run with `--json`: the header, the predictions, and the summary.
pub(crate) fn headed_lines(output: &Output) -> (Value, Vec<Value>, Value) {
    assert!(output.status.success(), "{}", message(output));
    let text = text(output);
    let mut lines: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}")))
        .collect();
    let summary = lines.pop().expect("there is a summary")["summary"].clone();
    assert!(summary.is_object(), "the last line is the summary");
    let header = lines.remove(0)["header"].clone();
    assert!(header.is_object(), "the first line is the header");
    let command = header["command"].as_str().expect("the header names the command");
    lines.iter().chain([&summary]).for_each(|line| documented(command, line));
    (header, lines, summary)
}

/// The JSON value that a successful run prints. A report contains only keys that are on the page on
/// JSON.
pub(crate) fn object(output: &Output) -> Value {
    assert!(output.status.success(), "{}", message(output));
    parsed(&output.stdout)
}

/// The report in the file at `path`, as [`object`].
pub(crate) fn written(path: &Path) -> Value {
    parsed(&std::fs::read(path).expect("it was written"))
}

fn parsed(json: &[u8]) -> Value {
    let value: Value = serde_json::from_slice(json).expect("one JSON value");
    if let Some(command) = value["header"]["command"].as_str() {
        documented(command, &value);
    }
    value
}

/// The keys of an object.
pub(crate) fn keys(value: &Value) -> String {
    value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>().join(" ")
}

/// Bits of a prediction's values.
pub(crate) fn bits(line: &Value) -> Vec<u32> {
    let values = line["value"].as_array().expect("a prediction has values");
    values.iter().map(|v| (v.as_f64().expect("values are numbers") as f32).to_bits()).collect()
}

/// Times of predictions.
pub(crate) fn times(lines: &[Value]) -> Vec<Option<i64>> {
    lines.iter().map(|line| line["t_us"].as_i64()).collect()
}

/// Events in the windows of predictions.
pub(crate) fn nodes(lines: &[Value]) -> Vec<u64> {
    lines.iter().filter_map(|line| line["nodes"].as_u64()).collect()
}

/// A folder for files, and the path of one in it with `content`.
pub(crate) fn file(name: &str, content: impl AsRef<[u8]>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join(name);
    std::fs::write(&path, content).expect("a temporary file can be written");
    (folder, path)
}

/// `path` as an argument.
pub(crate) fn argument(path: &Path) -> &str {
    path.to_str().expect("temporary paths are text")
}

/// The embedded recording as a file of the repository.
pub(crate) fn default_recording() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../run/assets/dome_press.evt3")
}

/// A network over pictures of 32 x 24 pixels.
const PICTURES: &str = r#"
[network]
name = "two"
[input]
kind = "image"
channels = 3
height = 24
width = 32
frames = "picture"
difference = true
mean = [0.0, 0.0, 0.0]
std = [0.1, 0.1, 0.1]
force_mean = 0.0
force_std = 0.01
pixel_mm = [0.6, 0.6]
threshold_n = 0.001
[[layer]]
name = "first"
kind = "conv"
channels = 8
kernel = 3
activation = "relu"
[[layer]]
name = "head"
kind = "conv"
channels = 1
kernel = 3
[output]
names = ["force"]
unit = "N per pixel"
"#;

/// Writes a small network over pictures with drawn weights into `folder`. Returns its description
/// and its weights.
pub(crate) fn picture_network(folder: &Path) -> [PathBuf; 2] {
    let [network, weights] = ["two.toml", "two.safetensors"].map(|name| folder.join(name));
    std::fs::write(&network, PICTURES).expect("it is written");
    let description = FrameDescription::load(&network).expect("a description");
    let drawn = draw(&description, 5).to_safetensors(&[("seed".to_owned(), "5".to_owned())].into());
    std::fs::write(&weights, drawn).expect("it is written");
    [network, weights]
}
