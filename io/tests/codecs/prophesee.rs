//! Formats of Prophesee: DAT, EVT 2.0, EVT 3.0, and event packets of ROS 2.

use meissner_engine::{Event, Sensor};
use meissner_io::{EventPackets, Format, IoError, LeftOutKind, Place, decode, decode_with, encode};
use proptest::prelude::*;

use meissner_io_tests::codecs::{encoded, sorted_events, strictly};

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

const SENSOR: Sensor = Sensor { width: 640, height: 480 };

/// The words of a file of these events, without its header.
fn words(events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(Format::Evt3, Some(SENSOR), events, &mut bytes).expect("events that EVT3 can hold");
    let end = b"% end\n";
    let header = bytes.windows(end.len()).position(|window| window == end).expect("a header") + end.len();
    bytes.split_off(header)
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    prop::collection::vec((0..40_000_i64, 0..640_u16, 0..480_u16, any::<bool>()), 0..200).prop_map(|found| {
        let mut now = 0;
        let event = |(step, x, y, on)| {
            now += step;
            Event::new(now, x, y, on)
        };
        found.into_iter().map(event).collect()
    })
}

proptest! {
    #[test]
    fn evt3_in_messages_that_end_after_any_word_gives_the_events(events in events(), cuts in prop::collection::vec(0..600_usize, 0..6)) {
        let words = words(&events);
        let mut cuts: Vec<usize> = cuts.into_iter().map(|cut| (2 * cut).min(words.len())).collect();
        cuts.extend([0, words.len()]);
        cuts.sort_unstable();
        let mut packets = EventPackets::new("evt3", SENSOR).expect("a known encoding");
        let mut found = Vec::new();
        for ends in cuts.windows(2) {
            found.extend_from_slice(packets.decode(7, &words[ends[0]..ends[1]]).expect("whole words"));
        }
        prop_assert_eq!(found, events);
    }

    #[test]
    fn mono_gives_the_events_after_the_time_base(events in events(), base_us in 0..1_000_000_000_000_u64) {
        let event = |e: &Event| {
            let bits = u64::from(e.on) << 63 | u64::from(e.y) << 48 | u64::from(e.x) << 32;
            // Times within a message span 4 s.
            bits | (e.t_us as u64 % 4_000_000 * 1000)
        };
        let bytes: Vec<u8> = events.iter().flat_map(|e| event(e).to_le_bytes()).collect();
        let mut packets = EventPackets::new("mono", SENSOR).expect("a known encoding");
        let expected: Vec<Event> =
            events.iter().map(|e| Event::new(base_us as i64 + e.t_us % 4_000_000, e.x, e.y, e.on)).collect();
        prop_assert_eq!(packets.decode(base_us * 1000, &bytes).expect("on the sensor"), &expected[..]);
    }

    #[test]
    fn any_bytes_give_events_on_the_sensor_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300), evt3: bool, base: u64) {
        let mut packets = EventPackets::new(if evt3 { "evt3" } else { "mono" }, SENSOR).expect("a known encoding");
        for _ in 0..2 {
            if let Ok(events) = packets.decode(base, &bytes) {
                prop_assert!(events.iter().all(|event| SENSOR.contains(event.x, event.y)));
            }
        }
    }
}

#[test]
fn what_cannot_be_decoded_is_refused_and_what_is_outside_is_left_out() {
    let error = EventPackets::new("trigger", SENSOR).expect_err("no events");
    assert!(error.to_string().contains("\"trigger\""), "{error}");
    let mut mono = EventPackets::new("mono", SENSOR).expect("a known encoding");
    assert!(matches!(mono.decode(0, &[0; 12]), Err(IoError::Truncated { .. })));
    let outside = (480_u64 << 48).to_le_bytes();
    assert!(mono.decode(0, &outside).expect("left out").is_empty());
    let left_out = mono.left_out();
    assert_eq!((left_out[0].kind, left_out[0].count), (LeftOutKind::OutsideSensor, 1));
    assert_eq!(mono.decode(0, &[0; 8]).expect("the corner"), [Event::new(0, 0, 0, false)]);
}

mod evt2 {
    //! EVT2: words of 32 bits.

    use meissner_engine::{Event, Sensor};
    use meissner_io::{Format, IoError, Place, StreamKind, decode};
    use proptest::prelude::*;

    use meissner_io_tests::codecs::{evt2, evt2_words, sorted_events, strictly};

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

    proptest! {
        #[test]
        fn every_event_comes_back(events in sorted_events((1 << 34) - 1, 2048)) {
            prop_assert_eq!(decode(&evt2(HEADER, &evt2_words(&events))).unwrap().events, events);
        }
    }
}

mod evt21 {
    //! EVT2.1: words of 64 bits.

    use meissner_engine::{Event, Sensor};
    use meissner_io::{Format, IoError, LeftOutKind, Place, StreamKind, decode};
    use proptest::prelude::*;

    use meissner_io_tests::codecs::{evt21, evt21_words, sorted_events, strictly};

    const LITTLE: &str = "% evt 2.1\n% endianness little\n% end\n";
    const LEGACY: &str = "% format EVT21;height=720;width=1280;endianness=legacy\n% end\n";

    #[test]
    fn a_mask_is_an_event_for_each_bit_in_either_order_of_the_halves() {
        // Columns 7, 8 and 38 of row 9, 5 us after the time word.
        let words = [[0x8000_0003, 0], [0x1000_0000 | 5 << 22 | 7 << 11 | 9, 0x8000_0003]];
        let expected = [7, 8, 38].map(|x| Event::new(3 * 64 + 5, x, 9, true));
        for (header, legacy, sensor) in [(LITTLE, false, None), (LEGACY, true, Some(Sensor::new(1280, 720)))]
        {
            let recording = decode(&evt21(header, &words, legacy)).unwrap();
            assert_eq!((recording.format, recording.sensor), (Format::Evt21, sensor));
            assert_eq!(recording.events, expected, "{header}");
        }
    }

    #[test]
    fn bits_beyond_the_sensor_are_left_out_one_by_one() {
        let words = [[0x8000_0000, 0], [1270 << 11 | 9, 0xffff_ffff]];
        let recording = decode(&evt21(LEGACY, &words, true)).unwrap();
        assert_eq!(recording.events.len(), 10);
        assert_eq!(
            (recording.left_out[0].kind, recording.left_out[0].count),
            (LeftOutKind::OutsideSensor, 22)
        );
        let error = strictly(&evt21(LEGACY, &words, true)).unwrap_err();
        let IoError::OutsideSensor { place, x: 1280, y: 9, .. } = error else { panic!("{error}") };
        assert_eq!(place, Place::Byte(LEGACY.len() as u64 + 8));
    }

    #[test]
    fn triggers_vendor_words_and_events_without_a_time_are_counted() {
        let words = [[0, 7], [0xa000_0000, 0], [0xe000_0000, 1], [0xf000_0000, 2], [0x8000_0000, 0], [0, 1]];
        let recording = decode(&evt21(LITTLE, &words, false)).unwrap();
        let counts: Vec<_> = recording.other_streams.iter().map(|s| (s.kind, s.elements)).collect();
        assert_eq!(counts, [(StreamKind::Triggers, 1), (StreamKind::Other, 2), (StreamKind::Unplaced, 3)]);
        assert_eq!(recording.events.len(), 1);
    }

    #[test]
    fn another_order_of_bytes_is_refused_by_its_name() {
        let error = decode(b"% evt 2.1\n% endianness big\n% end\n").unwrap_err().to_string();
        assert!(error.contains("order of bytes at byte 10: expected little or legacy"), "{error}");
    }

    proptest! {
        #[test]
        fn every_event_comes_back_in_both_orders(events in sorted_events((1 << 34) - 1, 2048), legacy: bool) {
            let words = evt21_words(&events);
            let header = if legacy { LEGACY.replace("height=720;width=1280;", "") } else { LITTLE.to_owned() };
            prop_assert_eq!(decode(&evt21(&header, &words, legacy)).unwrap().events, events);
        }

        #[test]
        fn the_time_words_tell_the_order_where_the_header_does_not(
            gaps in prop::collection::vec((0i64..3_000, 0..2016u16, any::<u32>()), 50..200), legacy: bool,
        ) {
            let mut now = 1 << 30;
            let events: Vec<Event> = gaps.iter().flat_map(|&(gap, x, bits)| {
                now += gap;
                (0..32).filter(move |bit| bits >> bit & 1 == 1).map(move |bit| Event::new(now, x + bit, 3, true))
            }).collect();
            prop_assert_eq!(decode(&evt21("% evt 2.1\n% end\n", &evt21_words(&events), legacy)).unwrap().events, events);
        }
    }
}

mod evt3 {
    //! EVT3: words of 16 bits, read and written.

    use meissner_engine::{Event, Sensor};
    use meissner_io::{Format, IoError, Place, StreamKind, decode};
    use proptest::prelude::*;

    use meissner_io_tests::codecs::{encoded, evt3, sorted_events, strictly};

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
        let counts: Vec<_> =
            recording.other_streams.iter().map(|s| (s.kind, s.packets, s.elements)).collect();
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
}

fn packets_of_words() -> EventPackets {
    EventPackets::new("evt3", SENSOR).expect("a known encoding")
}

fn bytes_of(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[test]
fn after_a_loss_no_event_gets_the_row_or_the_time_of_another() {
    let mut packets = packets_of_words();
    let first = bytes_of(&[0x8001, 0x6005, 0x0007, 0x2803]);
    assert_eq!(packets.decode(0, &first).expect("good words"), [Event::new(4101, 3, 7, true)]);
    // The lost packet continued to time 0x002'000 and row 9. Each event before the state is sent
    // again is left out.
    packets.resync();
    let next = bytes_of(&[
        0x2804, 0x6007, 0x2804, 0x8002, 0x2804, 0x6001, 0x2804, 0x4003, 0x000a, 0x2005, 0x4007, 0x3010,
        0x4005,
    ]);
    let expected = [(5, false), (16, false), (18, false)].map(|(x, on)| Event::new(8193, x, 10, on));
    assert_eq!(packets.decode(0, &next).expect("good words"), expected);
    assert_eq!(packets.unplaced(), 4 + 2 + 3);
    // From here on, every word has its correct meaning.
    assert_eq!(packets.decode(0, &bytes_of(&[0x2804])).expect("good words").len(), 1);
    assert_eq!(packets.unplaced(), 9);
}

#[test]
fn a_vector_whose_row_is_unknown_moves_its_base() {
    let mut packets = packets_of_words();
    packets.resync();
    let next = bytes_of(&[0x8001, 0x6000, 0x3810, 0x4fff, 0x0002, 0x4001]);
    assert_eq!(packets.decode(0, &next).expect("good words"), [Event::new(4096, 28, 2, true)]);
    assert_eq!(packets.unplaced(), 12);
}

#[test]
fn a_stream_that_is_joined_in_its_middle_counts_what_it_cannot_place() {
    let mut packets = packets_of_words();
    let joined = bytes_of(&[0x2804, 0x0003, 0x2805, 0x8001, 0x6002, 0x2806]);
    assert_eq!(packets.decode(0, &joined).expect("good words"), [Event::new(4098, 6, 3, true)]);
    assert_eq!(packets.unplaced(), 2);
}
