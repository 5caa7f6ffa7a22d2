//! Where events come from: a file, lines on standard input as they arrive, or the recording that the program holds.

use std::fs;
use std::io::BufRead;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::{CsvEvents, Format, IoError, Recording};

use crate::error::CliError;
use crate::interrupt;
use crate::refusals::Refusals;

/// A synthetic press and release; see `cli/assets/README.md`.
const EMBEDDED: &[u8] = include_bytes!("../assets/press_release_synthetic.evt3");
const EMBEDDED_NAME: &str = "press_release_synthetic.evt3 (embedded; synthetic, not a real sensor)";
pub(crate) const STDIN_NAME: &str = "standard input";

/// A stream of events, and what is known about it.
///
/// Lines of a text that are no events are passed over ([`Refusals`]), unless it is to be strict.
pub(crate) struct Source {
    /// For messages and reports.
    pub(crate) name: String,
    /// Its format.
    pub(crate) format: Format,
    /// The geometry that it names.
    sensor: Option<Sensor>,
    events: Events,
    refusals: Refusals,
}

enum Events {
    Read(std::vec::IntoIter<Event>),
    Arriving {
        /// The first event, where it had to be waited for.
        first: Option<Event>,
        lines: CsvEvents<interrupt::Input>,
    },
}

/// Whether `path` means standard input.
pub(crate) fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// Standard input, which ends with an error where the program is asked to end.
pub(crate) fn stdin() -> Result<interrupt::Input, CliError> {
    interrupt::input().map_err(|source| CliError::Open { path: STDIN_NAME.into(), source })
}

/// The recording in the file at `path`, or all of standard input where it is `-`.
///
/// # Errors
/// Also where a line of a text is no event.
pub(crate) fn read(path: &Path) -> Result<Recording, CliError> {
    if is_stdin(path) {
        let mut lines = CsvEvents::new(stdin()?);
        let events = lines.by_ref().collect::<Result<_, _>>();
        let events = events.map_err(|e| CliError::recording(STDIN_NAME, e))?;
        return Ok(text(lines.sensor(), events));
    }
    meissner_io::read(path).map_err(|e| CliError::recording(&path.display().to_string(), e))
}

impl Source {
    /// Opens `recording`; `None` is the embedded one. With `strict`, a line of a text that is no event is an error: of a
    /// file at once, of standard input when it comes.
    ///
    /// With `sensor_known`, standard input is not waited for; else its first event, since a comment before it may name
    /// the geometry.
    pub(crate) fn open(recording: Option<&Path>, sensor_known: bool, strict: bool) -> Result<Self, CliError> {
        match recording {
            None => {
                let recording =
                    meissner_io::decode(EMBEDDED).map_err(|e| CliError::recording(EMBEDDED_NAME, e))?;
                Ok(Self::of(recording, Refusals::new(EMBEDDED_NAME, strict)))
            }
            Some(path) if is_stdin(path) => {
                let mut refusals = Refusals::new(STDIN_NAME, strict);
                let mut lines = CsvEvents::new(stdin()?);
                let first = if sensor_known { None } else { next(&mut lines, &mut refusals) };
                let first = first.transpose()?;
                let sensor = lines.sensor();
                let events = Events::Arriving { first, lines };
                Ok(Self { name: STDIN_NAME.to_owned(), format: Format::Csv, sensor, events, refusals })
            }
            Some(path) => {
                let name = path.display().to_string();
                let mut refusals = Refusals::new(&name, strict);
                let file =
                    |source| CliError::File(IoError::File { action: "read", path: path.to_owned(), source });
                let bytes = fs::read(path).map_err(file)?;
                let recording = match meissner_io::detect(&bytes) {
                    Some(Format::Csv) => read_lines(&bytes, &mut refusals)?,
                    _ => meissner_io::decode(&bytes).map_err(|e| CliError::recording(&name, e))?,
                };
                Ok(Self::of(recording, refusals))
            }
        }
    }

    fn of(recording: Recording, refusals: Refusals) -> Self {
        let Recording { format, sensor, events, .. } = recording;
        let events = Events::Read(events.into_iter());
        Self { name: refusals.name().to_owned(), format, sensor, events, refusals }
    }

    /// The geometry: `asked`, or what the recording names.
    pub(crate) fn sensor(&self, asked: Option<Sensor>) -> Result<Sensor, CliError> {
        asked
            .or(self.sensor)
            .ok_or_else(|| CliError::NoGeometry { recording: self.name.clone(), format: self.format })
    }

    /// How many events are to come, where that is known.
    pub(crate) fn remaining(&self) -> Option<u64> {
        match &self.events {
            Events::Read(events) => Some(events.len() as u64),
            Events::Arriving { .. } => None,
        }
    }

    /// How many lines were no events so far.
    pub(crate) fn lines_refused(&self) -> u64 {
        self.refusals.count()
    }
}

impl Iterator for Source {
    type Item = Result<Event, CliError>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.events {
            Events::Read(events) => events.next().map(Ok),
            Events::Arriving { first, lines } => {
                if let Some(event) = first.take() {
                    return Some(Ok(event));
                }
                next(lines, &mut self.refusals)
            }
        }
    }
}

/// The next event of `lines`; none at the end, and where the program is asked to end.
///
/// # Errors
/// What ends the lines, and those of [`Refusals`].
fn next<R: BufRead>(lines: &mut CsvEvents<R>, refusals: &mut Refusals) -> Option<Result<Event, CliError>> {
    loop {
        let refused = match lines.next() {
            None => refusals.end(),
            Some(Ok(event)) => {
                refusals.take();
                return Some(Ok(event));
            }
            Some(Err(_)) if interrupt::requested() => return None,
            Some(Err(error @ (IoError::Malformed { .. } | IoError::OutsideSensor { .. }))) => {
                match refusals.refuse(error.to_string()) {
                    Ok(()) => continue,
                    refused => refused,
                }
            }
            Some(Err(error)) => Err(CliError::recording(refusals.name(), error)),
        };
        return refused.err().map(Err);
    }
}

/// The recording that is the text `bytes`.
fn read_lines(bytes: &[u8], refusals: &mut Refusals) -> Result<Recording, CliError> {
    let mut lines = CsvEvents::new(bytes);
    let mut events = Vec::new();
    while let Some(event) = next(&mut lines, refusals) {
        events.push(event?);
    }
    Ok(text(lines.sensor(), events))
}

fn text(sensor: Option<Sensor>, events: Vec<Event>) -> Recording {
    Recording { format: Format::Csv, sensor, events, other_streams: Vec::new() }
}
