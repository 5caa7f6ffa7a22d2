//! The meaning of the columns of a table of labels.

use std::borrow::Cow;

use super::fields::malformed;
use crate::csv::TimeUnit;
use crate::error::{IoError, shown};
use crate::text::Line;

pub(super) const EXPECTED: &str =
    "names of columns such as recording,t_us,roll_deg, with recording or a time, and a label";

/// Names of the column of recordings.
const RECORDING: [&str; 3] = ["recording", "file", "filename"];
/// Names of times of the sensor and of the host, before their unit.
const SENSOR: [&str; 4] = ["t", "ts", "time", "timestamp"];
const HOST: [&str; 3] = ["host", "host_t", "host_time"];

/// Units at the end of a name in lower case, and in the form of messages. `nm` is a torque: robots
/// have newton metres more often than nanometres. Units with `_` come first.
const UNITS: [(&str, &str); 33] = [
    ("mm_s", "mm/s"),
    ("m_s", "m/s"),
    ("deg_s", "deg/s"),
    ("rad_s", "rad/s"),
    ("deg", "deg"),
    ("rad", "rad"),
    ("n", "N"),
    ("mn", "mN"),
    ("kn", "kN"),
    ("nm", "Nm"),
    ("nmm", "Nmm"),
    ("mnm", "mNm"),
    ("m", "m"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("um", "um"),
    ("s", "s"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
    ("hz", "Hz"),
    ("khz", "kHz"),
    ("g", "g"),
    ("kg", "kg"),
    ("pa", "Pa"),
    ("kpa", "kPa"),
    ("mpa", "MPa"),
    ("v", "V"),
    ("mv", "mV"),
    ("ma", "mA"),
    ("mm2", "mm2"),
    ("px", "px"),
    ("percent", "%"),
];

/// The clock of the times of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelClock {
    /// The clock of the events.
    Sensor,
    /// The clock of the computer or the robot.
    Host,
}

/// The meaning of a column.
pub(super) enum Column {
    Skipped,
    Recording,
    /// A time, with the power of ten that converts it to microseconds.
    Time {
        power: i32,
    },
    /// The label of this index.
    Label(usize),
}

pub(super) struct Label {
    pub(super) name: String,
    pub(super) unit: Option<String>,
}

pub(super) struct Header {
    pub(super) columns: Vec<Column>,
    /// Columns up to the last one that has a name.
    pub(super) named: usize,
    pub(super) labels: Vec<Label>,
    pub(super) has_recording: bool,
    pub(super) clock: Option<LabelClock>,
}

impl Header {
    pub(super) fn of(line: Line<'_>, fields: &[Cow<'_, [u8]>]) -> Result<Self, IoError> {
        let named = fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1);
        let names: Vec<String> =
            fields[..named].iter().map(|field| String::from_utf8_lossy(field).into_owned()).collect();
        let (mut labels, mut columns): (Vec<Label>, Vec<Column>) = (Vec::new(), Vec::new());
        let mut recordings = 0;
        // The column of the time of each clock.
        let mut times: [Option<(usize, i32)>; 2] = [None, None];
        for (index, name) in names.iter().enumerate() {
            let refuse = |expected: &str| malformed(line, index + 1, expected, name.as_bytes());
            let (stem, unit) = split(name);
            let lower = name.to_ascii_lowercase();
            if name.is_empty() {
                columns.push(Column::Skipped);
            } else if RECORDING.contains(&lower.as_str()) {
                recordings += 1;
                columns.push(Column::Recording);
                if recordings > 1 {
                    return Err(refuse("one column of recordings"));
                }
            } else if let Some(clock) = clock_of(&stem) {
                let unit = unit.as_deref().and_then(|unit| unit.parse::<TimeUnit>().ok());
                let unit =
                    unit.ok_or_else(|| refuse("a time with its unit, such as t_us, t_s or host_us"))?;
                if times[clock as usize].replace((index, unit.name_and_power().1)).is_some() {
                    return Err(refuse("one column of times of a clock"));
                }
                columns.push(Column::Skipped);
            } else {
                if labels.iter().any(|label| label.name == stem) {
                    return Err(refuse("labels of different names, apart from their units"));
                }
                columns.push(Column::Label(labels.len()));
                labels.push(Label { name: stem, unit });
            }
        }
        columns.resize_with(fields.len(), || Column::Skipped);
        let has_recording = recordings > 0;
        let mut preferred = [LabelClock::Sensor, LabelClock::Host];
        if !has_recording {
            preferred.reverse();
        }
        let clock = preferred.into_iter().find(|&clock| times[clock as usize].is_some());
        if let Some((index, power)) = clock.and_then(|clock| times[clock as usize]) {
            columns[index] = Column::Time { power };
        }
        if labels.is_empty() || (!has_recording && clock.is_none()) {
            return Err(line.malformed("header", EXPECTED, shown(line.text)));
        }
        Ok(Self { columns, named, labels, has_recording, clock })
    }
}

/// The clock of a column of times.
fn clock_of(stem: &str) -> Option<LabelClock> {
    let stem = stem.to_ascii_lowercase();
    if SENSOR.contains(&stem.as_str()) {
        return Some(LabelClock::Sensor);
    }
    HOST.contains(&stem.as_str()).then_some(LabelClock::Host)
}

/// A name without its unit, and the unit: `roll_deg`, `force [N]`, `force (N)`.
fn split(name: &str) -> (String, Option<String>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((stem, unit)) = name.strip_suffix(close).and_then(|inside| inside.rsplit_once(open)) {
            let (stem, unit) = (stem.trim(), unit.trim());
            if !stem.is_empty() {
                return (stem.to_owned(), (!unit.is_empty()).then(|| unit.to_owned()));
            }
        }
    }
    for (suffix, unit) in UNITS {
        // A character of several bytes has none of the suffixes.
        let Some(at) = name.len().checked_sub(suffix.len() + 1).filter(|&at| at > 0) else { continue };
        let is_suffix =
            name.as_bytes()[at] == b'_' && name.as_bytes()[at + 1..].eq_ignore_ascii_case(suffix.as_bytes());
        if is_suffix {
            return (name[..at].to_owned(), Some(unit.to_owned()));
        }
    }
    (name.to_owned(), None)
}
