//! DAT of version 2, read and written.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, Place, decode, decode_with};
use proptest::prelude::*;

use crate::support::{encoded, sorted_events, strictly};

/// A file with this header, type and size, and these pairs of words.
fn dat(header: &str, kind: [u8; 2], words: &[[u32; 2]]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(kind);
    bytes.extend(words.iter().flatten().flat_map(|word| word.to_le_bytes()));
    bytes
}

const HEADER: &str = "% Height 720\n% Version 2\n% Width 1280\n";
const CD: [u8; 2] = [0x0c, 8];

#[test]
fn an_event_is_a_time_and_a_packed_pixel() {
    let recording = decode(&dat(HEADER, CD, &[[5856, 1 << 28 | 0x13b << 14 | 0x1e4]])).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Dat, Some(Sensor::new(1280, 720))));
    assert_eq!(recording.events, [Event::new(5856, 484, 315, true)]);
}

#[test]
fn the_time_goes_on_where_its_32_bits_wrap_and_a_small_step_back_is_no_wrap() {
    let recording = decode(&dat(HEADER, CD, &[[u32::MAX, 0], [u32::MAX - 9, 0], [3, 0]])).unwrap();
    let times: Vec<_> = recording.events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [(1 << 32) - 1, (1 << 32) - 10, (1 << 32) + 3]);
}

#[test]
fn another_version_is_refused() {
    let error = decode(&dat("% Version 1\n", CD, &[])).unwrap_err();
    assert_eq!(error.to_string(), "unsupported: expected DAT of version 2, found version 1");
    let error = decode_with(&dat("", CD, &[]), Format::Dat).unwrap_err();
    assert_eq!(error.to_string(), "unsupported: expected DAT of version 2, found no version");
}

#[test]
fn another_type_or_size_of_events_is_refused() {
    for kind in [[0x0e, 8], [0x0c, 16]] {
        let error = decode(&dat(HEADER, kind, &[])).unwrap_err();
        assert!(matches!(error, IoError::Malformed { place: Place::Byte(38), .. }), "{error}");
    }
}

#[test]
fn a_polarity_above_one_is_refused_by_a_strict_reader() {
    let error = strictly(&dat(HEADER, CD, &[[0, 0], [0, 2 << 28]])).unwrap_err();
    assert_eq!(error.to_string(), "DAT: polarity at byte 48: expected 0 or 1, found 2");
}

#[test]
fn an_event_beside_the_sensor_is_refused_by_a_strict_reader() {
    let error = strictly(&dat(HEADER, CD, &[[0, 720 << 14]])).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { x: 0, y: 720, .. }), "{error}");
}

proptest! {
    #[test]
    fn every_event_comes_back(events in sorted_events((1 << 32) - 1, 1 << 14)) {
        let recording = decode(&encoded(Format::Dat, None, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (None, events));
    }
}
