//! Presses that people recorded and labelled themselves: a folder of recordings, and a table.
//!
//! Input: a folder with one press per recording, and `labels.csv` in it ([`LabelTable`] describes
//! its forms). The table has either a row for each labelled instant of a recording, or the poses of
//! a robot along time, over all recordings. Output: [`Presses`] with the labels of each press on
//! the clock of its events, and a list of oddities.
//!
//! | a label of | at a time of a press |
//! |---|---|
//! | a row without a time | a class holds for the whole press, a number at its last event |
//! | a row with a time | holds at this time |
//! | between two rows | numbers on the line between them, the class of the nearer one |
//!
//! No value is defined between rows that are further apart than [`Options::max_gap_us`]. A press
//! may be silent at its ends: a label up to [`Options::max_gap_us`] outside of it counts. Times of
//! the host's clock become the sensor's by an offset ([`Options::offset_us`]). Without one, it is
//! the median of `first_us - host_us` in `recordings.csv`, which `meissner record` writes; if the
//! clock restarts with each recording, each recording has its own offset.
//!
//! Recordings are read one after the other. The folder's events are never in memory together.
//!
//! The input can also be a file of presses with their labels, as `prepare` and `simulate markers`
//! write it.

mod clock;
mod join;
mod names;
mod odd;
mod offset;
mod prepared;
mod scan;
mod summary;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use meissner_engine::{Event, Sensor};
use meissner_io::datasets::Dataset;
use meissner_io::{LabelClock, LabelColumn, LabelTable, ReadOptions};
use meissner_run::RunError;
use meissner_run::text::grouped;

use crate::error::{EvaluateError, RequestPart, Result};
use crate::streams::Streams;
pub use clock::{ClockFit, Drift};
use clock::{Shifts, fit, motion};
pub use join::Row;
use join::{Join, mixed};
use names::{Names, RECORDINGS};
use odd::Odd;
pub use odd::{Oddity, OddityKind};
use offset::{DRIFT_US, Offsets, drift_text};
pub use offset::{Offset, OffsetSource};
pub use scan::PressRecording;
use scan::{load, nothing, scan};
pub use summary::{ClassCount, LabelSummary, Summary};

/// The table of labels in a folder.
pub const LABELS: &str = "labels.csv";
/// Default of [`Options::max_gap_us`].
pub const DEFAULT_MAX_GAP_US: i64 = 100_000;
/// Range of shifts that are tried around an offset that joins labels with presses.
const SEARCH_US: i64 = 5_000_000;
/// A smaller shift of the clocks is not reported.
const SHIFT_US: i64 = 10_000;
/// With fewer poses, motion is not compared with events.
const MIN_POSES: usize = 20;

/// How presses are read.
#[derive(Clone, Debug)]
pub struct Options {
    /// The table of labels; `None`: [`LABELS`] in the folder.
    pub labels: Option<PathBuf>,
    /// Offset from times of the labels to the sensor's, in microseconds. If clocks restart and each
    /// recording has its own offset, it is added to all of them.
    pub offset_us: Option<i64>,
    /// Labels that are further apart, in microseconds, are not interpolated.
    pub max_gap_us: i64,
    /// How the recordings are read; in strict mode, a recording that cannot be read is an error.
    pub read: ReadOptions,
}

impl Default for Options {
    fn default() -> Self {
        let (labels, offset_us, read) = (None, None, ReadOptions::default());
        Self { labels, offset_us, max_gap_us: DEFAULT_MAX_GAP_US, read }
    }
}

/// A label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// Its name, without the unit.
    pub name: String,
    /// Its unit, where the table names one.
    pub unit: Option<String>,
    /// The names of its classes; its values are their indices. Empty for a label of numbers.
    pub classes: Vec<String>,
}

impl Label {
    /// Whether its values are classes.
    pub fn is_class(&self) -> bool {
        !self.classes.is_empty()
    }

    fn of(column: &LabelColumn) -> Self {
        let (name, unit) = (column.name.clone(), column.unit.clone());
        Self { name, unit, classes: column.classes().to_vec() }
    }
}

/// Recordings of presses with labels.
#[derive(Clone, Debug)]
pub struct Presses {
    /// The folder, or the file of presses.
    pub folder: PathBuf,
    /// The table of labels, or the file of presses.
    pub table: PathBuf,
    /// All recordings that can be read, in natural order of their names; also those without events
    /// or labels.
    pub recordings: Vec<PressRecording>,
    /// The labels, in the order of the table's columns.
    pub labels: Vec<Label>,
    /// The labelled instants, by press and time; no press has a time twice.
    pub rows: Vec<Row>,
    /// Oddities, each kind once.
    pub odd: Vec<Oddity>,
    /// Offset from the times of the table to those of the events.
    pub offset: Offset,
    /// Agreement of motion and events, if the table has poses over time.
    pub clock: Option<ClockFit>,
    /// Presses of the split test of a file, whose labels are left out.
    pub kept_back: usize,
    ranges: Vec<Range<usize>>,
    options: Options,
    /// The events, if they come from a file of presses.
    streams: Option<Arc<Streams>>,
}

impl Presses {
    /// Reads the presses in `folder` and in its folders, or those in this file. O(bytes of the
    /// recordings), and for poses also the comparison of clocks; memory for the largest recording,
    /// the table, and 16 bytes for each millisecond with events. The events of a file of presses
    /// are all held in memory.
    ///
    /// # Errors
    /// The folder or the table is missing or cannot be read, there is no recording, recordings of
    /// restarting clocks cannot be distinguished, or no label belongs to a press.
    pub fn read(folder: &Path, options: &Options) -> Result<Self> {
        if folder.is_file() {
            return prepared::read(folder, options);
        }
        let table_path = options.labels.clone().unwrap_or_else(|| folder.join(LABELS));
        let table = read_table(&table_path, options.labels.is_some())?;
        let mut odd = Odd::default();
        let files =
            Dataset::press_files(folder, &[&table_path, &folder.join(RECORDINGS), &folder.join(LABELS)])?;
        let (recordings, unreadable) = scan(&files, options.read, &mut odd)?;
        if recordings.is_empty() {
            return Err(nothing(folder, odd));
        }
        let names = Names::new(&recordings, &unreadable);
        let across = table.recordings.is_none();
        let known = (recordings.as_slice(), &names);
        let offsets = Offsets::choose(folder, table.clock, across, known, options.offset_us, &mut odd)?;
        let join = Join {
            table: &table,
            recordings: &recordings,
            names: &names,
            offsets: &offsets,
            max_gap_us: options.max_gap_us,
        };
        let (rows, ranges) = join.rows(&mut odd);
        let clock = clock(&join, rows.is_empty(), &mut odd);
        if rows.is_empty() {
            return Err(unjoined(&join, clock, odd));
        }
        let labels = table.labels.iter().map(Label::of).collect();
        let (offset, odd) = (offsets.offset, odd.list());
        let (folder, table, options) = (folder.to_owned(), table_path, options.clone());
        Ok(Self {
            folder,
            table,
            recordings,
            labels,
            rows,
            odd,
            offset,
            clock,
            kept_back: 0,
            ranges,
            options,
            streams: None,
        })
    }

    /// The labelled instants of a press, by time; none where it has no label.
    ///
    /// # Panics
    /// Where there is no such recording.
    pub fn rows_of(&self, press: usize) -> &[Row] {
        &self.rows[self.ranges[press].clone()]
    }

    /// The recordings that have a label.
    pub fn labelled(&self) -> impl Iterator<Item = usize> {
        (0..self.recordings.len()).filter(|&press| !self.ranges[press].is_empty())
    }

    /// The index of the label of this name.
    pub fn label(&self, name: &str) -> Option<usize> {
        self.labels.iter().position(|label| label.name == name)
    }

    /// The value of `label` at `t_us` of a press, as the table at the head of this module says; the
    /// index of a class. O(log rows).
    ///
    /// # Panics
    /// Where there is no such recording or label.
    pub fn at(&self, press: usize, label: usize, t_us: i64) -> Option<f64> {
        let rows = self.rows_of(press);
        let is_class = self.labels[label].is_class();
        let value = |row: &Row| Some(row.values[label]).filter(|value| !value.is_nan());
        let after = rows.partition_point(|row| row.t_us < t_us);
        let (before, next) = (after.checked_sub(1).map(|before| &rows[before]), rows.get(after));
        if let Some(row) = next.filter(|row| row.t_us == t_us) {
            return value(row);
        }
        if let Some(row) = rows.iter().find(|row| row.whole).filter(|_| is_class) {
            return value(row);
        }
        let (before, next) = before.zip(next)?;
        let gap = next.t_us.abs_diff(before.t_us);
        if gap > self.options.max_gap_us as u64 {
            return None;
        }
        let share = t_us.abs_diff(before.t_us) as f64 / gap as f64;
        Some(mixed(value(before)?, value(next)?, share, is_class))
    }

    /// The sensor of all recordings with labels.
    ///
    /// # Errors
    /// A recording names no sensor, they have different ones, or none has a label.
    pub fn sensor(&self) -> Result<Sensor> {
        let mut found: Option<Sensor> = None;
        for press in self.labelled() {
            let recording = &self.recordings[press];
            let Some(sensor) = recording.sensor else {
                let format = recording.format.map_or_else(String::new, |format| format.to_string());
                let recording = recording.name.clone();
                return Err(RunError::NoGeometry { recording, format }.into());
            };
            if let Some(other) = found.filter(|other| *other != sensor) {
                let found = format!("{other} and {sensor}");
                return Err(EvaluateError::request(RequestPart::Folder, "recordings of one sensor", found));
            }
            found = Some(sensor);
        }
        found.ok_or_else(|| EvaluateError::request(RequestPart::Folder, "labelled presses", "none"))
    }

    /// Reads the events of a press: those on the sensor, in order of time. Events that are earlier
    /// than one before them are left out, as engines do.
    ///
    /// # Errors
    /// The file cannot be read any more.
    ///
    /// # Panics
    /// Where there is no such recording.
    pub fn events(&self, press: usize) -> Result<Vec<Event>> {
        if let Some(streams) = &self.streams {
            return Ok(streams.part(press).to_vec());
        }
        let path = &self.recordings[press].path;
        let (recording, _, _) = load(path, self.options.read)
            .map_err(|error| RunError::recording(&path.display().to_string(), error))?;
        let mut newest = i64::MIN;
        let mut events = recording.events;
        events.retain(|event| {
            let in_order = event.t_us >= newest;
            newest = newest.max(event.t_us);
            in_order
        });
        Ok(events)
    }
}

fn read_table(path: &Path, is_given: bool) -> Result<LabelTable> {
    if !is_given && !path.exists() {
        let expected = format!("a table of labels, {} by default", path.display());
        return Err(EvaluateError::request(RequestPart::Labels, expected, "no such file"));
    }
    Ok(LabelTable::read(path)?)
}

/// Compares the motion of poses with the rate of events; `all` tries all shifts.
fn clock(join: &Join<'_>, all: bool, odd: &mut Odd) -> Option<ClockFit> {
    let Join { table, recordings, offsets, max_gap_us, .. } = join;
    // Labels at instants of recordings, on the recordings' own clock, need no offset.
    if table.recordings.is_some() && table.clock != Some(LabelClock::Host) {
        return None;
    }
    // Oddities in the order of the poses are already reported.
    let order = join.ordered(&mut Odd::default());
    if order.len() < MIN_POSES {
        return None;
    }
    let times: Vec<i64> = order.iter().map(|pose| pose.0).collect();
    let numbers: Vec<&LabelColumn> = table.labels.iter().filter(|label| label.classes().is_empty()).collect();
    let moved = |label: &&LabelColumn| {
        let period = match label.unit.as_deref() {
            Some("deg") => Some(360.0),
            Some("rad") => Some(std::f64::consts::TAU),
            _ => None,
        };
        let values: Vec<f64> = order.iter().map(|pose| label.value(pose.1).unwrap_or(f64::NAN)).collect();
        motion(&times, &values, period, *max_gap_us)
    };
    let motions: Vec<_> = numbers.iter().map(moved).collect();
    let mut rates: Vec<(i64, f64)> = Vec::new();
    for (press, recording) in recordings.iter().enumerate() {
        let Some(offset) = offsets.of(press) else { continue };
        let on_host = |&(t_us, count): &(i64, u32)| (t_us.saturating_sub(offset), f64::from(count));
        rates.extend(recording.rate.iter().map(on_host));
    }
    rates.sort_by_key(|rate| rate.0);
    let (moved, found) = fit(&rates, &motions, if all { Shifts::All } else { Shifts::Within(SEARCH_US) })?;
    let ClockFit { shift_us, width_us, correlation, next, drift } = found;
    if all || !found.fits() {
        return Some(found);
    }
    if shift_us.abs() > SHIFT_US.max(width_us) {
        let offset = offsets.offset.us.saturating_add(shift_us);
        let sure =
            if found.is_sure() { "" } else { "; presses look alike, so that another offset may be right" };
        let with = if offsets.is_given { format!("with --offset {offset}us, ") } else { String::new() };
        odd.add(OddityKind::Offset, || {
            format!(
                "the motion of {} fits the events better {with}{:.1} ms more than was used \
                 (correlation {correlation:.2}, next peak {next:.2}){sure}",
                numbers[moved].name,
                shift_us as f64 / 1e3
            )
        });
    }
    if let Some(drift) = drift.filter(|drift| drift.matters(DRIFT_US) && !odd.has(OddityKind::Drift)) {
        odd.add(OddityKind::Drift, || format!("{} by motion and events", drift_text(drift)));
    }
    Some(found)
}

/// The error if no label belongs to a press.
fn unjoined(join: &Join<'_>, clock: Option<ClockFit>, odd: Odd) -> EvaluateError {
    let Join { table, recordings, offsets, names, .. } = join;
    let rows = grouped(table.rows() as u64);
    let found = odd.list().iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    if table.recordings.is_some() {
        let expected = format!("labels of recordings such as {}", names.example());
        return EvaluateError::request(
            RequestPart::Labels,
            expected,
            format!("{rows} rows of none: {found}"),
        );
    }
    let span = |times: &[i64]| {
        let (first, last) = (times.iter().min(), times.iter().max());
        first.zip(last).map_or_else(|| "none".to_owned(), |(first, last)| format!("{first} to {last} us"))
    };
    let filled = recordings.iter().filter(|recording| recording.events > 0);
    let ends: Vec<i64> = filled.flat_map(|recording| [recording.first_us, recording.last_us]).collect();
    let poses: Vec<i64> = table.times_us.iter().flatten().copied().collect();
    let offset = offsets.offset.us;
    let proposal = clock.map_or_else(String::new, |fit| {
        format!(
            "; motion fits the events best with {}us (correlation {:.2}, next peak {:.2})",
            offset.saturating_add(fit.shift_us),
            fit.correlation,
            fit.next
        )
    });
    let expected = format!("an offset that puts poses into recordings, which are at {}", span(&ends));
    let found = format!("{offset}us, and poses at {}{proposal}", span(&poses));
    EvaluateError::request(RequestPart::Offset, expected, found)
}

#[cfg(test)]
mod tests;
