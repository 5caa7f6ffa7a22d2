//! Sources of events: a file, a stream on which they arrive, or the embedded recording.
//!
//! Invariant: an input that is not a regular file, such as a pipe, is opened and read once. Its
//! content is held until the recording is decoded, and the salvageable part is found in this
//! content.

use std::path::Path;
use std::time::Duration;

use meissner_engine::{Event, EventCounters, Sensor};
use meissner_io::limits::STREAM_BYTES;
use meissner_io::{
    Format, HeldContent, IoError, LeftOutKind, Place, RECORD_BYTES, ReadOptions, Recording, TimeRange,
};

use crate::arriving::{Arriving, raw_format};
use crate::error::{Result, RunError, chain};
use crate::left_out::LineErrors;
use crate::losses::{Advice, InputLosses, Salvaged};
use crate::{interrupt, left_out, streams};

/// A simulated press and release; see `run/assets/README.md`.
const EMBEDDED: &[u8] = include_bytes!("../assets/dome_press.evt3");
pub(crate) const EMBEDDED_NAME: &str = "dome_press.evt3 (embedded; simulated, not a real sensor)";
/// Maximum number of events of a stream that is read completely.
const MAX_EVENTS: u64 = STREAM_BYTES / RECORD_BYTES as u64;

/// A stream of events with its name, format and geometry.
///
/// Lines of a text that cannot be read are skipped and counted, and so are words and events of a
/// file that a recording leaves out, unless the source is strict.
pub struct Source {
    /// Name for messages and reports.
    pub name: String,
    /// The name of its format.
    pub format: String,
    /// The part of a truncated recording that was kept.
    pub salvaged: Option<Salvaged>,
    /// The geometry that the source states.
    sensor: Option<Sensor>,
    /// Number of events in the recording, if it is known.
    recorded: Option<u64>,
    events: Events,
    /// The range of the events that arrive, and the time of the first one once it is known.
    range: Option<(TimeRange, Option<i64>)>,
    refusals: LineErrors,
    /// Lines of a text in a file that could not be read.
    lines_left_out: u64,
    /// Every `stride`-th event is taken.
    stride: usize,
    /// Number of events to skip before the next one is taken.
    pass_over: usize,
    advice: Advice,
}

enum Events {
    Read(std::vec::IntoIter<Event>),
    Arriving {
        /// The first event, if the source had to wait for it.
        first: Option<Event>,
        rest: Box<Arriving>,
    },
}

/// The recording at `path`, or all events that arrive on this stream; other datagrams are skipped.
///
/// # Errors
/// The recording cannot be read, or a line of a text is malformed.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Recording> {
    if streams::is_live(path) {
        let (mut arriving, mut events) = (Arriving::open(path, options)?, Vec::new());
        let strict = options.strict && !streams::is_of_datagrams(path);
        let mut refusals = LineErrors::of_stream(path, raw_format(path, options).is_some(), strict);
        while let Some(event) = next(&mut arriving, &mut refusals) {
            events.push(event?);
            // A device sends events without end.
            if events.len() as u64 > MAX_EVENTS {
                let (format, what, place, unit) =
                    (arriving.format(), "stream", Place::Event(MAX_EVENTS), "events");
                let (limit, actual, at_least) = (MAX_EVENTS, events.len() as u64, true);
                let error = IoError::TooLarge { format, what, place, unit, limit, actual, at_least };
                return Err(RunError::recording(refusals.name(), error));
            }
        }
        let left_out = refusals.left_out();
        let format = raw_format(path, options).unwrap_or(Format::Csv);
        return Ok(Recording { format, left_out, ..text(arriving.sensor(), events, options.range) });
    }
    InFile::open(path, options)?.read(options)
}

/// The content at a path.
struct InFile<'a> {
    path: &'a Path,
    /// The content of an input that can be read only once.
    held: Option<HeldContent>,
}

impl<'a> InFile<'a> {
    fn open(path: &'a Path, options: &ReadOptions) -> Result<Self> {
        let once = !path.is_file() && !path.is_dir();
        let held = once.then(|| HeldContent::read(path, options.salvage)).transpose();
        Ok(Self {
            path,
            held: held.map_err(|source| RunError::recording(&path.display().to_string(), source))?,
        })
    }

    fn decode(&self, options: ReadOptions) -> Result<Recording, IoError> {
        match &self.held {
            Some(content) => content.decode(options),
            None => meissner_io::read_with(self.path, options),
        }
    }

    fn read(&self, options: &ReadOptions) -> Result<Recording> {
        let recording = self.decode(*options).map_err(|source| self.refused(options, source))?;
        if let Some(salvaged) = Salvaged::of(&recording) {
            tracing::warn!("{}: salvaged: {salvaged}", self.path.display());
        }
        left_out::warn(&self.path.display().to_string(), &recording);
        Ok(recording)
    }

    /// The error for the failed read `source`, with the part that can be salvaged.
    fn refused(&self, options: &ReadOptions, source: IoError) -> RunError {
        use IoError::{Malformed, Truncated};
        let name = self.path.display().to_string();
        let may_be_cut = matches!(source, Truncated { .. } | Malformed { place: Place::Line(_), .. });
        if may_be_cut
            && !options.salvage
            && let Ok(recording) = self.decode(options.salvage(true))
            && let Some(salvaged) = Salvaged::of(&recording)
        {
            let (source, salvaged) = (Box::new(source), Some(Box::new(salvaged)));
            return RunError::Recording { recording: name.into(), source, salvaged };
        }
        RunError::recording(&name, source)
    }
}

pub(crate) fn embedded() -> Result<Recording> {
    meissner_io::decode(EMBEDDED).map_err(|error| RunError::recording(EMBEDDED_NAME, error))
}

impl Source {
    /// Opens `recording`, or the embedded recording for `None`. With `strict`, a line of a text
    /// that cannot be read is an error: here for a file, when it arrives for a stream.
    ///
    /// Without `sensor_known`, waits for a stream's first event: a comment may state it.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn open(
        recording: Option<&Path>,
        options: &ReadOptions,
        sensor_known: bool,
        strict: bool,
    ) -> Result<Self> {
        match recording {
            None => {
                let mut recording = embedded()?;
                options.range.inspect(|range| range.cut(&mut recording));
                Ok(Self::of(recording, LineErrors::new(EMBEDDED_NAME, strict)))
            }
            Some(path) if streams::is_live(path) => {
                let mut refusals = LineErrors::of_stream(path, raw_format(path, options).is_some(), strict);
                let mut arriving = Arriving::open(path, options)?;
                let first =
                    if sensor_known { None } else { next(&mut arriving, &mut refusals).transpose()? };
                let (format, sensor) = (arriving.format(), arriving.sensor());
                let events = Events::Arriving { first, rest: Box::new(arriving) };
                let range = options.range.map(|range| (range, None));
                Ok(Self { range, ..Self::new(format, sensor, events, refusals) })
            }
            Some(path) => {
                let recording = read(path, &options.strict(strict))?;
                Ok(Self::of(recording, LineErrors::of(path, strict)))
            }
        }
    }

    fn of(recording: Recording, refusals: LineErrors) -> Self {
        let salvaged = Salvaged::of(&recording);
        let Recording { format, sensor, events, left_out, .. } = recording;
        let lines = left_out.iter().filter(|left_out| left_out.kind == LeftOutKind::Lines);
        let lines_left_out = lines.map(|lines| lines.count).sum();
        Self {
            salvaged,
            lines_left_out,
            ..Self::new(format, sensor, Events::Read(events.into_iter()), refusals)
        }
    }

    fn new(format: impl ToString, sensor: Option<Sensor>, events: Events, refusals: LineErrors) -> Self {
        let recorded = match &events {
            Events::Read(events) => Some(events.len() as u64),
            Events::Arriving { .. } => None,
        };
        Self {
            name: refusals.name().to_owned(),
            format: format.to_string(),
            salvaged: None,
            sensor,
            recorded,
            events,
            range: None,
            refusals,
            lines_left_out: 0,
            stride: 1,
            pass_over: 0,
            advice: |_| None,
        }
    }

    /// The geometry: `asked` if given, else the one that the recording states.
    ///
    /// # Errors
    /// Neither is known.
    pub fn sensor(&self, asked: Option<Sensor>) -> Result<Sensor> {
        asked
            .or(self.sensor)
            .ok_or_else(|| RunError::NoGeometry { recording: self.name.clone(), format: self.format.clone() })
    }

    /// Takes only every `stride`-th event, beginning with the first.
    #[must_use]
    pub fn every(self, stride: usize) -> Self {
        Self { stride: stride.max(1), ..self }
    }

    /// Adds `advice` at the end of each warning of lost input.
    #[must_use]
    pub fn with_advice(self, advice: Advice) -> Self {
        Self { advice, ..self }
    }

    /// If the connection to a server is cut, tries for `patience` to connect again. Each cut is one
    /// of the [lines that are refused](Self::lines_refused).
    #[must_use]
    pub fn patient(mut self, patience: Duration) -> Self {
        if let Events::Arriving { rest, .. } = &mut self.events {
            rest.patience = patience;
        }
        self
    }

    /// Whether events are read as they arrive.
    pub fn is_live(&self) -> bool {
        matches!(self.events, Events::Arriving { .. })
    }

    /// The losses so far of a run on `sensor`. `events` counts the events that reached the network.
    pub fn losses(&self, events: EventCounters, sensor: Sensor) -> InputLosses {
        let losses = InputLosses::of_events(events, sensor).with_advice(self.advice);
        InputLosses { lines_refused: self.lines_refused(), ..losses }
    }

    /// The number of events in the recording, if it is known.
    pub fn recorded(&self) -> Option<u64> {
        self.recorded
    }

    /// The number of lines so far that could not be read, and of similar problems: odd words of raw
    /// bytes, including losses, and cuts of a connection.
    pub fn lines_refused(&self) -> u64 {
        self.refusals.count() + self.lines_left_out
    }

    /// The remaining events of a recording; empty for a stream, whose events arrive later.
    ///
    /// # Errors
    /// As [`Self::next`].
    pub fn recorded_events(&mut self) -> Result<Vec<Event>> {
        if self.is_live() { Ok(Vec::new()) } else { self.by_ref().collect() }
    }

    /// The number of events left to take, if it is known.
    pub fn remaining(&self) -> Option<u64> {
        let Events::Read(events) = &self.events else { return None };
        let rest = (events.len() as u64).saturating_sub(self.pass_over as u64);
        Some(rest.div_ceil(self.stride as u64))
    }

    fn next_recorded(&mut self) -> Option<Result<Event>> {
        loop {
            let next = match &mut self.events {
                Events::Read(events) => events.next().map(Ok),
                Events::Arriving { first, rest } => {
                    first.take().map(Ok).or_else(|| next(rest, &mut self.refusals))
                }
            };
            if let Some(Ok(event)) = &next
                && let Some((range, first_us)) = &mut self.range
                && !range.contains(event.t_us, *first_us.get_or_insert(event.t_us))
            {
                continue;
            }
            return next;
        }
    }
}

impl Iterator for Source {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.pass_over > 0 {
            self.pass_over -= 1;
            if let Err(error) = self.next_recorded()? {
                return Some(Err(error));
            }
        }
        self.pass_over = self.stride - 1;
        self.next_recorded()
    }
}

/// The next of `events`; skips other lines. `None` at the end, and on a signal.
///
/// # Errors
/// The error that ends the events, and the errors of [`LineErrors`].
fn next(
    events: &mut impl Iterator<Item = Result<Event, IoError>>,
    refusals: &mut LineErrors,
) -> Option<Result<Event>> {
    loop {
        let refused = match events.next() {
            None => refusals.end(),
            Some(Ok(event)) => {
                refusals.take();
                return Some(Ok(event));
            }
            Some(Err(_)) if interrupt::requested() => return None,
            Some(Err(error)) if error.is_about_a_line() => match refusals.refuse(chain(&error)) {
                Ok(()) => continue,
                refused => refused,
            },
            Some(Err(error)) => Err(RunError::recording(refusals.name(), error)),
        };
        return refused.err().map(Err);
    }
}

/// The recording of these events of a text, without those outside `range`.
fn text(sensor: Option<Sensor>, events: Vec<Event>, range: Option<TimeRange>) -> Recording {
    let mut recording = Recording::of_events(Format::Csv, sensor, events);
    range.inspect(|range| range.cut(&mut recording));
    recording
}
