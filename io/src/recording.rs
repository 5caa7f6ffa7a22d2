//! The result of a decoder: the events, the sensor if the file names it, and a summary of the other
//! content of the file. For encoders: the limits on the events that a format can hold.

use std::fmt;
use std::ops::RangeInclusive;

use meissner_engine::{Event, Sensor};

use crate::error::{IoError, Place};
use crate::format::Format;
use crate::left_out::LeftOut;

/// A decoded file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// The format of the file.
    pub format: Format,
    /// The sensor that the file names; every event lies inside it. `None`: the file names none.
    pub sensor: Option<Sensor>,
    /// The events in the file's order, with its times, which may step back.
    pub events: Vec<Event>,
    /// The other streams of the file, counted and not decoded. Empty streams are left out.
    pub other_streams: Vec<StreamSummary>,
    /// Words, events and lines that were left out, by kind (none if [strict](crate::ReadOptions)).
    pub left_out: Vec<LeftOut>,
    /// Assumptions of the reader about properties that the file does not state, as sentences.
    pub assumed: Vec<&'static str>,
    /// The incomplete end that was left out; only with [`crate::ReadOptions::salvage`].
    pub salvaged: Option<Salvage>,
}

impl Recording {
    /// A recording of these events and nothing else.
    pub fn of_events(format: Format, sensor: Option<Sensor>, events: Vec<Event>) -> Self {
        let (other_streams, left_out, assumed) = (Vec::new(), Vec::new(), Vec::new());
        Self { format, sensor, events, other_streams, left_out, assumed, salvaged: None }
    }
}

/// The incomplete end of a file that was cut short; its events are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Salvage {
    /// The incomplete part.
    pub what: &'static str,
    /// Its start.
    pub place: Place,
    /// Bytes from there to the end of the file.
    pub bytes_not_read: u64,
}

/// A stream that was counted and not decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamSummary {
    /// The stream's name in the file, or the format's name for such words.
    pub name: String,
    /// The kind of its elements.
    pub kind: StreamKind,
    /// Packets of AEDAT4; words of EVT2 and EVT3.
    pub packets: u64,
    /// Elements in these packets: frames, samples, triggers, events. A packet of
    /// [`StreamKind::Other`] counts as one.
    pub elements: u64,
}

/// The kind of a stream's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StreamKind {
    /// Events of another event stream; [`Recording::events`] holds the first stream's.
    Events,
    /// Images.
    Frames,
    /// Samples of an inertial measurement unit.
    Imu,
    /// External triggers and special signals.
    Triggers,
    /// Events before the first time (and row) of the stream, for example in a recording that starts
    /// in the middle of a stream: their time or pixel is unknown.
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

impl StreamSummary {
    /// A stream without elements.
    pub(crate) fn new(name: &str, kind: StreamKind) -> Self {
        Self { name: name.to_owned(), kind, packets: 0, elements: 0 }
    }

    /// The streams that have elements.
    pub(crate) fn present(streams: impl IntoIterator<Item = Self>) -> Vec<Self> {
        streams.into_iter().filter(|stream| stream.packets > 0).collect()
    }

    /// Counts a packet with this number of elements.
    pub(crate) fn add(&mut self, elements: u64) {
        self.packets += 1;
        self.elements += elements;
    }
}

/// The events that a format can hold.
pub(crate) struct Capacity {
    /// Times in microseconds.
    pub(crate) times: RangeInclusive<i64>,
    /// Exclusive upper bound of columns and rows, and longest side of a sensor.
    pub(crate) side: u32,
    /// The sensors that the format can hold, in words.
    pub(crate) sensor: &'static str,
    /// The times that can follow another time, in words.
    pub(crate) steps: &'static str,
    /// Whether readers would take the step from one time to the next for a wrap of the clock.
    pub(crate) is_wrap: fn(i64, i64) -> bool,
}

impl Capacity {
    /// Every event.
    pub(crate) const UNLIMITED: Self = Self {
        times: i64::MIN..=i64::MAX,
        side: 1 << 16,
        sensor: "a sensor of 1 to 65535 pixels a side",
        steps: "",
        is_wrap: |_, _| false,
    };

    /// Refuses a sensor or an event that `format` cannot hold, and an event outside `sensor`.
    pub(crate) fn check(
        &self,
        format: Format,
        sensor: Option<Sensor>,
        events: &[Event],
    ) -> Result<(), IoError> {
        let fits = |side: u16| (1..=self.side).contains(&side.into());
        if let Some(sensor) = sensor.filter(|sensor| !fits(sensor.width) || !fits(sensor.height)) {
            return Err(IoError::Unsupported {
                expected: self.sensor,
                actual: format!("{sensor} for {format}"),
            });
        }
        let (width, height) = sensor.map_or((self.side, self.side), |s| (s.width.into(), s.height.into()));
        let owner = if sensor.is_some() { ", the sensor's" } else { "" };
        let mut newest_us = 0;
        for (index, &Event { t_us, x, y, .. }) in events.iter().enumerate() {
            let refuse = |field, expected: String, actual: String| {
                Err(IoError::CannotHold { format, index, field, expected, actual })
            };
            for (field, value, side) in [("x", x, width), ("y", y, height)] {
                if u32::from(value) >= side {
                    return refuse(field, format!("below {side}{owner}"), value.to_string());
                }
            }
            if !self.times.contains(&t_us) {
                return refuse("t_us", format!("0 to {}", self.times.end()), t_us.to_string());
            }
            if (self.is_wrap)(newest_us, t_us) {
                return refuse("t_us", self.steps.to_owned(), format!("{t_us} after {newest_us}"));
            }
            newest_us = t_us;
        }
        Ok(())
    }
}
