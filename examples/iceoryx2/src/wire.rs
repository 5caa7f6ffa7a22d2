//! The data in shared memory: records of events, and the headers of slices and predictions.
//!
//! Invariant: every type here is `repr(C)`, has no padding bytes, and every bit pattern has a
//! meaning or is refused by a check. The number at the end of a type's name is its version:
//! iceoryx2 connects only types of the same name, size and alignment.

use iceoryx2::prelude::ZeroCopySend;
use meissner_engine::{Event, Sensor};
use meissner_packets::PacketError;

/// Maximum number of events of a slice.
pub const SLICE: usize = 1024;

/// An event in 16 bytes, with the layout of `meissner send --records` and of the C interface on
/// machines whose least significant byte comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_event_1")]
pub struct EventRecord {
    /// Time in microseconds.
    pub t_us: i64,
    /// Column.
    pub x: u16,
    /// Row.
    pub y: u16,
    /// 1 for a rise, 0 for a fall.
    pub polarity: i8,
    /// Zero.
    pub zero: [u8; 3],
}

impl From<Event> for EventRecord {
    fn from(Event { t_us, x, y, on }: Event) -> Self {
        Self { t_us, x, y, polarity: on.into(), zero: [0; 3] }
    }
}

impl EventRecord {
    /// The event; `None` if the record is not an event.
    #[inline]
    pub fn event(&self) -> Option<Event> {
        let Self { t_us, x, y, polarity, zero } = *self;
        (matches!(polarity, 0 | 1) && zero == [0; 3]).then(|| Event::new(t_us, x, y, polarity == 1))
    }
}

/// The header of a slice of events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_slice_1")]
pub struct SliceHeader {
    /// A unique number of this start of the driver: its nanoseconds on the shared clock.
    pub run: u64,
    /// Number of the slice in its run, from 0.
    pub sequence: u64,
    /// Events of the run before this slice.
    pub first_event: u64,
    /// Time when its first event was due or received, in nanoseconds of the shared clock.
    pub due_ns: u64,
    /// Time when the driver began to write the slice, in nanoseconds of the shared clock.
    pub published_ns: u64,
    /// Columns of the sensor.
    pub width: u16,
    /// Rows of the sensor.
    pub height: u16,
    /// 1 in the last slice of a run, which has no events; otherwise 0.
    pub end: u32,
}

/// The header of a prediction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_prediction_1")]
pub struct PredictionHeader {
    /// A unique number of this start of the inference.
    pub origin: u64,
    /// Number of the prediction, from 0.
    pub sequence: u64,
    /// The driver's run.
    pub run: u64,
    /// Events of the run that were taken.
    pub taken: u64,
    /// Events of the run that were lost or refused before the newest taken one.
    pub lost: u64,
    /// Time of the newest event that it covers, in microseconds; 0 without events.
    pub t_us: i64,
    /// Events in the window.
    pub nodes: u64,
    /// [`SliceHeader::due_ns`] of the oldest slice that it is the first to cover.
    pub due_ns: u64,
    /// [`SliceHeader::published_ns`] of that slice.
    pub published_ns: u64,
    /// Time when that slice was received, in nanoseconds of the shared clock.
    pub received_ns: u64,
    /// Time when the prediction was ready, in nanoseconds of the shared clock.
    pub predicted_ns: u64,
    /// 1 if the run has ended; otherwise 0.
    pub end: u64,
}

/// Checks the header of a slice of so many events on its own.
///
/// # Errors
/// The first reason to refuse it.
pub fn check(header: &SliceHeader, events: usize) -> Result<Sensor, PacketError> {
    let &SliceHeader { width, height, end, .. } = header;
    let sensor = Sensor::new(width, height);
    if width == 0 || height == 0 {
        return Err(PacketError::unexpected("slice", "a sensor with pixels", &sensor.to_string()));
    }
    if end > 1 || (end == 1) != (events == 0) {
        let found = format!("{events} events with end = {end}");
        return Err(PacketError::unexpected("slice", "events, or an end without events", &found));
    }
    Ok(sensor)
}

/// Checks the records of a slice.
///
/// # Errors
/// The first record that is not an event.
pub fn check_records(records: &[EventRecord]) -> Result<(), PacketError> {
    records.iter().enumerate().try_for_each(|(index, record)| {
        let EventRecord { polarity, zero, .. } = *record;
        record.event().map(drop).ok_or_else(|| {
            let (what, found) = (format!("record {index}"), format!("{polarity} and {zero:?}"));
            PacketError::unexpected(&what, "polarity 0 or 1 and three zeros", &found)
        })
    })
}
