//! Reads results from a file of JSON: detects its kind, one object or lines, and an early end.
//!
//! Lines of predictions are read one at a time, in bounded memory. One object is read completely,
//! up to 32 MiB, with or without line breaks in it.

use std::io::{BufRead, Read};

use meissner_io::Kind;
use serde_json::Value;

use crate::error::ReportError;
use crate::json::{at, list, number, text};
use crate::stream::{Line, Stream};
use crate::truth::Truths;

/// Maximum bytes of a line of predictions, and of one object.
const MAX_LINE: usize = 4 << 20;
const MAX_OBJECT: usize = 32 << 20;
/// Number of bytes that are read to find the kind of a file without results.
const START: usize = 80 << 10;
/// Newest version of the keys that this page knows.
const MAX_SCHEMA: f64 = 1.0;
/// Commands whose results have a page; all commands of `eval` begin alike.
const COMMANDS: [&str; 10] =
    ["run", "play", "bench", "sweep", "fit", "pareto", "verify", "stress", "soak", "simulate loop"];

/// A result of the program.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The file, and the number of its input if it has several.
    pub name: String,
    /// The command, as its header names it: `run`, `eval slip`.
    pub command: String,
    /// Its header.
    pub header: Value,
    /// Sentences about missing parts of the file.
    pub notes: Vec<String>,
    pub(crate) body: Body,
}

/// The content after the header.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    /// Predictions or reports, with their summary.
    Stream(Box<Stream>),
    /// All of one object, including the header.
    Object(Value),
}

impl Outcome {
    /// The network, if there is one.
    pub fn network(&self) -> Option<&str> {
        text(&self.header, "network/name")
    }

    /// All networks of the result, in their order.
    pub fn networks(&self) -> Vec<&str> {
        let of_object = match &self.body {
            Body::Object(object) => list(object, "networks"),
            Body::Stream(_) => &[],
        };
        let base = match &self.body {
            Body::Object(object) => text(object, "base/name"),
            Body::Stream(_) => None,
        };
        let named = |of| text(of, "network/name").or_else(|| text(of, "network"));
        self.network().into_iter().chain(base).chain(of_object.iter().filter_map(named)).collect()
    }

    /// The subject of the result: its networks, or else its input.
    pub(crate) fn subject(&self) -> String {
        match self.networks().as_slice() {
            [] => crate::words::file_name(self.input()).to_owned(),
            [one] => (*one).to_owned(),
            [first, second] => format!("{first}, {second}"),
            [first, rest @ ..] => format!("{first} and {} others", rest.len()),
        }
    }

    /// The input.
    pub(crate) fn input(&self) -> &str {
        text(&self.header, "input/name").unwrap_or("unknown input")
    }
}

/// Reads the results in the file `name`: one, or one for each input of a `play`. `truths` are
/// compared with predictions.
///
/// A cut last line is left out, and [`Outcome::notes`] reports it.
///
/// # Errors
/// [`ReportError`]: the file cannot be read, is something else, or has a line that the program does
/// not write.
pub fn read(name: &str, input: impl BufRead, truths: &Truths) -> Result<Vec<Outcome>, ReportError> {
    let mut lines = Lines { name, input, line: Vec::new(), number: 0, is_whole: true };
    let first = loop {
        match lines.next(MAX_OBJECT) {
            Ok(true) if lines.line.trim_ascii().is_empty() => {}
            Ok(true) => break std::mem::take(&mut lines.line),
            Ok(false) => return Err(other(name, "an empty file")),
            // Such a long line belongs to another kind of file, unless it begins an object.
            Err(NoLine::Long(_)) if !is_object(&lines.line) => break std::mem::take(&mut lines.line),
            Err(error) => return Err(lines.named(error)),
        }
    };
    if !is_object(&first) {
        return Err(other(name, &lines.kind(first)?));
    }
    match serde_json::from_slice::<Value>(&first) {
        Ok(value)
            if value.as_object().is_some_and(|keys| keys.len() == 1) && at(&value, "header").is_some() =>
        {
            let header = checked(name, value["header"].clone())?;
            if !matches!(text(&header, "command"), Some("run" | "play")) {
                let command = text(&header, "command").unwrap_or_default();
                return Err(other(name, &format!("only the header of {command}: the rest is missing")));
            }
            stream(lines, header, truths)
        }
        Ok(value) => object(name, value),
        // An object over several lines, as other programs print it.
        Err(error) if error.is_eof() => {
            let value = lines.whole(first)?;
            object(name, value)
        }
        Err(source) => Err(other(name, &format!("text that is no JSON: {source}"))),
    }
}

/// Whether a text may begin with an object.
fn is_object(text: &[u8]) -> bool {
    text.trim_ascii_start().first() == Some(&b'{')
}

/// The result from one object.
fn object(name: &str, value: Value) -> Result<Vec<Outcome>, ReportError> {
    let Some(header) = at(&value, "header").cloned() else {
        return Err(other(name, headless(&value)));
    };
    let header = checked(name, header)?;
    let command = text(&header, "command").unwrap_or_default().to_owned();
    let (name, body) = (name.to_owned(), Body::Object(value));
    Ok(vec![Outcome { name, command, header, notes: Vec::new(), body }])
}

/// The `header`, if it belongs to a command whose results have a page.
fn checked(name: &str, header: Value) -> Result<Value, ReportError> {
    let Some(command) = text(&header, "command") else {
        return Err(other(name, "JSON whose header names no command"));
    };
    if !COMMANDS.contains(&command) && !command.starts_with("eval ") {
        return Err(other(name, &format!("a result of {command}")));
    }
    match number(&header, "schema") {
        Some(schema) if schema > MAX_SCHEMA => {
            Err(other(name, &format!("version {schema} of its keys: this program knows 1")))
        }
        _ => Ok(header),
    }
}

/// The kind of JSON without a header.
fn headless(value: &Value) -> &'static str {
    let has = |keys: &[&str]| keys.iter().all(|key| value.get(key).is_some());
    if has(&["on", "off", "span_us"]) {
        "what `meissner info` prints"
    } else if has(&["layers", "tensors"]) || has(&["layers", "parameters"]) {
        "what `meissner inspect` prints"
    } else if has(&["recordings", "in_silence"]) {
        "what `meissner record` prints"
    } else if has(&["t_us", "value"]) {
        "a prediction without the header before it"
    } else {
        "JSON without a header"
    }
}

/// The predictions of one or more inputs, line by line.
fn stream(
    mut lines: Lines<'_, impl BufRead>,
    header: Value,
    truths: &Truths,
) -> Result<Vec<Outcome>, ReportError> {
    const EXPECTED: &str = "a prediction, a report or a summary";
    let mut streams = vec![Stream::new(header, truths)];
    let mut notes = Vec::new();
    loop {
        match lines.next(MAX_LINE) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => return Err(lines.named(error)),
        }
        if lines.line.trim_ascii().is_empty() {
            continue;
        }
        match serde_json::from_slice::<Line<'_>>(&lines.line) {
            Ok(Line { header: Some(header), .. }) => {
                streams.push(Stream::new(checked(lines.name, header)?, truths));
            }
            Ok(line) => {
                let input = line.input();
                if let Some(stream) = streams.get_mut(input) {
                    stream.take(line);
                }
            }
            Err(_) if !lines.is_whole => {
                let number = lines.number;
                notes.push(format!("Line {number} is cut short. It is left out; the file ends there."));
            }
            Err(source) => {
                let (name, line) = (lines.name.to_owned(), lines.number);
                return Err(ReportError::Line { name, line, expected: EXPECTED, source });
            }
        }
    }
    let several = streams.len() > 1;
    let outcome = |(input, mut stream): (usize, Stream)| {
        let mut notes = notes.clone();
        if stream.summary.is_none() && stream.failed.is_none() {
            notes.push("There is no summary: the run did not end, or the file was cut.".to_owned());
        }
        notes.extend(stream.failed.take().map(|error| format!("The engine failed: {error}.")));
        let name = if several { format!("{}, input {input}", lines.name) } else { lines.name.to_owned() };
        let header = std::mem::take(&mut stream.header);
        let command = text(&header, "command").unwrap_or_default().to_owned();
        Outcome { name, command, header, notes, body: Body::Stream(Box::new(stream)) }
    };
    Ok(streams.into_iter().enumerate().map(outcome).collect())
}

fn other(name: &str, found: &str) -> ReportError {
    ReportError::Other { name: name.to_owned(), found: found.to_owned() }
}

/// Lines of a file in one buffer.
struct Lines<'a, R> {
    name: &'a str,
    input: R,
    line: Vec<u8>,
    /// The number of the line, from 1.
    number: u64,
    /// Whether the line ends with a line feed.
    is_whole: bool,
}

/// The reason why there is no next line.
enum NoLine {
    Read(std::io::Error),
    Long(usize),
}

impl<R: BufRead> Lines<'_, R> {
    /// Reads the next line, of at most `limit` bytes. Returns whether there is one.
    fn next(&mut self, limit: usize) -> Result<bool, NoLine> {
        self.line.clear();
        let bytes = (&mut self.input).take(limit as u64 + 1).read_until(b'\n', &mut self.line);
        let bytes = bytes.map_err(NoLine::Read)?;
        self.number += 1;
        if bytes > limit {
            return Err(NoLine::Long(limit));
        }
        self.is_whole = self.line.ends_with(b"\n");
        Ok(bytes > 0)
    }

    fn named(&self, error: NoLine) -> ReportError {
        let name = self.name.to_owned();
        match error {
            NoLine::Read(source) => ReportError::Read { name, source },
            NoLine::Long(limit) => ReportError::Long { name, line: self.number, limit },
        }
    }

    /// The object that begins with the line `first` and extends to the end of the file.
    fn whole(&mut self, first: Vec<u8>) -> Result<Value, ReportError> {
        let mut bytes = first;
        let room = (MAX_OBJECT + 1).saturating_sub(bytes.len()) as u64;
        let read = (&mut self.input).take(room).read_to_end(&mut bytes);
        read.map_err(|error| self.named(NoLine::Read(error)))?;
        if bytes.len() > MAX_OBJECT {
            return Err(self.named(NoLine::Long(MAX_OBJECT)));
        }
        serde_json::from_slice(&bytes).map_err(|error| {
            let found = if error.is_eof() {
                format!("JSON that is cut short: {error}")
            } else {
                format!("text that is no JSON object, or more than one: {error}")
            };
            other(self.name, &found)
        })
    }

    /// The kind of a file that begins with the line `first` and is not an object.
    fn kind(&mut self, first: Vec<u8>) -> Result<String, ReportError> {
        let mut bytes = first;
        let room = START.saturating_sub(bytes.len()) as u64;
        let read = (&mut self.input).take(room).read_to_end(&mut bytes);
        read.map_err(|error| self.named(NoLine::Read(error)))?;
        // A character may be cut at the end.
        let is_text = !bytes.contains(&0)
            && std::str::from_utf8(&bytes).map_or_else(|e| e.error_len().is_none(), |_| true);
        if bytes.trim_ascii_start().starts_with(b"[") {
            return Ok("a list in JSON, such as `meissner networks` prints".to_owned());
        }
        Ok(match Kind::of(&bytes) {
            Some(kind) => kind.to_string(),
            None if bytes.len() > 14 && bytes[..14].eq_ignore_ascii_case(b"<!doctype html") => {
                "a page of HTML".to_owned()
            }
            None if bytes.get(8..10) == Some(b"{\"") => "a safetensors file".to_owned(),
            None if is_text => "text: was the result printed with --json?".to_owned(),
            None => "bytes of an unknown kind".to_owned(),
        })
    }
}
