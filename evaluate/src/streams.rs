//! Streams of events from a safetensors file.
//!
//! Enters: the bytes of a file. Leaves: streams of events that lie on the sensor, with times that
//! do not descend within a stream, and the truth about each stream along time where the file has
//! it. A file that breaks this is refused with the index of the first value that does.

use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_run::RunError;
use meissner_simulator::Cause;
use safetensors::SafeTensors;

use crate::error::{EvaluateError, StreamsError};
use crate::tensors::{bounds, integers, value};
use crate::truth::Truth;

/// Events, stream after stream.
pub struct Streams {
    pub(crate) sensor: Sensor,
    events: Vec<Event>,
    /// Index of the first event of each stream, and the number of events.
    start: Vec<usize>,
    /// Labels along time; `None` where the file has none.
    pub(crate) truth: Option<Truth>,
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
    /// The streams in the safetensors file at `path`, as `meissner simulate markers` writes them.
    /// All are held in memory.
    ///
    /// # Errors
    /// The file cannot be read or does not fit.
    pub fn read(path: &Path) -> Result<Self, EvaluateError> {
        Self::parsed(path, Self::from_bytes)
    }

    /// The streams in the file at `path`, and the cause of each event as
    /// [`crate::prepare::film_markers`] writes it.
    pub(crate) fn with_causes(path: &Path) -> Result<(Self, Vec<Cause>), EvaluateError> {
        Self::parsed(path, |bytes| {
            let streams = Self::from_bytes(bytes)?;
            let causes = integers(&SafeTensors::deserialize(bytes)?, "cause", Some(streams.events.len()))?;
            let causes = causes.iter().enumerate().map(of_number).collect::<Result<_, _>>()?;
            Ok((streams, causes))
        })
    }

    fn parsed<T>(path: &Path, parse: impl Fn(&[u8]) -> Result<T, StreamsError>) -> Result<T, EvaluateError> {
        let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
        parse(&bytes).map_err(|source| EvaluateError::Streams { path: path.to_owned(), source })
    }

    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, StreamsError> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let file = SafeTensors::deserialize(bytes)?;
        let sensor = header.metadata().as_ref().and_then(|metadata| metadata.get("sensor"));
        let sensor = sensor.map_or("nothing", String::as_str);
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
        let streams = Self { sensor, events, start, truth };
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
        self.start.windows(2).map(|bounds| &self.events[bounds[0]..bounds[1]]).collect()
    }

    /// Where each stream ends.
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

#[cfg(test)]
mod tests {
    use meissner_models::TensorFile;

    use super::Streams;

    /// Two streams of two events each.
    fn file() -> Vec<u8> {
        let mut file = TensorFile::new([("sensor".to_owned(), "[8, 6]".to_owned())].into());
        for (name, values) in
            [("t_us", [5, 9, -7, -7]), ("x", [0, 7, 1, 2]), ("y", [5, 0, 3, 3]), ("on", [0, 1, 1, 0])]
        {
            file.i64(name, &[4], &values);
        }
        file.i64("start", &[3], &[0, 2, 4]);
        file.into_bytes()
    }

    /// Reads `bytes`; what is accepted lies on its sensor, what is refused says why in brief.
    fn check(bytes: &[u8]) -> bool {
        match Streams::from_bytes(bytes) {
            Ok(streams) => {
                let events: Vec<_> = streams.parts().concat();
                assert!(events.iter().all(|event| streams.sensor.contains(event.x, event.y)));
                assert_eq!(streams.ends().last(), Some(events.len()).filter(|_| streams.start.len() > 1));
                true
            }
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("expected") && text.len() < 500, "{text:.600}");
                false
            }
        }
    }

    #[test]
    fn a_file_of_streams_that_was_cut_flipped_or_made_up_anywhere_is_read_or_refused() {
        let whole = file();
        assert!(check(&whole));
        (0..whole.len()).for_each(|length| assert!(!check(&whole[..length]), "cut at {length}"));
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            check(&flipped);
        }
        for at in 0..=whole.len() - 8 {
            for length in [1_u64 << 63, u64::MAX, u64::from(u32::MAX), 0] {
                let mut wrong = whole.clone();
                wrong[at..at + 8].copy_from_slice(&length.to_le_bytes());
                check(&wrong);
            }
        }
    }
}
