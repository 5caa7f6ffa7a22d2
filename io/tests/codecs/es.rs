//! Event Stream 2, read and written.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, decode, decode_with, encode};
use proptest::prelude::*;

use crate::support::{SENSOR, encoded, sorted_events, strictly};

/// A file of 4 x 3 pixels with this version, this type and this content.
fn es(version: [u8; 3], kind: u8, content: &[u8]) -> Vec<u8> {
    [&b"Event Stream"[..], &version, &[kind, 4, 0, 3, 0], content].concat()
}

#[test]
fn an_event_is_a_step_of_time_with_its_polarity_and_a_pixel_from_the_bottom() {
    let content = [2 << 1 | 1, 3, 0, 2, 0, 0xff, 0xff, 126 << 1, 0, 0, 1, 0];
    let recording = decode(&es([2, 0, 0], 1, &content)).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Es, Some(Sensor::new(4, 3))));
    assert_eq!(recording.events, [Event::new(2, 3, 0, true), Event::new(2 + 2 * 127 + 126, 0, 1, false)]);
}

#[test]
fn resets_and_overflows_at_the_end_say_nothing() {
    let content = [0xfe, 0xfe, 1, 0, 0, 0, 0, 0xfe, 0xff];
    assert_eq!(decode(&es([2, 1, 9], 1, &content)).unwrap().events, [Event::new(0, 0, 2, true)]);
}

#[test]
fn other_versions_and_types_are_refused_by_name() {
    let error = decode(&es([1, 0, 0], 1, &[])).unwrap_err().to_string();
    assert_eq!(error, "unsupported: expected Event Stream of version 2, found version 1.0.0");
    let error = decode(&es([2, 0, 0], 2, &[])).unwrap_err().to_string();
    assert_eq!(
        error,
        "unsupported: expected Event Stream of DVS events (type 1), found type 2 (ATIS events)"
    );
    let error = decode(&es([2, 0, 0], 9, &[])).unwrap_err().to_string();
    assert!(error.ends_with("type 9 (unknown)"), "{error}");
}

#[test]
fn a_cut_event_a_pixel_beside_the_sensor_and_an_empty_sensor_are_refused() {
    let error = decode(&es([2, 0, 0], 1, &[0, 0, 0])).unwrap_err();
    assert!(
        matches!(error, IoError::Truncated { what: "the last event", expected: 5, actual: 3, .. }),
        "{error}"
    );
    let error = strictly(&es([2, 0, 0], 1, &[0, 4, 0, 0, 0])).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { x: 4, .. }), "{error}");
    let mut empty = es([2, 0, 0], 1, &[]);
    empty[16] = 0;
    assert!(matches!(decode(&empty), Err(IoError::Malformed { what: "sensor", .. })));
    let error = decode_with(b"Event Scream\x02", Format::Es).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "magic", .. }), "{error}");
}

#[test]
fn a_writer_refuses_a_step_back_a_late_time_and_no_sensor() {
    let at = |t_us| Event::new(t_us, 0, 0, true);
    let refuse = |sensor, events: &[Event]| {
        let mut bytes = Vec::new();
        let error = encode(Format::Es, sensor, events, &mut bytes).unwrap_err();
        assert!(bytes.is_empty());
        error.to_string()
    };
    let error = refuse(Some(SENSOR), &[at(5), at(4)]);
    assert_eq!(error, "ES cannot hold event 1: expected t_us in order, found 4 after 5");
    assert!(refuse(Some(SENSOR), &[at(1 << 33)]).contains("expected t_us 0 to 8589934591"));
    assert_eq!(
        refuse(None, &[at(0)]),
        "unsupported: expected a sensor, which a file of ES must name, found none"
    );
}

#[test]
fn a_silence_of_any_length_comes_back() {
    for silence in [126, 127, 128, 4096 * 127 - 1, 4096 * 127, 4096 * 127 + 1, (1 << 33) - 1] {
        let events = [Event::new(0, 1, 2, true), Event::new(silence, 3, 4, false)];
        let bytes = encoded(Format::Es, Some(SENSOR), &events);
        assert_eq!(bytes.len() as i64, 20 + 5 + silence / 127 + 5, "{silence} us");
        assert_eq!(decode(&bytes).unwrap().events, events, "{silence} us");
    }
}

proptest! {
    #[test]
    fn every_event_comes_back(events in sorted_events(3_000_000, 4096)) {
        let sensor = Some(Sensor::new(4096, 4096));
        let recording = decode(&encoded(Format::Es, sensor, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (sensor, events));
    }
}
