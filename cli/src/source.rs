//! Where events come from: a file, lines on standard input as they arrive, or the recording that the program holds.

use std::io::{StdinLock, stdin};
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::{CsvEvents, Format, Recording};

use crate::error::CliError;

/// A synthetic press and release; see `cli/assets/README.md`.
const EMBEDDED: &[u8] = include_bytes!("../assets/press_release_synthetic.evt3");
const EMBEDDED_NAME: &str = "press_release_synthetic.evt3 (embedded; synthetic, not a real sensor)";
pub(crate) const STDIN_NAME: &str = "standard input";

/// A stream of events, and what is known about it.
pub(crate) struct Source {
    /// For messages and reports.
    pub(crate) name: String,
    /// Its format.
    pub(crate) format: Format,
    /// The geometry that it names.
    sensor: Option<Sensor>,
    events: Events,
}

enum Events {
    Read(std::vec::IntoIter<Event>),
    /// Lines that arrive, and the first event where it had to be waited for.
    Arriving(Option<Event>, CsvEvents<StdinLock<'static>>),
}

/// Whether `path` means standard input.
pub(crate) fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The recording in the file at `path`, or all of standard input where it is `-`.
pub(crate) fn read(path: &Path) -> Result<Recording, CliError> {
    if is_stdin(path) {
        let mut lines = CsvEvents::new(stdin().lock());
        let events = lines.by_ref().collect::<Result<_, _>>();
        let events = events.map_err(|e| CliError::recording(STDIN_NAME, e))?;
        return Ok(Recording {
            format: Format::Csv,
            sensor: lines.sensor(),
            events,
            other_streams: Vec::new(),
        });
    }
    meissner_io::read(path).map_err(|e| CliError::recording(&path.display().to_string(), e))
}

impl Source {
    /// Opens `recording`; `None` is the embedded one.
    ///
    /// With `sensor_known`, standard input is not waited for; else its first event, since a comment before it may name
    /// the geometry.
    pub(crate) fn open(recording: Option<&Path>, sensor_known: bool) -> Result<Self, CliError> {
        match recording {
            None => {
                let recording =
                    meissner_io::decode(EMBEDDED).map_err(|e| CliError::recording(EMBEDDED_NAME, e))?;
                Ok(Self::of(EMBEDDED_NAME.to_owned(), recording))
            }
            Some(path) if is_stdin(path) => {
                let mut lines = CsvEvents::new(stdin().lock());
                let first = if sensor_known { None } else { lines.next() };
                let first = first.transpose().map_err(|e| CliError::recording(STDIN_NAME, e))?;
                Ok(Self {
                    name: STDIN_NAME.to_owned(),
                    format: Format::Csv,
                    sensor: lines.sensor(),
                    events: Events::Arriving(first, lines),
                })
            }
            Some(path) => Ok(Self::of(path.display().to_string(), read(path)?)),
        }
    }

    fn of(name: String, recording: Recording) -> Self {
        let events = Events::Read(recording.events.into_iter());
        Self { name, format: recording.format, sensor: recording.sensor, events }
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
            Events::Arriving(..) => None,
        }
    }
}

impl Iterator for Source {
    type Item = Result<Event, CliError>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.events {
            Events::Read(events) => events.next().map(Ok),
            Events::Arriving(first, lines) => match first.take() {
                Some(event) => Some(Ok(event)),
                None => Some(lines.next()?.map_err(|e| CliError::recording(STDIN_NAME, e))),
            },
        }
    }
}
