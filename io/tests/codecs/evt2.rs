//! EVT2: words of 32 bits.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, Kind, Place, StreamKind, decode};
use proptest::prelude::*;

use crate::support::{evt2, evt2_words, sorted_events, strictly};

const HEADER: &str = "% evt 2.0\n";

#[test]
fn an_event_has_the_time_words_bits_above_its_own_six() {
    let bytes = evt2(HEADER, &[0x8000_0003, 0x1000_0000 | 5 << 22 | 7 << 11 | 9]);
    let recording = decode(&bytes).unwrap();
    assert_eq!(recording.format, Format::Evt2);
    assert_eq!(recording.sensor, None);
    assert_eq!(recording.events, [Event::new(3 * 64 + 5, 7, 9, true)]);
}

#[test]
fn the_time_goes_on_where_its_34_bits_wrap() {
    let bytes = evt2(HEADER, &[0x8fff_ffff, 0, 0x8000_0000, 0]);
    let times: Vec<_> = decode(&bytes).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [(1 << 34) - 64, 1 << 34]);
}

#[test]
fn a_small_backward_step_of_the_time_word_is_not_a_wrap() {
    let bytes = evt2(HEADER, &[0x8000_0005, 0, 0x8000_0004, 0]);
    let times: Vec<_> = decode(&bytes).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [5 * 64, 4 * 64]);
}

#[test]
fn triggers_vendor_words_and_events_without_a_time_are_counted() {
    let bytes = evt2(HEADER, &[0, 0x1000_0000, 0x8000_0001, 0xa000_0000, 0xe000_0000, 0xf000_0000, 0]);
    let recording = decode(&bytes).unwrap();
    assert_eq!(recording.events.len(), 1);
    let counts: Vec<_> = recording.other_streams.iter().map(|s| (s.kind, s.elements)).collect();
    assert_eq!(counts, [(StreamKind::Triggers, 1), (StreamKind::Other, 2), (StreamKind::Unplaced, 2)]);
}

#[test]
fn a_reserved_word_is_refused_with_its_byte_by_a_strict_reader() {
    let bytes = evt2(HEADER, &[0x8000_0001, 0x5000_0000]);
    let error = strictly(&bytes).unwrap_err();
    assert_eq!(
        error.to_string(),
        "EVT2: type of a word at byte 14: expected 0x0, 0x1, 0x8, 0xa, 0xe or 0xf, found 0x5"
    );
}

#[test]
fn an_event_beside_the_sensor_of_the_header_is_refused_by_a_strict_reader() {
    let header = "% evt 2.0\n% geometry 640x480\n% end\n";
    let bytes = evt2(header, &[0x8000_0001, 640 << 11]);
    let error = strictly(&bytes).unwrap_err();
    let IoError::OutsideSensor { place, x: 640, y: 0, .. } = error else { panic!("{error}") };
    assert_eq!(place, Place::Byte(header.len() as u64 + 4));
}

#[test]
fn the_format_line_names_encoding_and_geometry() {
    let bytes = evt2("% format EVT2;height=480;width=640\n% end\n", &[]);
    assert_eq!(decode(&bytes).unwrap().sensor, Some(Sensor::new(640, 480)));
}

#[test]
fn evt_2_1_is_named_in_the_refusal() {
    for header in ["% evt 2.1\n", "% format EVT21;height=320;width=320\n"] {
        let error = decode(&evt2(header, &[0x8000_0001])).unwrap_err();
        assert!(
            matches!(&error, IoError::OtherKind { found: Kind::Foreign(f), .. } if f.name.contains("2.1")),
            "{error}"
        );
    }
}

proptest! {
    #[test]
    fn every_event_comes_back(events in sorted_events((1 << 34) - 1, 2048)) {
        prop_assert_eq!(decode(&evt2(HEADER, &evt2_words(&events))).unwrap().events, events);
    }
}
