//! What lies in shared memory: records of events, and the headers of slices and predictions.
//!
//! Invariant: every type here is `repr(C)`, has no bytes that belong to no field, and means
//! something for every bit pattern or is refused by a check. The number at the end of a type's name
//! is its version: iceoryx2 connects only types of the same name, size and alignment.

use iceoryx2::prelude::ZeroCopySend;
use meissner_engine::{Event, Sensor};

/// Events of a slice at most.
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
    /// The event; `None` if the record is no event.
    #[inline]
    pub fn event(&self) -> Option<Event> {
        let Self { t_us, x, y, polarity, zero } = *self;
        (matches!(polarity, 0 | 1) && zero == [0; 3]).then(|| Event::new(t_us, x, y, polarity == 1))
    }
}

/// What a slice of events says about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_slice_1")]
pub struct SliceHeader {
    /// A number that this start of the driver has alone: its nanoseconds on the shared clock.
    pub run: u64,
    /// Number of the slice in its run, from 0.
    pub sequence: u64,
    /// Events of the run before this slice.
    pub first_event: u64,
    /// When its first event was due, in nanoseconds of the shared clock: for a live sensor, when it
    /// was received.
    pub due_ns: u64,
    /// When the driver began to write the slice, in nanoseconds of the shared clock.
    pub published_ns: u64,
    /// Columns of the sensor.
    pub width: u16,
    /// Rows of the sensor.
    pub height: u16,
    /// 1 in the last slice of a run, which has no events; otherwise 0.
    pub end: u32,
}

/// What a prediction says about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_prediction_1")]
pub struct PredictionHeader {
    /// A number that this start of the inference has alone.
    pub origin: u64,
    /// Number of the prediction, from 0.
    pub sequence: u64,
    /// The driver's run.
    pub run: u64,
    /// Events of the run that were taken.
    pub taken: u64,
    /// Events of the run that were lost or refused before the newest that was taken.
    pub lost: u64,
    /// Time of the newest event that it covers, in microseconds; 0 without events.
    pub t_us: i64,
    /// Events in the window.
    pub nodes: u64,
    /// [`SliceHeader::due_ns`] of the oldest slice that it is the first to cover.
    pub due_ns: u64,
    /// [`SliceHeader::published_ns`] of that slice.
    pub published_ns: u64,
    /// When that slice was received, in nanoseconds of the shared clock.
    pub received_ns: u64,
    /// When the prediction was ready, in nanoseconds of the shared clock.
    pub predicted_ns: u64,
    /// 1 if the run has ended; otherwise 0.
    pub end: u64,
}

/// Why a slice is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The sensor has no pixels.
    #[error("expected a sensor with pixels, got {0}")]
    Sensor(Sensor),
    /// A record is no event.
    #[error("record {index}: expected polarity 0 or 1 and three zeros, got {polarity} and {zero:?}")]
    Record {
        /// Number of the record in its slice.
        index: usize,
        /// Its polarity.
        polarity: i8,
        /// Its last bytes.
        zero: [u8; 3],
    },
    /// It says that it is the end, and has events, or the other way round.
    #[error("expected events, or an end without events, got {events} events with end = {end}")]
    End {
        /// Events.
        events: usize,
        /// The mark.
        end: u32,
    },
    /// It was seen before, or counted as lost.
    #[error("slice {found} of its run comes too late")]
    Repeated {
        /// Its number.
        found: u64,
    },
}

/// Checks the header of a slice of so many events by itself.
///
/// # Errors
/// The first reason to refuse it.
pub fn check(header: &SliceHeader, events: usize) -> Result<Sensor, Malformed> {
    let &SliceHeader { width, height, end, .. } = header;
    let sensor = Sensor::new(width, height);
    if width == 0 || height == 0 {
        return Err(Malformed::Sensor(sensor));
    }
    if end > 1 || (end == 1) != (events == 0) {
        return Err(Malformed::End { events, end });
    }
    Ok(sensor)
}

/// Checks the records of a slice.
///
/// # Errors
/// The first one that is no event.
pub fn check_records(records: &[EventRecord]) -> Result<(), Malformed> {
    records.iter().enumerate().try_for_each(|(index, record)| {
        let EventRecord { polarity, zero, .. } = *record;
        record.event().map(drop).ok_or(Malformed::Record { index, polarity, zero })
    })
}

#[cfg(test)]
mod tests {
    use meissner_engine::{Event, Sensor};

    use super::{EventRecord, Malformed, PredictionHeader, SliceHeader, check, check_records};

    #[test]
    fn a_record_is_that_of_meissner_send() {
        let event = Event::new(-513, 3, 4, true);
        let EventRecord { t_us, x, y, polarity, zero } = event.into();
        let mut bytes = t_us.to_le_bytes().to_vec();
        bytes.extend([x.to_le_bytes(), y.to_le_bytes()].concat());
        bytes.push(polarity as u8);
        bytes.extend(zero);
        assert_eq!(bytes, meissner_io::record(event));
        assert_eq!(EventRecord::from(event).event(), Some(event));
    }

    #[test]
    fn no_byte_belongs_to_no_field() {
        assert_eq!(size_of::<EventRecord>(), 16);
        assert_eq!(size_of::<SliceHeader>(), 5 * 8 + 2 * 2 + 4);
        assert_eq!(size_of::<PredictionHeader>(), 12 * 8);
    }

    #[test]
    fn garbage_is_refused_with_its_reason() {
        let header = SliceHeader { width: 4, height: 4, ..SliceHeader::default() };
        let good = EventRecord::from(Event::new(1, 2, 3, false));
        assert_eq!(check(&header, 3), Ok(Sensor::new(4, 4)));
        let flat = SliceHeader { height: 0, ..header };
        assert_eq!(check(&flat, 1), Err(Malformed::Sensor(Sensor::new(4, 0))));
        let bad = EventRecord { zero: [0, 7, 0], ..good };
        let expected = Malformed::Record { index: 1, polarity: 0, zero: [0, 7, 0] };
        assert_eq!((check_records(&[good; 3]), check_records(&[good, bad])), (Ok(()), Err(expected)));
        let bad = EventRecord { polarity: -1, ..good };
        assert_eq!(check_records(&[bad]), Err(Malformed::Record { index: 0, polarity: -1, zero: [0; 3] }));
        assert_eq!(check(&header, 0), Err(Malformed::End { events: 0, end: 0 }));
        let end = SliceHeader { end: 1, ..header };
        assert_eq!(check(&end, 0), Ok(Sensor::new(4, 4)));
        assert_eq!(check(&end, 1), Err(Malformed::End { events: 1, end: 1 }));
        let end = SliceHeader { end: 2, ..header };
        assert_eq!(check(&end, 0), Err(Malformed::End { events: 0, end: 2 }));
    }
}
