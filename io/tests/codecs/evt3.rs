//! EVT3: words of 16 bits, read and written.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, Place, StreamKind, decode};
use proptest::prelude::*;

use crate::support::{encoded, evt3, sorted_events, strictly};

const HEADER: &str = "% evt 3.0\n";

fn times(words: &[u16]) -> Vec<i64> {
    decode(&evt3(HEADER, words)).unwrap().events.iter().map(|e| e.t_us).collect()
}

#[test]
fn an_event_has_the_newest_time_and_row() {
    let bytes = evt3(HEADER, &[0x8001, 0x6002, 0x0003, 0x2804, 0x2005]);
    let recording = decode(&bytes).unwrap();
    assert_eq!(recording.format, Format::Evt3);
    assert_eq!(recording.events, [Event::new(4098, 4, 3, true), Event::new(4098, 5, 3, false)]);
}

#[test]
fn a_small_backward_step_of_time_low_is_not_a_wrap() {
    assert_eq!(times(&[0x8001, 0x0000, 0x632b, 0x2000, 0x6320, 0x2000]), [4096 + 0x32b, 4096 + 0x320]);
}

#[test]
fn the_time_goes_on_where_its_24_bits_wrap() {
    assert_eq!(
        times(&[0x8fff, 0x6fff, 0x0000, 0x2000, 0x8000, 0x6001, 0x2000]),
        [(1 << 24) - 1, (1 << 24) + 1]
    );
}

#[test]
fn a_new_time_high_does_not_keep_the_old_time_low() {
    assert_eq!(times(&[0x8001, 0x6fff, 0x0000, 0x8002, 0x2000]), [2 * 4096]);
}

#[test]
fn a_repeated_time_high_keeps_the_time_low() {
    assert_eq!(times(&[0x8001, 0x6abc, 0x0000, 0x8001, 0x2000]), [4096 + 0xabc]);
}

#[test]
fn vectors_set_events_from_a_base_that_moves_on() {
    let bytes = evt3(HEADER, &[0x8000, 0x6000, 0x0007, 0x3864, 0x4801, 0x5082, 0x5001]);
    let recording = decode(&bytes).unwrap();
    let pixels: Vec<_> = recording.events.iter().map(|e| (e.x, e.y, e.on)).collect();
    let expected = [100, 111, 113, 119, 120].map(|x| (x, 7, true));
    assert_eq!(pixels, expected);
}

#[test]
fn a_vector_that_runs_off_the_sensor_is_refused_only_where_it_has_an_event() {
    let header = "% evt 3.0\n% geometry 10x10\n% end\n";
    let start = [0x8000, 0x6000, 0x0000, 0x3008];
    let inside = evt3(header, &[&start[..], &[0x4003, 0x4000, 0x4000]].concat());
    assert_eq!(decode(&inside).unwrap().events.len(), 2);
    let outside = evt3(header, &[&start[..], &[0x4007]].concat());
    let error = strictly(&outside).unwrap_err();
    let IoError::OutsideSensor { place, x: 10, y: 0, .. } = error else { panic!("{error}") };
    assert_eq!(place, Place::Byte(header.len() as u64 + 8));
}

#[test]
fn vectors_without_end_do_not_overflow_the_column() {
    let mut words = vec![0x8000, 0x6000, 0x0000, 0x3000];
    words.extend(std::iter::repeat_n(0x4000, 100_000));
    words.push(0x4001);
    let error = strictly(&evt3(HEADER, &words)).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { x: 65_535, .. }), "{error}");
}

#[test]
fn what_has_no_place_yet_is_refused_by_a_strict_reader() {
    for words in [&[0x8000, 0x6000, 0x0000, 0x4001][..], &[0x0000, 0x2001], &[0x8000, 0x2001]] {
        let error = strictly(&evt3(HEADER, words)).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "event", .. }), "{error}");
    }
}

#[test]
fn an_event_in_a_row_beside_the_sensor_is_refused_by_a_strict_reader() {
    let error =
        strictly(&evt3("% evt 3.0\n% geometry 10x10\n% end\n", &[0x8000, 0x000a, 0x2003])).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { x: 3, y: 10, .. }), "{error}");
}

#[test]
fn triggers_vendor_words_and_events_without_a_place_are_counted() {
    let words = [0x0001, 0x2000, 0x3000, 0x4fff, 0x8000, 0x6000, 0xa100, 0xe123, 0x7001, 0xf002, 0x2000];
    let recording = decode(&evt3(HEADER, &words)).unwrap();
    assert_eq!(recording.events.len(), 1);
    let counts: Vec<_> = recording.other_streams.iter().map(|s| (s.kind, s.packets, s.elements)).collect();
    assert_eq!(
        counts,
        [(StreamKind::Triggers, 1, 1), (StreamKind::Other, 1, 1), (StreamKind::Unplaced, 2, 13)]
    );
}

#[test]
fn a_reserved_word_is_refused_with_its_byte_by_a_strict_reader() {
    let error = strictly(&evt3(HEADER, &[0x8000, 0x9000])).unwrap_err();
    assert_eq!(
        error.to_string(),
        "EVT3: type of a word at byte 12: expected 0x0 to 0x8, 0xa, 0xe or 0xf, found 0x9"
    );
}

#[test]
fn the_binary_part_may_start_as_a_comment_does_after_the_end_line() {
    let bytes = evt3("% evt 3.0\n% end\n", &[0x2025, 0x8000]);
    assert_eq!(decode(&bytes).unwrap().other_streams[0].kind, StreamKind::Unplaced);
}

#[test]
fn a_geometry_that_is_none_is_refused_with_its_line() {
    for (geometry, actual) in
        [("0x720", "0"), ("1280", ""), ("1280x9223372036854775808", "9223372036854775808")]
    {
        let bytes = evt3(&format!("% evt 3.0\n% geometry {geometry}\n% end\n"), &[]);
        let error = decode(&bytes).unwrap_err();
        let IoError::Malformed { place, actual: found, .. } = &error else { panic!("{error}") };
        assert_eq!((*place, found.as_str()), (Place::Byte(10), format!("`{actual}`").as_str()));
    }
}

proptest! {
    #[test]
    fn every_event_in_order_comes_back(events in sorted_events((1 << 40) - 1, 2048)) {
        let recording = decode(&encoded(Format::Evt3, None, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (None, events));
    }

    #[test]
    fn small_steps_back_come_back(
        start in 0..(1_i64 << 24) - 100_000,
        steps in prop::collection::vec(-500..900_i64, 0..100),
    ) {
        let mut t = start + 50_000;
        let events: Vec<_> = steps.iter().map(|step| { t += step; Event::new(t, 1, 2, true) }).collect();
        prop_assume!(events.iter().all(|e| (0..1 << 24).contains(&e.t_us)));
        let sensor = Some(Sensor::new(1280, 720));
        let recording = decode(&encoded(Format::Evt3, sensor, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (sensor, events));
    }
}
