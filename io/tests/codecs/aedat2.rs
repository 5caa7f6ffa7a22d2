//! AEDAT 2.0: chips, addresses, time and header.

use meissner_engine::{Event, Sensor};
use meissner_io::limits::JAER_HEADER_BYTES;
use meissner_io::{Format, IoError, Place, StreamKind, decode, decode_with};
use proptest::prelude::*;

use crate::support::aedat::{DAVIS346, aedat2, davis_records, dvs128_records};
use crate::support::{SENSOR, sorted_events, strictly};

const CHIP: &str = "AEChip: eu.seebetter.ini.chips.davis.Davis346B";

#[test]
fn an_address_of_a_davis_is_mirrored_to_the_left_and_the_top() {
    let address = 2 << 22 | 3 << 12 | 1 << 11;
    let recording = decode(&aedat2(&DAVIS346, &[[address, 77], [address & !(1 << 11), 78]])).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Aedat2, Some(SENSOR)));
    assert_eq!(recording.events, [Event::new(77, 342, 257, true), Event::new(78, 342, 257, false)]);
}

#[test]
fn an_address_of_a_dvs128_is_mirrored_and_a_clear_bit_is_a_rise() {
    let address = 2 << 8 | 3 << 1;
    let records = [[address, 5], [address | 1, 6], [1 << 15, 7]];
    for lines in [&["AEChip: ch.unizh.ini.jaer.chip.retina.DVS128"][..], &["no chip is named"]] {
        let recording = decode(&aedat2(lines, &records)).unwrap();
        assert_eq!(recording.sensor, Some(Sensor::new(128, 128)));
        assert_eq!(recording.events, [Event::new(5, 124, 125, true), Event::new(6, 124, 125, false)]);
        let [external] = &recording.other_streams[..] else { panic!("{:?}", recording.other_streams) };
        assert_eq!((external.kind, external.elements), (StreamKind::Triggers, 1));
    }
}

#[test]
fn every_chip_has_its_pixels() {
    for (chip, width, height) in [
        ("DAVIS240C", 240, 180),
        ("Davis640", 640, 480),
        ("Davis128", 128, 128),
        ("Davis208PixelParade", 208, 192),
    ] {
        let line = format!("AEChip: eu.seebetter.ini.chips.davis.{chip}");
        let recording = decode(&aedat2(&[&line], &[[0, 0]])).unwrap();
        assert_eq!(recording.sensor, Some(Sensor::new(width, height)), "{chip}");
        assert_eq!(recording.events, [Event::new(0, width - 1, height - 1, false)], "{chip}");
    }
    let error = decode(&aedat2(&["AEChip: net.sf.jaer.Cochlea"], &[])).unwrap_err().to_string();
    assert!(error.starts_with("AEDAT2: AEChip at byte 14: expected DVS128, DAVIS128,"), "{error}");
    assert!(error.ends_with("found `net.sf.jaer.Cochlea`"), "{error}");
}

#[test]
fn frames_imu_and_external_events_are_counted() {
    let words = [1 << 31, 1 << 31 | 1 << 10, 1 << 31 | 3 << 10, 1 << 10, 3 << 10, 0];
    let recording = decode(&aedat2(&DAVIS346, &words.map(|word| [word, 9]))).unwrap();
    let counts: Vec<_> = recording.other_streams.iter().map(|s| (s.name.as_str(), s.elements)).collect();
    assert_eq!(counts, [("external events", 2), ("values of frames", 2), ("values of the IMU", 1)]);
    assert_eq!(recording.events.len(), 1);
}

#[test]
fn the_time_goes_on_where_its_32_bits_wrap_and_a_small_step_back_is_no_wrap() {
    // The value of a frame carries the clock over the wrap, too.
    let records = [[0, u32::MAX], [0, u32::MAX - 9], [1 << 31, 3], [0, 5]];
    let recording = decode(&aedat2(&DAVIS346, &records)).unwrap();
    let times: Vec<_> = recording.events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [(1 << 32) - 1, (1 << 32) - 10, (1 << 32) + 5]);
}

#[test]
fn the_header_ends_before_an_event_that_starts_like_a_line() {
    // Rows 140 and 141 of a DAVIS start with the byte of `#`.
    let event = Event::new(1_000, 3, 259 - 140, true);
    let records = davis_records(SENSOR, &[event; 2]);
    assert_eq!(records[0][0] >> 24, u32::from(b'#'));
    for lines in [&DAVIS346[..], &[CHIP]] {
        assert_eq!(decode(&aedat2(lines, &records)).unwrap().events, [event; 2]);
    }
}

#[test]
fn a_header_that_is_cut_in_a_line_is_refused_as_cut() {
    let bytes = aedat2(&[CHIP], &[]);
    for length in [13, 20, bytes.len() - 1] {
        let error = decode(&bytes[..length]).unwrap_err();
        assert!(matches!(error, IoError::Truncated { .. }), "{length}: {error}");
    }
    let long = [bytes, vec![b'#'; JAER_HEADER_BYTES as usize], b"\n".to_vec()].concat();
    let error = decode(&long).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { limit: JAER_HEADER_BYTES, .. }), "{error}");
}

#[test]
fn addresses_that_no_named_chip_has_are_refused_by_a_strict_reader() {
    let error = decode(&aedat2(&["no chip"], &[[0, 0], [1 << 16, 0]])).unwrap_err().to_string();
    assert!(error.ends_with(
        "expected the 16 bits of a DVS128, or a header or an option that names the chip, found 0x00010000"
    ));
    let error = strictly(&aedat2(&DAVIS346, &[[346 << 12, 0]])).unwrap_err();
    let start = aedat2(&DAVIS346, &[]).len() as u64;
    assert!(
        matches!(error, IoError::OutsideSensor { x: 346, place: Place::Byte(at), .. } if at == start),
        "{error}"
    );
    assert_eq!(decode(&aedat2(&["no chip"], &[])).unwrap().sensor, None);
}

#[test]
fn a_file_without_its_magic_is_refused() {
    let error = decode_with(b"% evt 3.0\n% end\n", Format::Aedat2).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "magic", .. }), "{error}");
}

proptest! {
    #[test]
    fn every_event_comes_back(events in sorted_events((1 << 32) - 1, 128)) {
        let davis = decode(&aedat2(&DAVIS346, &davis_records(SENSOR, &events))).unwrap();
        prop_assert_eq!(&davis.events, &events);
        let dvs128 = decode(&aedat2(&["AEChip: DVS128"], &dvs128_records(&events))).unwrap();
        prop_assert_eq!(dvs128.events, events);
    }
}
