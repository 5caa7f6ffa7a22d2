//! Records events into files of AEDAT4 as they arrive: one file, or one for each press.
//!
//! Input: a source, and a file or a folder. Output: files that grow by a packet every tenth of a
//! second, so that a killed program leaves all but the newest events, and in a folder a row for
//! each file in [`TABLE`]. A source does not wait for the disk unless two million events wait to be
//! written.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{panic, thread};

use meissner_engine::filters::{BackgroundActivity, Chain, EventFilter, Filter};
use meissner_engine::{Event, Sensor};
use meissner_io::Aedat4Writer;
use serde::Serialize;

use crate::error::{Result, RunError};
use crate::source::Source;

/// Longest time from the arrival of an event until it is written.
const PERIOD: Duration = Duration::from_millis(100);
/// Maximum number of events that wait to be written: 32 MiB.
const MAX_WAITING: usize = 1 << 21;
/// The table of the recordings in a folder.
pub const TABLE: &str = "recordings.csv";
const HEADER: &str = "recording,first_us,last_us,events,host_us\n";

/// How events are recorded.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordOptions {
    /// The silence that ends a press, in microseconds of the sensor's clock: each press has a file
    /// in a folder. `None`: one file.
    pub silence_us: Option<i64>,
    /// An event without a neighbouring event within this number of microseconds does not end a
    /// silence.
    pub activity_us: Option<i64>,
    /// Whether an existing file is replaced.
    pub replace: bool,
}

/// A recorded file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RecordedFile {
    /// Its name in its folder.
    pub recording: String,
    /// Least and greatest time of its events, in microseconds.
    pub first_us: i64,
    /// See `first_us`.
    pub last_us: i64,
    /// Number of its events.
    pub events: u64,
    /// Arrival of the first event, in microseconds of Unix time; `None`: it came from a file.
    pub host_us: Option<i64>,
}

/// Summary of a recording.
#[derive(Clone, Debug, Default, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct RecordSummary {
    pub recordings: Vec<RecordedFile>,
    pub events: u64,
    pub bytes: u64,
    /// Events outside the sensor, which are not recorded.
    pub outside_sensor: u64,
    /// Events in silences, which are not recorded.
    pub in_silence: u64,
    /// Recorded events that are earlier than a previous one.
    pub earlier: u64,
    pub lines_refused: u64,
    pub seconds: f64,
}

/// Progress of a recording; another thread may read it.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "the names say it")]
pub struct RecordProgress {
    pub events: AtomicU64,
    pub bytes: AtomicU64,
    pub files: AtomicU64,
}

/// Records `source` of `sensor` into `out` until its end, or until the program is asked to end;
/// calls `closed` with each completed file.
///
/// Events recorded before an error are kept: the files are complete.
///
/// # Errors
/// The source fails, `out` exists and is not to be replaced, or cannot be written.
pub fn record(
    mut source: Source,
    sensor: Sensor,
    out: &Path,
    options: RecordOptions,
    progress: &RecordProgress,
    closed: impl Fn(&RecordedFile) + Sync,
) -> (RecordSummary, Result<()>) {
    let (started, is_live) = (Instant::now(), source.is_live());
    let mut files = match Files::new(sensor, out, options, is_live, (progress, &closed)) {
        Ok(files) => files,
        Err(error) => return (RecordSummary::default(), Err(error)),
    };
    let waiting = Waiting::default();
    let (read, written) = thread::scope(|scope| {
        let writer = scope.spawn(|| {
            let written = files.run(&waiting);
            waiting.change(|state| state.failed = written.is_err());
            written
        });
        let read = source.by_ref().map_while(|event| waiting.push(event).transpose()).collect();
        waiting.change(|state| state.ended = true);
        (read, writer.join().unwrap_or_else(|panic| panic::resume_unwind(panic)))
    });
    let (lines_refused, seconds) = (source.lines_refused(), started.elapsed().as_secs_f64());
    (RecordSummary { lines_refused, seconds, ..files.summary }, written.and(read))
}

/// Events between the thread that reads and the thread that writes.
#[derive(Default)]
struct Waiting {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    events: Vec<Event>,
    /// Arrival time of the first of them.
    arrived: Option<SystemTime>,
    ended: bool,
    failed: bool,
}

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    /// Adds an event that was read; `None` if no events are written any more.
    fn push(&self, event: Result<Event>) -> Result<Option<()>> {
        let event = event?;
        let mut state = self.lock();
        while state.events.len() >= MAX_WAITING && !state.failed {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.failed {
            return Ok(None);
        }
        state.arrived.get_or_insert_with(SystemTime::now);
        state.events.push(event);
        Ok(Some(()))
    }

    /// Takes the input of one [`PERIOD`]: events, the arrival of the first one, and whether the
    /// input has ended.
    fn take(&self) -> (Vec<Event>, Option<SystemTime>, bool) {
        let until = Instant::now() + PERIOD;
        let mut state = self.lock();
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if state.ended || left.is_zero() || state.events.len() >= MAX_WAITING / 2 {
                break;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        let taken = (std::mem::take(&mut state.events), state.arrived.take(), state.ended);
        drop(state);
        self.changed.notify_all();
        taken
    }
}

/// Separates silences from presses.
struct Silence {
    us: i64,
    filter: Chain,
    /// The time of the newest event that is not noise.
    newest_us: Option<i64>,
}

/// The press that an event belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Belongs {
    /// A new press, which the event begins.
    New,
    /// The current press.
    Present,
    /// No press.
    None,
}

impl Silence {
    fn of(&mut self, event: Event) -> Belongs {
        let is_noise = !self.filter.admit(event);
        // A clock that restarts ends a press too.
        let is_near = self.newest_us.is_some_and(|newest| event.t_us.abs_diff(newest) <= self.us as u64);
        if !is_noise {
            let newest = self.newest_us.filter(|_| is_near).unwrap_or(event.t_us);
            self.newest_us = Some(newest.max(event.t_us));
        }
        match (is_near, is_noise) {
            (true, _) => Belongs::Present,
            (false, true) => Belongs::None,
            (false, false) => Belongs::New,
        }
    }
}

/// A file that is being written.
struct Open {
    path: PathBuf,
    /// The same file as the writer's.
    file: File,
    writer: Aedat4Writer<File>,
    recorded: RecordedFile,
}

impl Open {
    fn new(path: PathBuf, sensor: Sensor, replace: bool) -> Result<Self> {
        let failed = |source| RunError::file("create", &path, source);
        let mut how = OpenOptions::new();
        how.write(true).create(true).truncate(replace).create_new(!replace);
        let file = how.open(&path).map_err(failed)?;
        let writer = file.try_clone().and_then(|file| Aedat4Writer::new(file, sensor)).map_err(failed)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let recorded = RecordedFile { recording: name, ..RecordedFile::default() };
        Ok(Self { path, file, writer, recorded })
    }

    fn write(&mut self, events: &[Event]) -> Result<()> {
        let times = || events.iter().map(|event| event.t_us);
        let (Some(first_us), Some(last_us)) = (times().min(), times().max()) else { return Ok(()) };
        self.writer.write(events).map_err(|source| RunError::file("write", &self.path, source))?;
        let recorded = &mut self.recorded;
        let is_first = recorded.events == 0;
        recorded.first_us = if is_first { first_us } else { recorded.first_us.min(first_us) };
        recorded.last_us = if is_first { last_us } else { recorded.last_us.max(last_us) };
        recorded.events += events.len() as u64;
        Ok(())
    }

    /// Closes the file. An incomplete packet, which a full disk may leave, is removed first.
    fn close(mut self) -> Result<RecordedFile> {
        let length = self.writer.length();
        let closed = self.file.seek(SeekFrom::Start(length)).and_then(|_| self.file.set_len(length));
        let closed = closed.and_then(|()| self.writer.finish());
        if closed.is_err() {
            // The file is also complete without its table.
            let _ = self.file.set_len(length);
        }
        closed
            .and_then(|_| self.file.sync_all())
            .map_err(|source| RunError::file("write", self.path, source))?;
        Ok(self.recorded)
    }
}

/// The files of a recording.
struct Files<'a, F> {
    sensor: Sensor,
    out: &'a Path,
    options: RecordOptions,
    is_live: bool,
    progress: &'a RecordProgress,
    closed: &'a F,
    silence: Option<Silence>,
    open: Option<Open>,
    /// The number of the next file in a folder.
    number: u32,
    newest_us: i64,
    summary: RecordSummary,
}

impl<'a, F: Fn(&RecordedFile) + Sync> Files<'a, F> {
    fn new(
        sensor: Sensor,
        out: &'a Path,
        options: RecordOptions,
        is_live: bool,
        (progress, closed): (&'a RecordProgress, &'a F),
    ) -> Result<Self> {
        let (mut silence, mut open, mut number) = (None, None, 1);
        if let Some(us) = options.silence_us {
            let activity = options.activity_us.map(|us| BackgroundActivity::new(sensor, us));
            let filters = activity.transpose()?.map(Filter::BackgroundActivity);
            silence =
                Some(Silence { us, filter: Chain::new(filters.into_iter().collect()), newest_us: None });
            number = next_number(out).map_err(|source| RunError::file("create", out, source))?;
        } else {
            open = Some(Open::new(out.to_owned(), sensor, options.replace)?);
        }
        let (newest_us, summary) = (i64::MIN, RecordSummary::default());
        Ok(Self {
            sensor,
            out,
            options,
            is_live,
            progress,
            closed,
            silence,
            open,
            number,
            newest_us,
            summary,
        })
    }

    /// Writes the arriving events until the end.
    fn run(&mut self, waiting: &Waiting) -> Result<()> {
        let mut quiet_since = Instant::now();
        let written = loop {
            let (events, arrived, ended) = waiting.take();
            if !events.is_empty() {
                quiet_since = Instant::now();
                if let Err(error) = self.put(&events, arrived.filter(|_| self.is_live)) {
                    break Err(error);
                }
            }
            if ended {
                break Ok(());
            }
            let silence_us = self.options.silence_us.filter(|_| self.is_live);
            let silence = silence_us.map(|us| Duration::from_micros(us.unsigned_abs()) + PERIOD);
            if silence.is_some_and(|silence| quiet_since.elapsed() > silence)
                && let Err(error) = self.close()
            {
                break Err(error);
            }
        };
        written.and(self.close())
    }

    /// Writes events, the first of which arrived at this time.
    fn put(&mut self, events: &[Event], arrived: Option<SystemTime>) -> Result<()> {
        let mut mine = Vec::with_capacity(events.len());
        for &event in events {
            if !self.sensor.contains(event.x, event.y) {
                self.summary.outside_sensor += 1;
                continue;
            }
            match self.silence.as_mut().map_or(Belongs::Present, |silence| silence.of(event)) {
                Belongs::None => {
                    self.summary.in_silence += 1;
                    continue;
                }
                Belongs::Present if self.open.is_some() => {}
                _ => {
                    self.write(&mut mine)?;
                    self.close()?;
                    self.begin()?;
                }
            }
            if mine.is_empty()
                && let Some(open) = self.open.as_mut().filter(|open| open.recorded.events == 0)
            {
                let since = Duration::from_micros(event.t_us.saturating_sub(events[0].t_us).max(0) as u64);
                let unix = arrived.and_then(|at| (at + since).duration_since(UNIX_EPOCH).ok());
                open.recorded.host_us = unix.and_then(|unix| i64::try_from(unix.as_micros()).ok());
            }
            self.summary.earlier += u64::from(event.t_us < self.newest_us);
            self.newest_us = self.newest_us.max(event.t_us);
            mine.push(event);
        }
        self.write(&mut mine)
    }

    /// Writes `events` to the open file.
    fn write(&mut self, events: &mut Vec<Event>) -> Result<()> {
        if let Some(open) = &mut self.open {
            let before = open.writer.length();
            open.write(events)?;
            self.summary.events += events.len() as u64;
            self.summary.bytes += open.writer.length() - before;
            self.progress.events.store(self.summary.events, Ordering::Relaxed);
            self.progress.bytes.store(self.summary.bytes, Ordering::Relaxed);
        }
        events.clear();
        Ok(())
    }

    /// Opens the next file of the folder.
    fn begin(&mut self) -> Result<()> {
        let path = self.out.join(format!("press-{:04}.aedat4", self.number));
        self.open = Some(Open::new(path, self.sensor, false)?);
        (self.number, self.newest_us) = (self.number + 1, i64::MIN);
        Ok(())
    }

    /// Closes the open file, if there is one.
    fn close(&mut self) -> Result<()> {
        let Some(open) = self.open.take() else { return Ok(()) };
        let recorded = open.close()?;
        if self.silence.is_some() {
            let table = self.out.join(TABLE);
            append(&table, &recorded).map_err(|source| RunError::file("write", table, source))?;
        }
        self.progress.files.fetch_add(1, Ordering::Relaxed);
        (self.closed)(&recorded);
        self.summary.recordings.push(recorded);
        Ok(())
    }
}

/// The number of the next press in the folder `out`, which is created if it does not exist.
fn next_number(out: &Path) -> io::Result<u32> {
    fs::create_dir_all(out)?;
    let mut next = 1;
    for entry in fs::read_dir(out)? {
        let name = entry?.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix("press-")?.strip_suffix(".aedat4"));
        next = next.max(number.and_then(|number| number.parse::<u32>().ok()).map_or(1, |number| number + 1));
    }
    Ok(next)
}

/// Appends a row to the table at `path`.
fn append(path: &Path, recorded: &RecordedFile) -> io::Result<()> {
    let mut table = OpenOptions::new().append(true).create(true).open(path)?;
    let header = if table.metadata()?.len() == 0 { HEADER } else { "" };
    let RecordedFile { recording, first_us, last_us, events, host_us } = recorded;
    let host_us = host_us.map_or_else(String::new, |host_us| host_us.to_string());
    table.write_all(format!("{header}{recording},{first_us},{last_us},{events},{host_us}\n").as_bytes())
}
