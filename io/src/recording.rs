//! What leaves a decoder: the events, the sensor where the file names it, and what else the file holds.

use std::fmt;

use meissner_engine::{Event, Sensor};

use crate::error::Place;
use crate::format::Format;

/// A decoded file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// The format that it was read from.
    pub format: Format,
    /// The geometry that the file names; every event lies inside it. `None`: the file does not say.
    pub sensor: Option<Sensor>,
    /// The events in the file's order, with the file's times. Times may step back where the sensor's did.
    pub events: Vec<Event>,
    /// What the file holds beside these events: counted, not decoded. Streams that are empty are left out.
    pub other_streams: Vec<StreamSummary>,
    /// What was left out at the end because it is not whole; only where [`crate::ReadOptions::salvage`] asked for that.
    pub salvaged: Option<Salvage>,
}

/// The end of a file that was cut short, which is not among the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Salvage {
    /// What is not whole.
    pub what: &'static str,
    /// Where it starts.
    pub place: Place,
    /// Bytes from there to the end of the file.
    pub bytes_not_read: u64,
}

/// How much of something a file holds that was counted and not decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamSummary {
    /// The stream's name in the file, or what the format calls such words.
    pub name: String,
    /// What its elements are.
    pub kind: StreamKind,
    /// Packets of AEDAT4; words of EVT2 and EVT3.
    pub packets: u64,
    /// Elements in these packets: frames, samples, triggers, events. A packet of [`StreamKind::Other`] counts
    /// as one.
    pub elements: u64,
}

/// What the elements of a stream are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StreamKind {
    /// Events of a second event stream; [`Recording::events`] holds the first.
    Events,
    /// Images.
    Frames,
    /// Samples of an inertial measurement unit.
    Imu,
    /// External triggers and special signals.
    Triggers,
    /// Events before the stream first said the time and the row, as where a recording starts in the middle of
    /// a stream: they cannot be placed.
    Unplaced,
    /// Anything else.
    Other,
}

impl fmt::Display for StreamKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Events => "events",
            Self::Frames => "frames",
            Self::Imu => "IMU samples",
            Self::Triggers => "triggers",
            Self::Unplaced => "unplaced events",
            Self::Other => "other",
        })
    }
}

/// Counts what a stream of words holds beside its events.
#[derive(Default)]
pub(crate) struct Tally {
    packets: u64,
    elements: u64,
}

impl Tally {
    pub(crate) fn add(&mut self, elements: u64) {
        self.packets += 1;
        self.elements += elements;
    }

    /// The summary, or `None` where nothing was counted.
    pub(crate) fn summary(&self, name: &str, kind: StreamKind) -> Option<StreamSummary> {
        (self.packets > 0).then(|| StreamSummary {
            name: name.to_owned(),
            kind,
            packets: self.packets,
            elements: self.elements,
        })
    }
}
