//! Scans the recordings of a folder, and finds oddities.
//!
//! Recordings are read one after the other. Each leaves counts, a fingerprint of its events, and
//! its number of events in each millisecond.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

use fnv::FnvHasher;
use meissner_engine::{Event, Sensor};
use meissner_io::datasets::{Dataset, PressFile};
use meissner_io::{Format, IoError, ReadOptions, Recording, read_with};
use meissner_run::RunError;
use meissner_run::error::chain;
use meissner_run::text::grouped;

use super::odd::{Odd, OddityKind};
use crate::error::{EvaluateError, RequestPart, Result};

/// Bins of the rate of events.
const RATE_US: i64 = 1_000;

/// Extensions of files beside recordings that are no recordings: notes, settings, pictures,
/// results.
const QUIET: [&str; 13] =
    ["txt", "md", "json", "toml", "yaml", "yml", "pdf", "png", "jpg", "jpeg", "svg", "py", "safetensors"];

/// A recording, which is a press.
#[derive(Clone, Debug, PartialEq)]
pub struct PressRecording {
    /// Its path in the folder, such as "wood/press2.aedat4"; its name in a file of presses.
    pub name: String,
    /// Its file.
    pub path: PathBuf,
    /// Its format; `None` in a file of presses.
    pub format: Option<Format>,
    /// Its sensor, where it is known.
    pub sensor: Option<Sensor>,
    /// Its events on the sensor.
    pub events: u64,
    /// The time of its first event; 0 without any.
    pub first_us: i64,
    /// The time of its last event; 0 without any.
    pub last_us: i64,
    /// Events that are earlier than one before them.
    pub late: u64,
    /// Fingerprint of its events, with times from the first on.
    pub fingerprint: u64,
    /// The begin of each millisecond with events, and their number.
    pub(super) rate: Vec<(i64, u32)>,
}

impl PressRecording {
    /// From the first event to the last one, in microseconds.
    pub fn duration_us(&self) -> u64 {
        self.last_us.abs_diff(self.first_us)
    }

    /// Events a second; `None` if all events have the same time.
    pub fn rate(&self) -> Option<f64> {
        let duration = self.duration_us();
        (duration > 0).then(|| self.events as f64 / (duration as f64 * 1e-6))
    }

    pub(super) fn of(
        (name, path): (String, &Path),
        format: Option<Format>,
        sensor: Option<Sensor>,
        events: &[Event],
    ) -> Self {
        let first_us = events.iter().map(|event| event.t_us).min().unwrap_or(0);
        let last_us = events.iter().map(|event| event.t_us).max().unwrap_or(0);
        let begin = events.first().map_or(0, |event| event.t_us);
        let (mut late, mut newest, mut hash) = (0, i64::MIN, FnvHasher::default());
        let mut rate: BTreeMap<i64, u32> = BTreeMap::new();
        for event in events {
            late += u64::from(event.t_us < newest);
            newest = newest.max(event.t_us);
            (event.t_us.wrapping_sub(begin), event.x, event.y, event.on).hash(&mut hash);
            *rate.entry(event.t_us.div_euclid(RATE_US).saturating_mul(RATE_US)).or_default() += 1;
        }
        Self {
            name,
            path: path.to_owned(),
            format,
            sensor,
            events: events.len() as u64,
            first_us,
            last_us,
            late,
            fingerprint: hash.finish(),
            rate: rate.into_iter().collect(),
        }
    }
}

/// Reads a recording. The sensor of `read` replaces its own; events outside it are left out and
/// counted.
pub(super) fn load(path: &Path, read: ReadOptions) -> Result<(Recording, Option<Sensor>, u64), IoError> {
    let mut recording = read_with(path, read)?;
    let sensor = read.sensor.or(recording.sensor);
    let all = recording.events.len();
    if let Some(sensor) = sensor {
        recording.events.retain(|event| sensor.contains(event.x, event.y));
    }
    let outside = (all - recording.events.len()) as u64;
    Ok((recording, sensor, outside))
}

/// Reads the recordings of a folder; the names of those that cannot be read come second.
pub(super) fn scan(
    files: &Dataset<PressFile>,
    read: ReadOptions,
    odd: &mut Odd,
) -> Result<(Vec<PressRecording>, Vec<String>)> {
    let is_quiet = |path: &&PathBuf| {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        path.is_file() && QUIET.iter().any(|quiet| extension.eq_ignore_ascii_case(quiet))
    };
    for path in files.passed_over.iter().filter(|path| !is_quiet(path)) {
        odd.add(OddityKind::PassedOver, || path.display().to_string());
    }
    let (mut recordings, mut unreadable) = (Vec::new(), Vec::new());
    for file in &files.recordings {
        let (recording, sensor, outside) = match load(&file.path, read) {
            Ok(loaded) => loaded,
            Err(IoError::OtherKind { .. }) => {
                odd.add(OddityKind::PassedOver, || file.path.display().to_string());
                continue;
            }
            Err(error) if read.strict => {
                return Err(RunError::recording(&file.path.display().to_string(), error).into());
            }
            Err(error) => {
                odd.add(OddityKind::Unreadable, || format!("{}: {}", file.name, chain(&error)));
                unreadable.push(file.name.clone());
                continue;
            }
        };
        odd.add_many(OddityKind::OutsideSensor, outside, || format!("in {}", file.name));
        for left_out in &recording.left_out {
            let example =
                || format!("in {}: {}", file.name, left_out.first.first().map_or("", String::as_str));
            odd.add_many(OddityKind::LeftOut, left_out.count, example);
        }
        let (file, format) = ((file.name.clone(), file.path.as_path()), Some(recording.format));
        recordings.push(PressRecording::of(file, format, sensor, &recording.events));
    }
    check(&recordings, odd);
    Ok((recordings, unreadable))
}

/// The lower median of `values`.
pub(super) fn median<T: Copy>(
    mut values: Vec<T>,
    compare: impl Fn(&T, &T) -> std::cmp::Ordering,
) -> Option<T> {
    let middle = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(middle, compare).1)
}

/// Finds oddities of recordings compared with each other.
pub(super) fn check(recordings: &[PressRecording], odd: &mut Odd) {
    let filled = || recordings.iter().filter(|recording| recording.events > 0);
    let usual = median(filled().map(|recording| recording.events).collect(), u64::cmp).unwrap_or(0);
    let rate = median(filled().filter_map(PressRecording::rate).collect(), f64::total_cmp);
    let mut sizes: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for sensor in recordings.iter().filter_map(|recording| recording.sensor) {
        *sizes.entry((sensor.width, sensor.height)).or_default() += 1;
    }
    let most = sizes.iter().max_by_key(|(_, count)| **count).map(|(size, _)| Sensor::new(size.0, size.1));
    let mut met: BTreeMap<(u64, u64), &str> = BTreeMap::new();
    for recording in recordings {
        let PressRecording { name, events, .. } = recording;
        let count = grouped(*events);
        if let (Some(sensor), Some(most)) = (recording.sensor.filter(|sensor| Some(*sensor) != most), most) {
            odd.add(OddityKind::SensorSize, || format!("{name} with {sensor}, most have {most}"));
        }
        odd.add_many(OddityKind::StepsBack, u64::from(recording.late > 0), || {
            format!("{name}, in which {} events are earlier than one before them", grouped(recording.late))
        });
        if *events == 0 {
            odd.add(OddityKind::Empty, || name.clone());
            continue;
        }
        if let Some(first) = met.get(&(recording.fingerprint, *events)) {
            odd.add(OddityKind::Same, || format!("{name}, which has the events of {first}"));
        }
        met.entry((recording.fingerprint, *events)).or_insert(name);
        if *events * 10 < usual {
            odd.add(OddityKind::Few, || format!("{name} with {count}, the median is {}", grouped(usual)));
        } else if let (Some(own), Some(rate)) = (recording.rate(), rate)
            && (own * 5.0 < rate || own > rate * 5.0)
        {
            odd.add(OddityKind::Rate, || format!("{name} with {own:.0} a second, the median is {rate:.0}"));
        }
    }
}

/// The error of a folder without recordings.
pub(super) fn nothing(folder: &Path, odd: Odd) -> EvaluateError {
    let found = odd.list().iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    let found = if found.is_empty() { "none".to_owned() } else { found };
    let expected = format!("recordings of events in {} or its folders", folder.display());
    EvaluateError::request(RequestPart::Folder, expected, found)
}
