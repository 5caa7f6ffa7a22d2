//! Oddities of recordings and labels: kinds, with a count and the first example of each.

use std::collections::BTreeMap;
use std::fmt;

use meissner_run::text::grouped;

/// A kind of oddity, in the order of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum OddityKind {
    /// A file is no recording of events.
    PassedOver,
    /// A recording cannot be read.
    Unreadable,
    /// Words, events or lines of recordings were left out by the reader.
    LeftOut,
    /// Events lie outside the sensor.
    OutsideSensor,
    /// A recording has no event.
    Empty,
    /// A recording has far fewer events than the median.
    Few,
    /// A recording has far more or far fewer events a second than the median.
    Rate,
    /// A recording has the events of another one, at the same or another time.
    Same,
    /// The times of a recording step back.
    StepsBack,
    /// A recording has another sensor than most.
    SensorSize,
    /// A label names no recording.
    UnknownRecording,
    /// A label names several recordings.
    AmbiguousRecording,
    /// A recording has no label.
    Unlabelled,
    /// Labels are taken to count their times from the first event of their recording.
    RelativeTimes,
    /// A label lies outside of its recording.
    Outside,
    /// A row repeats another one.
    Repeated,
    /// A row gives other values for the recording and the time of another one.
    Contradicts,
    /// The times of poses step back.
    PosesStepBack,
    /// Poses are too far apart during a press for interpolation between them.
    PoseGap,
    /// Recordings that should follow each other overlap in time.
    Overlap,
    /// The list of recordings lacks a recording.
    NoHostTime,
    /// A value is missing.
    Missing,
    /// A value of a label of numbers is no number.
    NotNumber,
    /// A label has the same value everywhere.
    Constant,
    /// The motion of the poses fits the events better under another offset.
    Offset,
    /// The offset of the clocks grows along the session.
    Drift,
}

impl OddityKind {
    fn text(self) -> &'static str {
        match self {
            Self::PassedOver => "files that are no recordings",
            Self::Unreadable => "recordings that cannot be read",
            Self::LeftOut => "words, events or lines of recordings that are left out",
            Self::OutsideSensor => "events outside the sensor",
            Self::Empty => "presses without events",
            Self::Few => "presses with less than a tenth of the median's events",
            Self::Rate => "presses with a fifth or five times the median's events a second",
            Self::Same => "recordings with the content of another one",
            Self::StepsBack => "recordings whose times step back",
            Self::SensorSize => "recordings of another sensor than most",
            Self::UnknownRecording => "labels that name no recording",
            Self::AmbiguousRecording => "labels that name several recordings",
            Self::Unlabelled => "recordings without labels",
            Self::RelativeTimes => {
                "labels whose times are taken to count from the first event of their recording"
            }
            Self::Outside => "labels outside of their recording",
            Self::Repeated => "rows that repeat another one",
            Self::Contradicts => {
                "rows that contradict another one of the same recording and time, which counts"
            }
            Self::PosesStepBack => "poses that are earlier than one before them",
            Self::PoseGap => "gaps between poses during a press",
            Self::Overlap => "recordings that overlap in time",
            Self::NoHostTime => "recordings that recordings.csv does not name",
            Self::Missing => "values that are missing",
            Self::NotNumber => "values that are no numbers, in labels of numbers",
            Self::Constant => "labels with one value",
            Self::Offset => "clocks that do not agree",
            Self::Drift => "clocks that drift apart",
        }
    }
}

/// Something odd.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Oddity {
    /// The kind.
    pub kind: OddityKind,
    /// Number of such oddities.
    pub count: u64,
    /// The first of them, for people.
    pub first: String,
}

impl fmt::Display for Oddity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, first) = (self.kind.text(), &self.first);
        match self.count {
            1 => write!(f, "{what}: {first}"),
            count => write!(f, "{what}: {}, the first {first}", grouped(count)),
        }
    }
}

/// Counts oddities.
#[derive(Debug, Default)]
pub(super) struct Odd(BTreeMap<OddityKind, (u64, String)>);

impl Odd {
    pub(super) fn add(&mut self, kind: OddityKind, example: impl FnOnce() -> String) {
        self.add_many(kind, 1, example);
    }

    /// Adds `count` of a kind; 0 adds nothing.
    pub(super) fn add_many(&mut self, kind: OddityKind, count: u64, example: impl FnOnce() -> String) {
        if count > 0 {
            self.0.entry(kind).or_insert_with(|| (0, example())).0 += count;
        }
    }

    pub(super) fn has(&self, kind: OddityKind) -> bool {
        self.0.contains_key(&kind)
    }

    pub(super) fn list(self) -> Vec<Oddity> {
        self.0.into_iter().map(|(kind, (count, first))| Oddity { kind, count, first }).collect()
    }
}
