//! Streams of events from a safetensors file, with labels along time.
//!
//! Input: the bytes of a file. Output: streams of events that lie on the sensor, with times that
//! do not descend within a stream, and the `Truth` about each stream where the file has it. A file
//! that breaks these rules is refused with the index of the first wrong value.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_models::TensorFile;
use meissner_run::RunError;
use meissner_simulator::Cause;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::error::{EvaluateError, Result, StreamsError};

/// Events, stream after stream.
#[derive(Clone, Debug)]
pub struct Streams {
    pub(crate) sensor: Sensor,
    events: Vec<Event>,
    /// Index of the first event of each stream, and the number of events.
    start: Vec<usize>,
    /// Labels along time; `None` where the file has none.
    pub(crate) truth: Option<Truth>,
    /// The unit of each label that has one.
    pub(crate) units: BTreeMap<String, String>,
}

/// Labels of a stream along time.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels<'a> {
    /// Times in microseconds, ascending.
    pub t_us: &'a [i64],
    /// The name of each label, and its values at these times.
    pub values: Vec<(&'a str, &'a [f32])>,
}

impl Streams {
    /// The streams in a safetensors file of `meissner simulate markers`, all in memory.
    ///
    /// # Errors
    /// The file cannot be read or does not fit.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parsed(path, Self::from_bytes)
    }

    /// The streams in the file at `path`, and the cause of each event as
    /// [`crate::prepare::film_markers`] writes it.
    pub(crate) fn with_causes(path: &Path) -> Result<(Self, Vec<Cause>)> {
        Self::parsed(path, |bytes| {
            let streams = Self::from_bytes(bytes)?;
            let causes = integers(&SafeTensors::deserialize(bytes)?, "cause", Some(streams.events.len()))?;
            let causes = causes.iter().enumerate().map(of_number).collect::<Result<_, _>>()?;
            Ok((streams, causes))
        })
    }

    pub(crate) fn parsed<T>(path: &Path, parse: impl Fn(&[u8]) -> Result<T, StreamsError>) -> Result<T> {
        let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
        parse(&bytes).map_err(|source| EvaluateError::Streams { path: path.to_owned(), source })
    }

    /// The streams in the bytes of such a file.
    ///
    /// # Errors
    /// They do not fit.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StreamsError> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let file = SafeTensors::deserialize(bytes)?;
        let metadata = |key| header.metadata().as_ref()?.get(key).map(String::as_str);
        let units = metadata("units").unwrap_or("{}");
        let units = serde_json::from_str(units).map_err(|_| StreamsError::Units(units.to_owned()))?;
        let sensor = metadata("sensor").unwrap_or("nothing");
        let [width, height] = match serde_json::from_str::<[u16; 2]>(sensor) {
            Ok([width, height]) if width > 0 && height > 0 => [width, height],
            _ => return Err(StreamsError::Sensor(sensor.to_owned())),
        };
        let sensor = Sensor::new(width, height);
        let t_us = integers(&file, "t_us", None)?;
        let column = |name| integers(&file, name, Some(t_us.len()));
        let (x, y, on) = (column("x")?, column("y")?, column("on")?);
        let mut events = Vec::with_capacity(t_us.len());
        for (i, (((&t, &x), &y), &on)) in t_us.iter().zip(&x).zip(&y).zip(&on).enumerate() {
            let pixel = (u16::try_from(x), u16::try_from(y));
            match pixel {
                (Ok(x), Ok(y)) if sensor.contains(x, y) => events.push(Event::new(t, x, y, on != 0)),
                _ => return Err(value("event", i, format!("a pixel of {sensor}"), format!("({x}, {y})"))),
            }
        }
        let start = integers(&file, "start", None)?;
        let start = bounds(&start, events.len())?;
        let truth = Truth::of_events(&file, start.len().saturating_sub(1))?;
        let streams = Self { sensor, events, start, truth, units };
        streams.check_times()?;
        Ok(streams)
    }

    /// Neighbourhoods need times in order, and differences that fit.
    fn check_times(&self) -> Result<(), StreamsError> {
        for (part, &start) in self.parts().iter().zip(&self.start) {
            let epoch = part.first().map_or(0, |event| event.t_us);
            for (i, pair) in part.windows(2).enumerate() {
                if pair[1].t_us < pair[0].t_us || pair[1].t_us.checked_sub(epoch).is_none() {
                    let expected = format!("a time from {} to 2^63 behind the stream's first", pair[0].t_us);
                    return Err(value("event", start + i + 1, expected, pair[1].t_us.to_string()));
                }
            }
        }
        Ok(())
    }

    /// The sensor of all streams.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// The labels of a stream along time; `None` where the file has none.
    ///
    /// # Panics
    /// Where there is no such stream.
    pub fn labels(&self, stream: usize) -> Option<Labels<'_>> {
        let (t_us, values) = self.truth.as_ref()?.of(stream);
        Some(Labels { t_us, values: values.collect() })
    }

    /// The events of each stream.
    pub fn parts(&self) -> Vec<&[Event]> {
        (1..self.start.len()).map(|next| self.part(next - 1)).collect()
    }

    /// The events of a stream.
    ///
    /// # Panics
    /// Where there is no such stream.
    pub fn part(&self, stream: usize) -> &[Event] {
        &self.events[self.start[stream]..self.start[stream + 1]]
    }

    /// Contact and end of a stream with labels, see [`Truth::contact_and_end_us`]; else the times
    /// of its first and last event, or 0.
    pub(crate) fn span_us(&self, stream: usize) -> [i64; 2] {
        if let Some(truth) = &self.truth {
            return truth.contact_and_end_us(stream);
        }
        let events = self.parts()[stream];
        [events.first(), events.last()].map(|event| event.map_or(0, |event| event.t_us))
    }

    pub(crate) fn ends(&self) -> impl Iterator<Item = usize> {
        self.start.iter().skip(1).copied()
    }
}

/// The cause of event `i`, whose number is `cause`.
fn of_number((i, &cause): (usize, &i64)) -> Result<Cause, StreamsError> {
    let known = usize::try_from(cause).ok().and_then(|cause| Cause::ALL.get(cause));
    known
        .copied()
        .ok_or_else(|| value("cause", i, format!("0 to {}", Cause::ALL.len() - 1), cause.to_string()))
}

/// The label whose rise is contact.
const DEPTH: &str = "depth";
/// Beginning of the names of labels in a file of events.
const PREFIX: &str = "truth.";
const START: &str = "truth.start";
const TIMES: &str = "truth.t_us";

/// Labels of streams along time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Truth {
    /// Index of the first time of each stream, and the number of times.
    start: Vec<usize>,
    t_us: Vec<i64>,
    /// The values of each label at all times.
    labels: BTreeMap<String, Vec<f32>>,
}

impl Truth {
    /// The labels of tracks: every F32 tensor of shape (times). `None` without any.
    pub(crate) fn of_tracks(
        file: &SafeTensors<'_>,
        start: Vec<usize>,
        t_us: Vec<i64>,
    ) -> Result<Option<Self>, StreamsError> {
        Self::new(file, "", start, t_us)
    }

    /// The labels of `streams` streams in a file of events; `None` without any.
    pub(crate) fn of_events(file: &SafeTensors<'_>, streams: usize) -> Result<Option<Self>, StreamsError> {
        if !file.names().iter().any(|name| name.starts_with(PREFIX)) {
            return Ok(None);
        }
        let t_us = integers(file, TIMES, None)?;
        let start = integers(file, START, Some(streams + 1))?;
        let start = bounds(&start, t_us.len()).map_err(|error| match error {
            StreamsError::Value { index, expected, found, .. } => value(START, index, expected, found),
            error => error,
        })?;
        Self::new(file, PREFIX, start, t_us)
    }

    fn new(
        file: &SafeTensors<'_>,
        prefix: &str,
        start: Vec<usize>,
        t_us: Vec<i64>,
    ) -> Result<Option<Self>, StreamsError> {
        let (start_name, times_name) = (format!("{prefix}start"), format!("{prefix}t_us"));
        let mut labels = BTreeMap::new();
        for (tensor, view) in file.iter() {
            let Some(name) = tensor.strip_prefix(prefix) else { continue };
            if view.dtype() != Dtype::F32 || view.shape() != [t_us.len()] {
                continue;
            }
            let values = floats(view.data());
            if let Some(i) = values.iter().position(|value| !value.is_finite()) {
                return Err(value(tensor, i, "a finite number".to_owned(), values[i].to_string()));
            }
            labels.insert(name.to_owned(), values);
        }
        for range in start.windows(2) {
            if range[0] == range[1] {
                return Err(value(
                    &start_name,
                    range[0],
                    "a time for each stream".to_owned(),
                    "none".to_owned(),
                ));
            }
            let times = range[0] + 1..range[1];
            if let Some(i) = times.clone().find(|&i| t_us[i] <= t_us[i - 1]) {
                let expected = format!("a time above {}", t_us[i - 1]);
                return Err(value(&times_name, i, expected, t_us[i].to_string()));
            }
        }
        Ok((!labels.is_empty()).then_some(Self { start, t_us, labels }))
    }

    /// Labels of streams: for each, its times and the values of `names` at each of them.
    ///
    /// # Panics
    /// Where a stream has no time.
    pub(crate) fn of_streams(names: &[&str], streams: &[Vec<(i64, impl AsRef<[f32]>)>]) -> Self {
        assert!(streams.iter().all(|stream| !stream.is_empty()), "a time for each stream");
        let mut start = vec![0];
        start.extend(streams.iter().scan(0, |end, stream| {
            *end += stream.len();
            Some(*end)
        }));
        let values = |i: usize| streams.iter().flatten().map(|(_, values)| values.as_ref()[i]).collect();
        Self {
            start,
            t_us: streams.iter().flatten().map(|(t_us, _)| *t_us).collect(),
            labels: names.iter().enumerate().map(|(i, name)| ((*name).to_owned(), values(i))).collect(),
        }
    }

    pub(crate) fn write(&self, file: &mut TensorFile) {
        let start: Vec<i64> = self.start.iter().map(|&start| start as i64).collect();
        file.i64(START, &[start.len()], &start);
        file.i64(TIMES, &[self.t_us.len()], &self.t_us);
        for (name, values) in &self.labels {
            file.f32(&format!("{PREFIX}{name}"), &[values.len()], values);
        }
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.labels.keys().map(String::as_str)
    }

    /// The times of `stream`, and the name and the values at these times of each label.
    pub(crate) fn of(&self, stream: usize) -> (&[i64], impl Iterator<Item = (&str, &[f32])>) {
        let times = self.times(stream);
        let t_us = &self.t_us[times.clone()];
        (t_us, self.labels.iter().map(move |(name, values)| (name.as_str(), &values[times.clone()])))
    }

    pub(crate) fn span_us(&self, stream: usize) -> [i64; 2] {
        let times = self.times(stream);
        [self.t_us[times.start], self.t_us[times.end - 1]]
    }

    /// Time at which the depth of `stream` leaves 0, or else its first time; and its last time.
    pub(crate) fn contact_and_end_us(&self, stream: usize) -> [i64; 2] {
        let [start, end] = self.span_us(stream);
        [self.rises_us(DEPTH, stream).unwrap_or(start), end]
    }

    /// Time at which the label `name` of `stream` leaves 0, if it ever rises.
    pub(crate) fn rises_us(&self, name: &str, stream: usize) -> Option<i64> {
        let (values, times) = (self.labels.get(name)?, self.times(stream));
        let first = times.clone().find(|&i| values[i] > 0.0)?;
        Some(self.t_us[first.saturating_sub(1).max(times.start)])
    }

    /// The label `name` of `stream` at `t_us`, if there is one. O(log times).
    pub(crate) fn at(&self, name: &str, stream: usize, t_us: i64) -> Option<f64> {
        let (values, times) = (self.labels.get(name)?, self.times(stream));
        let after = times.start + self.t_us[times.clone()].partition_point(|&time| time <= t_us);
        let value = |i: usize| f64::from(values[i]);
        if after == times.start {
            return Some(value(after));
        }
        if after == times.end {
            return Some(value(after - 1));
        }
        let (from, to) = (self.t_us[after - 1], self.t_us[after]);
        let share = t_us.abs_diff(from) as f64 / to.abs_diff(from) as f64;
        Some(value(after - 1) + share * (value(after) - value(after - 1)))
    }

    fn times(&self, stream: usize) -> Range<usize> {
        self.start[stream]..self.start[stream + 1]
    }
}

pub(crate) fn value(list: &str, index: usize, expected: String, found: String) -> StreamsError {
    StreamsError::Value { list: list.to_owned(), index, expected, found }
}

/// Bounds of streams among `count` events or times.
pub(crate) fn bounds(start: &[i64], count: usize) -> Result<Vec<usize>, StreamsError> {
    let mut bounds = Vec::with_capacity(start.len());
    let mut least = 0;
    for (i, &at) in start.iter().enumerate() {
        let most = if i == 0 { 0 } else { count };
        let least_here = if i + 1 == start.len() { count } else { least };
        match usize::try_from(at) {
            Ok(at) if (least_here..=most).contains(&at) => {
                bounds.push(at);
                least = at;
            }
            _ => return Err(value("start", i, format!("{least_here} to {most}"), at.to_string())),
        }
    }
    Ok(bounds)
}

/// The values of a vector of I64, `count` of them where that is known.
pub(crate) fn integers(
    file: &SafeTensors<'_>,
    name: &str,
    count: Option<usize>,
) -> Result<Vec<i64>, StreamsError> {
    let expected = count.map_or_else(|| "I64 (any number)".to_owned(), |count| format!("I64 ({count})"));
    let view = tensor(file, name, Dtype::I64, &expected)?;
    if view.shape().len() != 1 || count.is_some_and(|count| view.shape() != [count]) {
        return Err(wrong(name, &expected, &view));
    }
    Ok(view.data().as_chunks().0.iter().map(|&bytes| i64::from_le_bytes(bytes)).collect())
}

/// The tensor called `name`, of this type.
pub(crate) fn tensor<'a>(
    file: &SafeTensors<'a>,
    name: &str,
    dtype: Dtype,
    expected: &str,
) -> Result<TensorView<'a>, StreamsError> {
    let found = "nothing".to_owned();
    let missing = |_| StreamsError::Tensor { tensor: name.to_owned(), expected: expected.to_owned(), found };
    let view = file.tensor(name).map_err(missing)?;
    if view.dtype() == dtype { Ok(view) } else { Err(wrong(name, expected, &view)) }
}

/// A tensor that is not as `expected`.
pub(crate) fn wrong(name: &str, expected: &str, found: &TensorView<'_>) -> StreamsError {
    let found = format!("{:?} {:?}", found.dtype(), found.shape());
    StreamsError::Tensor { tensor: name.to_owned(), expected: expected.to_owned(), found }
}

pub(crate) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}
