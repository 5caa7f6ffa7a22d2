//! Recordings: reads files to structured arrays.

use std::num::NonZeroU16;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use meissner::io::{
    self, Chip, ColumnOrder, Format, LeftOut, ReadOptions, Salvage, StreamSummary, TextOptions, TimeRange,
    TimeUnit, UnknownName,
};
use meissner::{Event, Sensor};
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};

use crate::arrays::{sides, to_array};
use crate::error::{Failure, Outcome};
use crate::methods::html_table;
use crate::threads::turn;

/// Number of events of a block of an iteration.
const BLOCK: usize = 1 << 16;

/// A recording of events in a file. The file is read on the first request, and the events are then
/// kept: 16 bytes per event. Iteration, `blocks`, `windows`, `between`, `sensor` and `format` read
/// a DAT, EVT2, npy, AEDAT 2.0, 3.1 or 4 file part by part, and keep no part.
///
/// Iteration gives structured arrays of at most 65,536 events with the fields t (microseconds), x,
/// y, p. `len()` is the number of events; `recording[i:j]` and `recording.between(a, b)` give a
/// part of them.
#[pyclass(module = "meissner", name = "Recording", frozen, weakref)]
pub(crate) struct Recording {
    path: PathBuf,
    options: ReadOptions,
    content: Mutex<Option<Arc<Content>>>,
}

struct Content {
    /// The recording without its events.
    read: io::Recording,
    events: Arc<Vec<Event>>,
    /// Whether no time is earlier than the one before.
    ascending: bool,
}

impl Recording {
    fn content(&self) -> Outcome<Arc<Content>> {
        let content: Result<_, io::IoError> = Python::attach(|py| {
            // The lock is taken without the interpreter lock, so that no thread waits for both.
            py.detach(|| {
                let mut content = self.content.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(content) = &*content {
                    return Ok(Arc::clone(content));
                }
                let mut read = io::read_with(&self.path, self.options)?;
                let events = Arc::new(std::mem::take(&mut read.events));
                let ascending = events.is_sorted_by_key(|event| event.t_us);
                let read = Arc::new(Content { read, events, ascending });
                *content = Some(Arc::clone(&read));
                Ok(read)
            })
        });
        Ok(content?)
    }

    /// The times of a part that is read only from the file; `None` for all events, or if the events
    /// are already read.
    fn range(&self, start_us: Option<i64>, end_us: Option<i64>) -> Option<TimeRange> {
        let times = match (start_us, end_us) {
            (None, None) => return None,
            (start, end) => start.unwrap_or(i64::MIN)..end.unwrap_or(i64::MAX),
        };
        self.is_in_file().then(|| TimeRange::of_file(times))
    }

    /// Whether the file was not read yet. A thread that holds the lock is reading its events.
    fn is_in_file(&self) -> bool {
        self.content.try_lock().is_ok_and(|content| content.is_none())
    }

    /// The blocks of a file that was not read yet, if its format has blocks.
    fn file_blocks(&self, py: Python<'_>) -> Outcome<Option<io::Blocks>> {
        Ok(if self.is_in_file() { py.detach(|| io::blocks(&self.path, self.options))? } else { None })
    }

    fn feed(&self, py: Python<'_>) -> Outcome<Feed> {
        let file = self.file_blocks(py)?;
        let events = if file.is_some() { Arc::default() } else { self.events()? };
        Ok(Feed { events, next: 0, file: file.map(Mutex::new) })
    }

    /// Format and sensor, from the beginning of the file if that is enough.
    fn head(&self, py: Python<'_>) -> Outcome<(Format, Option<Sensor>)> {
        let first = self.file_blocks(py)?.and_then(|mut blocks| py.detach(|| blocks.next())).transpose()?;
        if let Some(first) = first {
            return Ok((first.format, first.sensor));
        }
        let content = self.content()?;
        Ok((content.read.format, content.read.sensor))
    }

    /// The events, shared.
    pub(crate) fn events(&self) -> Outcome<Arc<Vec<Event>>> {
        Ok(Arc::clone(&self.content()?.events))
    }
}

/// A word of an option, if there is one.
pub(crate) fn word<T: std::str::FromStr<Err = UnknownName>>(word: Option<&str>) -> Outcome<Option<T>> {
    let parsed = word.map(str::parse).transpose();
    parsed.map_err(|error: UnknownName| Failure::input(error.to_string()))
}

/// Opens a recording of events: AEDAT 2.0, 3.1 and 4, EVT2, EVT2.1, EVT3, DAT, Event Stream,
/// N-MNIST, MCAP, text, NumPy, or HDF5 of DSEC and Prophesee; also inside gzip or zip.
///
/// - `format`: "aedat4", "aedat3", "aedat2", "evt2", "evt3", "dat", "es", "nmnist", "csv", "npy",
///   "hdf5" or "mcap", instead of the format that the content shows.
/// - `columns`, `time_unit`: the columns of a text, such as "txyp"; "s", "ms", "us" or "ns".
/// - `salvage`: read a file that was cut short up to the cut.
/// - `strict`: refuse items that are otherwise left out (`Recording.left_out`): lines of a text
///   without an event, events outside the sensor, words without events, events before the first
///   time.
/// - `sensor`: (width, height), if the file names none, or if its chip (AEDAT 2.0) is unknown.
/// - `chip`: the chip of AEDAT 2.0, such as "DAVIS346", instead of the chip that the file names.
/// - `stream`: number of the stream of events of AEDAT 3.1 and 4 that is read, from 1.
///
/// Raises `FileError`, and `RecordingError` with the place of a fault when the content is read.
#[pyfunction]
#[pyo3(signature = (path, *, format=None, columns=None, time_unit=None, salvage=false, strict=false, sensor=None, chip=None, stream=None))]
#[expect(clippy::too_many_arguments, reason = "options with defaults")]
pub(crate) fn open(
    path: PathBuf,
    format: Option<&str>,
    columns: Option<&str>,
    time_unit: Option<&str>,
    salvage: bool,
    strict: bool,
    sensor: Option<(u16, u16)>,
    chip: Option<&str>,
    stream: Option<u16>,
) -> Outcome<Recording> {
    if let Err(error) = std::fs::metadata(&path) {
        return Err(Failure::Refused("FileError", format!("cannot read {}: {error}", path.display())));
    }
    let (columns, unit) = (word::<ColumnOrder>(columns)?, word::<TimeUnit>(time_unit)?);
    let text = TextOptions::default().columns(columns).time_unit(unit);
    let sensor = sensor.map(|(width, height)| Sensor::new(width, height));
    let stream = stream.map(|number| NonZeroU16::new(number).ok_or(number)).transpose();
    let stream =
        stream.map_err(|found| Failure::input(format!("stream: expected 1 and above, found {found}")))?;
    let options = ReadOptions::default().format(word::<Format>(format)?).text(text).salvage(salvage);
    let options = options.strict(strict).sensor(sensor).chip(word::<Chip>(chip)?).stream(stream);
    Ok(Recording { path, options, content: Mutex::new(None) })
}

#[pymethods]
impl Recording {
    /// The path of the file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    /// Name of the format.
    #[getter]
    fn format(&self, py: Python<'_>) -> Outcome<String> {
        Ok(self.head(py)?.0.to_string())
    }

    /// (width, height) of the sensor, or the one of `open` if the file names none; or None.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> Outcome<Option<(u16, u16)>> {
        Ok(self.head(py)?.1.or(self.options.sensor).map(sides))
    }

    /// Times of the first and of the last event in microseconds; None without events.
    #[getter]
    fn times_us(&self) -> Outcome<Option<(i64, i64)>> {
        let content = self.content()?;
        Ok(content.events.first().zip(content.events.last()).map(|(first, last)| (first.t_us, last.t_us)))
    }

    /// Whether no event is earlier than the one before.
    #[getter]
    fn is_ordered(&self) -> Outcome<bool> {
        Ok(self.content()?.ascending)
    }

    /// The other streams of the file, which are not read: (name, kind, elements).
    #[getter]
    fn other_streams(&self) -> Outcome<Vec<(String, String, u64)>> {
        let content = self.content()?;
        let of = |stream: &StreamSummary| (stream.name.clone(), stream.kind.to_string(), stream.elements);
        Ok(content.read.other_streams.iter().map(of).collect())
    }

    /// With `salvage`: the part that the end of the file lacks, and the bytes not read; None if the
    /// file is complete.
    #[getter]
    fn salvaged(&self) -> Outcome<Option<(String, u64)>> {
        let content = self.content()?;
        let of =
            |salvage: &Salvage| (format!("{} at {}", salvage.what, salvage.place), salvage.bytes_not_read);
        Ok(content.read.salvaged.as_ref().map(of))
    }

    /// Items that were left out because they are not events of the sensor: (kind, count, the first
    /// with its location). Kinds are "outside_sensor", "other_words", "other_events", "malformed"
    /// and "lines".
    #[getter]
    fn left_out(&self) -> Outcome<Vec<(&'static str, u64, String)>> {
        let content = self.content()?;
        let of = |left_out: &LeftOut| {
            (left_out.kind.name(), left_out.count, left_out.first.first().cloned().unwrap_or_default())
        };
        Ok(content.read.left_out.iter().map(of).collect())
    }

    /// Facts that the file does not state and that the reader assumed, as sentences.
    #[getter]
    fn assumed(&self) -> Outcome<Vec<&'static str>> {
        Ok(self.content()?.read.assumed.clone())
    }

    /// All events as one structured array.
    fn read<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        Ok(to_array(py, &self.content()?.events)?)
    }

    /// Events with start_us <= t < end_us as one structured array; None leaves a side open.
    ///
    /// If the file was not read yet, only this part is read: for DAT, EVT2, npy, AEDAT 2.0, 3.1 and
    /// 4 by a search in the file, which allows times that step back by at most 1 s. Afterwards it
    /// is O(log events) if times are in order, O(events) otherwise.
    #[pyo3(signature = (start_us=None, end_us=None))]
    fn between<'py>(
        &self,
        py: Python<'py>,
        start_us: Option<i64>,
        end_us: Option<i64>,
    ) -> Outcome<Bound<'py, PyAny>> {
        if let Some(range) = self.range(start_us, end_us)
            && let Some(part) = py.detach(|| io::read_range(&self.path, self.options, range))?
        {
            return Ok(to_array(py, &part.events)?);
        }
        let content = self.content()?;
        let before = |t: i64| end_us.is_none_or(|end| t < end);
        let from = |t: i64| start_us.is_none_or(|start| t >= start);
        if !content.ascending {
            let events =
                content.events.iter().copied().filter(|event| from(event.t_us) && before(event.t_us));
            return Ok(to_array(py, &events.collect::<Vec<_>>())?);
        }
        let first = content.events.partition_point(|event| !from(event.t_us));
        let last = content.events.partition_point(|event| before(event.t_us));
        Ok(to_array(py, content.events.get(first..last).unwrap_or_default())?)
    }

    /// Structured arrays of `size` events each, the last one shorter.
    #[pyo3(signature = (size=BLOCK))]
    fn blocks(&self, py: Python<'_>, size: usize) -> Outcome<Blocks> {
        if size == 0 {
            return Err(Failure::input("size: expected at least 1 event, found 0"));
        }
        Ok(Blocks { feed: self.feed(py)?, size })
    }

    /// Pairs (t_us, events) every `period_us`: the events since the previous pair, up to and
    /// including t_us. The first pair ends `period_us` after the first event, the last at or after
    /// the last event.
    fn windows(&self, py: Python<'_>, period_us: i64) -> Outcome<Windows> {
        if period_us < 1 {
            return Err(Failure::input(format!("period_us: expected at least 1 us, found {period_us}")));
        }
        let mut feed = self.feed(py)?;
        let due_us = feed.rest(py)?.first().map_or(0, |event| event.t_us.saturating_add(period_us));
        Ok(Windows { feed, due_us, period_us })
    }

    fn __len__(&self) -> Outcome<usize> {
        Ok(self.content()?.events.len())
    }

    #[expect(clippy::unused_self, reason = "the protocol of Python")]
    fn __bool__(&self) -> bool {
        true
    }

    fn __iter__(&self, py: Python<'_>) -> Outcome<Blocks> {
        self.blocks(py, BLOCK)
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
        let content = self.content()?;
        let length = content.events.len();
        if let Ok(slice) = index.cast::<PySlice>() {
            let indices = slice.indices(length as isize)?;
            if indices.step == 1 {
                let (start, stop) = (indices.start as usize, indices.stop.max(indices.start) as usize);
                return Ok(to_array(py, &content.events[start..stop])?);
            }
            let at = |i: usize| content.events[(indices.start + i as isize * indices.step) as usize];
            let events: Vec<Event> = (0..indices.slicelength).map(at).collect();
            return Ok(to_array(py, &events)?);
        }
        let at: isize =
            index.extract().map_err(|_| PyTypeError::new_err("recording: expected an index or a slice"))?;
        let place = if at < 0 { at + length as isize } else { at };
        let event = usize::try_from(place).ok().and_then(|place| content.events.get(place));
        let event = event.ok_or_else(|| {
            PyIndexError::new_err(format!("recording: expected an index below {length}, found {at}"))
        })?;
        Ok(to_array(py, &[*event])?.get_item(0)?)
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let _ = copy;
        let events = self.read(py)?;
        Ok(match dtype {
            Some(dtype) => {
                let arguments = PyDict::new(py);
                arguments.set_item("copy", false)?;
                events.call_method("astype", (dtype,), Some(&arguments))?
            }
            None => events,
        })
    }

    fn _repr_html_(&self) -> String {
        let content = self.content.lock().unwrap_or_else(PoisonError::into_inner);
        let title = format!("Recording {}", self.path.display());
        let Some(content) = &*content else {
            return html_table(&title, &[["events", "not read yet"].map(str::to_owned)]);
        };
        let mut rows = vec![
            ["format".to_owned(), content.read.format.to_string()],
            ["events".to_owned(), content.events.len().to_string()],
        ];
        rows.extend(content.read.sensor.map(|sensor| ["sensor".to_owned(), sensor.to_string()]));
        if let (Some(first), Some(last)) = (content.events.first(), content.events.last()) {
            rows.push(["time".to_owned(), format!("{} to {} us", first.t_us, last.t_us)]);
        }
        html_table(&title, &rows)
    }

    fn __repr__(&self) -> String {
        let content = self.content.lock().unwrap_or_else(PoisonError::into_inner);
        let path = self.path.display();
        match &*content {
            None => format!("<Recording {path}: not read yet>"),
            Some(content) => {
                let (format, events) = (content.read.format, content.events.len());
                let sensor = content.read.sensor.map(|sensor| format!(" on {sensor}")).unwrap_or_default();
                format!("<Recording {path}: {format}, {events} events{sensor}>")
            }
        }
    }
}

/// The events of a recording in the file's order: from memory, or block by block from the file.
struct Feed {
    events: Arc<Vec<Event>>,
    next: usize,
    file: Option<Mutex<io::Blocks>>,
}

impl Feed {
    /// The available events that were not taken yet; none at the end.
    fn rest(&mut self, py: Python<'_>) -> Outcome<&[Event]> {
        while self.next == self.events.len() {
            let Some(file) = &mut self.file else { break };
            let file = file.get_mut().unwrap_or_else(PoisonError::into_inner);
            let Some(block) = py.detach(|| file.next()).transpose()? else { break };
            (self.events, self.next) = (Arc::new(block.events), 0);
        }
        Ok(&self.events[self.next..])
    }

    /// Takes at most `most` events while `admits` is true.
    fn take(&mut self, py: Python<'_>, most: usize, admits: impl Fn(&Event) -> bool) -> Outcome<Vec<Event>> {
        let mut taken = Vec::new();
        loop {
            let rest = self.rest(py)?;
            let most = rest.len().min(most - taken.len());
            let count = rest[..most].iter().take_while(|event| admits(event)).count();
            taken.extend_from_slice(&rest[..count]);
            let is_through = count < most || most == 0;
            self.next += count;
            if is_through {
                return Ok(taken);
            }
        }
    }
}

/// The blocks of a recording.
#[pyclass(module = "meissner")]
pub(crate) struct Blocks {
    feed: Feed,
    size: usize,
}

#[pymethods]
impl Blocks {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Option<Bound<'py, PyAny>>> {
        let mut this = turn(slf)?;
        let Self { feed, size } = &mut *this;
        let block = feed.take(py, *size, |_| true)?;
        Ok(if block.is_empty() { None } else { Some(to_array(py, &block)?) })
    }
}

/// The windows of a recording.
#[pyclass(module = "meissner")]
pub(crate) struct Windows {
    feed: Feed,
    due_us: i64,
    period_us: i64,
}

#[pymethods]
impl Windows {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Option<(i64, Bound<'py, PyAny>)>> {
        let mut this = turn(slf)?;
        if this.feed.rest(py)?.is_empty() {
            return Ok(None);
        }
        let due_us = this.due_us;
        let window = this.feed.take(py, usize::MAX, |event| event.t_us <= due_us)?;
        this.due_us = due_us.saturating_add(this.period_us);
        Ok(Some((due_us, to_array(py, &window)?)))
    }
}
