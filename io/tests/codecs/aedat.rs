//! AEDAT 2.0 and 3.1.

use meissner_engine::{Event, Sensor};
use meissner_io::limits::JAER_HEADER_BYTES;
use meissner_io::{Format, IoError, Place, StreamKind, decode, decode_with};
use proptest::prelude::*;

use meissner_io_tests::codecs::aedat::{DAVIS346, aedat2, davis_records, dvs128_records};
use meissner_io_tests::codecs::{SENSOR, sorted_events, strictly};

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
    // The value of a frame also carries the clock over the wrap.
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

mod aedat3 {
    //! AEDAT 3.1: header, packets, valid bits and time.

    use meissner_engine::{Event, Sensor};
    use meissner_io::limits::HEADER_BYTES;
    use meissner_io::{Format, IoError, Place, StreamKind, decode, decode_with};
    use proptest::prelude::*;

    use meissner_io_tests::codecs::aedat::{aedat3, aedat3_events, aedat3_header, aedat3_packet};
    use meissner_io_tests::codecs::{SENSOR, events, sorted_events, strictly};

    /// A file of a DVS128 with these packets.
    fn dvs128(packets: &[Vec<u8>]) -> Vec<u8> {
        [aedat3_header(1, "DVS128"), packets.concat()].concat()
    }

    #[test]
    fn an_event_is_a_packed_pixel_and_a_time_after_the_overflows() {
        let data = 5_u32 << 17 | 9 << 2 | 1 << 1 | 1;
        let content = [data.to_le_bytes(), 77_i32.to_le_bytes()].concat();
        let recording = decode(&dvs128(&[aedat3_packet(1, 1, 8, 3, &content)])).unwrap();
        assert_eq!((recording.format, recording.sensor), (Format::Aedat3, Some(Sensor::new(128, 128))));
        assert_eq!(recording.events, [Event::new((3 << 31) + 77, 5, 9, true)]);
    }

    #[test]
    fn events_not_marked_as_valid_other_types_and_other_sources_are_counted() {
        let mut content = aedat3_events(&[Event::new(1, 1, 1, true), Event::new(2, 2, 2, false)]);
        content[0] &= !1;
        let recording = decode(&dvs128(&[
            aedat3_packet(0, 1, 8, 0, &[0; 24]),
            aedat3_packet(1, 1, 8, 0, &content),
            aedat3_packet(1, 2, 8, 0, &content),
            aedat3_packet(3, 1, 36, 0, &[0; 72]),
            aedat3_packet(2, 1, 50, 0, &[0; 50]),
            aedat3_packet(12, 1, 8, 0, &[]),
        ]))
        .unwrap();
        assert_eq!(recording.events, [Event::new(2, 2, 2, false)]);
        let counts: Vec<_> = recording
            .other_streams
            .iter()
            .map(|s| (s.name.as_str(), s.kind, s.packets, s.elements))
            .collect();
        let expected = [
            ("IMU", StreamKind::Imu, 1, 2),
            ("events not marked as valid", StreamKind::Other, 1, 1),
            ("events of another source", StreamKind::Events, 1, 2),
            ("frames", StreamKind::Frames, 1, 1),
            ("packets of another type", StreamKind::Other, 1, 0),
            ("special events", StreamKind::Triggers, 1, 3),
        ];
        assert_eq!(counts, expected);
    }

    #[test]
    fn the_sensor_is_that_of_the_source_of_the_first_events() {
        let header = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 0: DAVIS240C\r\n#Source 7: DVS128\r\n#-Source 7: DAVIS346\r\n#!END-HEADER\r\n";
        let packet = |source| aedat3_packet(1, source, 8, 0, &aedat3_events(&[Event::new(0, 1, 1, true)]));
        for (source, sensor) in
            [(0, Some(Sensor::new(240, 180))), (7, Some(Sensor::new(128, 128))), (3, None)]
        {
            let recording = decode(&[header.to_vec(), packet(source)].concat()).unwrap();
            assert_eq!((recording.sensor, recording.events.len()), (sensor, 1));
        }
    }

    #[test]
    fn another_format_of_packets_is_refused_by_its_name() {
        let error = decode(b"#!AER-DAT3.1\r\n#Format: SerializedTS\r\n#!END-HEADER\r\n").unwrap_err();
        let expected = "unsupported: expected AEDAT 3.1 of format RAW, found format `SerializedTS`";
        assert_eq!(error.to_string(), expected);
        let error = decode(&dvs128(&[aedat3_packet(i16::MIN | 1, 1, 8, 0, &[0; 8])])).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "type of a packet", .. }), "{error}");
    }

    #[test]
    fn headers_without_an_end_or_with_another_line_are_refused() {
        let error = decode(b"#!AER-DAT3.1\r\n#Format: RAW\r\n").unwrap_err();
        assert!(matches!(error, IoError::Truncated { at_least: true, .. }), "{error}");
        let error = decode(b"#!AER-DAT3.1\r\nFormat: RAW\r\n#!END-HEADER\r\n").unwrap_err();
        assert!(matches!(error, IoError::Malformed { place: Place::Byte(14), .. }), "{error}");
        let long = [&b"#!AER-DAT3.1\r\n"[..], &b"# more\r\n".repeat(HEADER_BYTES as usize / 8)].concat();
        let error = decode(&[&long, &b"#!END-HEADER\r\n"[..]].concat()).unwrap_err();
        assert!(matches!(error, IoError::TooLarge { limit: HEADER_BYTES, .. }), "{error}");
    }

    #[test]
    fn absurd_numbers_in_a_packets_header_are_refused() {
        let start = aedat3_header(1, "DVS128").len();
        let packet = aedat3_packet(1, 1, 8, 0, &aedat3_events(&events()[..2]));
        for (place, what) in [
            (4, "size of an event"),
            (8, "place of the time"),
            (12, "overflows of the clock"),
            (20, "number of events"),
        ] {
            let mut bytes = dvs128(std::slice::from_ref(&packet));
            bytes[start + place..start + place + 4].copy_from_slice(&(-1_i32).to_le_bytes());
            let error = decode(&bytes).unwrap_err();
            assert!(
                matches!(error, IoError::Malformed { what: found, .. } if found == what),
                "{what}: {error}"
            );
        }
        let mut bytes = dvs128(std::slice::from_ref(&packet));
        bytes[start + 20..start + 24].copy_from_slice(&i32::MAX.to_le_bytes());
        let error = decode(&bytes).unwrap_err();
        assert!(matches!(error, IoError::Truncated { what: "packet", actual: 16, .. }), "{error}");
        let error = decode(&dvs128(&[aedat3_packet(1, 1, 12, 0, &[0; 12])])).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "layout of an event", .. }), "{error}");
    }

    #[test]
    fn a_negative_time_and_a_pixel_beside_the_sensor_are_refused_by_a_strict_reader() {
        let event = |data: u32, time: i32| {
            strictly(&dvs128(&[aedat3_packet(
                1,
                1,
                8,
                0,
                &[data.to_le_bytes(), time.to_le_bytes()].concat(),
            )]))
        };
        let error = event(1, -1).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "time of an event", .. }), "{error}");
        event(0, -1).expect("it is not valid, so nothing is read of it");
        let error = event(128 << 17 | 1, 0).unwrap_err();
        assert!(matches!(error, IoError::OutsideSensor { x: 128, .. }), "{error}");
    }

    #[test]
    fn steps_back_in_time_stay_as_they_are() {
        let all = [50, 20, 60].map(|t_us| Event::new(t_us, 0, 0, true));
        assert_eq!(decode(&aedat3(&all, 2)).unwrap().events, all);
    }

    #[test]
    fn a_file_without_its_magic_is_refused() {
        let error = decode_with(b"#!AER-DAT3.0\r\n#!END-HEADER\r\n", Format::Aedat3).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "magic", .. }), "{error}");
    }

    proptest! {
        #[test]
        fn every_event_comes_back(events in sorted_events(1 << 34, 260), most in 1..9_usize) {
            let recording = decode(&aedat3(&events, most)).unwrap();
            prop_assert_eq!(recording.sensor.is_some(), !events.is_empty());
            prop_assert!(recording.sensor.is_none_or(|sensor| sensor == SENSOR));
            prop_assert_eq!(recording.events, events);
        }
    }
}
