//! Odd data in a recording are left out and counted by kind, and the other data are read; a strict
//! reader refuses the recording.

use meissner_engine::{Event, Sensor};
use meissner_io::{
    Chip, EventPackets, Format, IoError, LeftOutKind, LiveEvents, ReadOptions, Recording, StreamKind,
    TextOptions, decode, decode_with, record,
};

use meissner_io_tests::codecs::aedat::{
    DAVIS346, aedat2, aedat3, aedat3_events, aedat3_header, aedat3_packet, davis_records,
};
use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet};
use meissner_io_tests::codecs::{SENSOR, encoded, events, evt2, evt2_words, evt3, nmnist, strictly};

const EVT3: &str = "% evt 3.0\n% geometry 1280x720\n% end\n";

fn counts(recording: &Recording) -> Vec<(LeftOutKind, u64)> {
    recording.left_out.iter().map(|left_out| (left_out.kind, left_out.count)).collect()
}

/// Checks the events `expected` of `bytes` and the omitted parts, which a strict reader refuses.
fn reads(bytes: &[u8], expected: &[Event], left_out: &[(LeftOutKind, u64)]) {
    let recording = decode(bytes).expect("the rest is read");
    let format = recording.format;
    assert_eq!(recording.events, expected, "{format}");
    assert_eq!(counts(&recording), left_out, "{format}");
    let error = strictly(bytes).expect_err("a strict reader refuses it").to_string();
    assert_eq!(recording.left_out[0].first[0], error, "{format}");
}

#[test]
fn padding_and_reserved_words_of_evt3_are_left_out() {
    let words = [0x8000, 0x6001, 0x0005, 0x2807, 0x9999, 0x9999, 0xb000, 0xcfff, 0xd123, 0x6002, 0x2008];
    let expected = [Event::new(1, 7, 5, true), Event::new(2, 8, 5, false)];
    reads(&evt3(EVT3, &words), &expected, &[(LeftOutKind::OtherWords, 5)]);
}

#[test]
fn a_row_of_another_system_switches_the_row_off_until_the_next() {
    let words = [0x8000, 0x6001, 0x0005, 0x2807, 0x1006, 0x2009, 0x3020, 0x4003, 0x0006, 0x280a];
    let expected = [Event::new(1, 7, 5, true), Event::new(1, 10, 6, true)];
    reads(&evt3(EVT3, &words), &expected, &[(LeftOutKind::OtherEvents, 3)]);
}

#[test]
fn a_stream_that_begins_within_a_vector_has_unplaced_events() {
    // Vectors before any time, row and base; then a time, and a vector before its base.
    let words =
        [0x40ff, 0x5003, 0x604d, 0x2803, 0x8002, 0x600a, 0x4007, 0x0009, 0x4007, 0x2804, 0x3864, 0x4003];
    let recording = decode(&evt3(EVT3, &words)).unwrap();
    let t_us = (2 << 12) + 10;
    assert_eq!(recording.events, [4, 100, 101].map(|x| Event::new(t_us, x, 9, true)));
    let unplaced: Vec<_> = recording.other_streams.iter().map(|s| (s.kind, s.elements)).collect();
    assert_eq!(unplaced, [(StreamKind::Unplaced, 8 + 2 + 1 + 3 + 3)]);
    assert!(matches!(strictly(&evt3(EVT3, &words)), Err(IoError::Malformed { what: "event", .. })));
}

#[test]
fn rows_and_columns_of_evt3_outside_the_sensor_are_counted_by_their_events() {
    // Row 1500 without events has no effect; then a vector over the right edge, and a vector in row
    // 1500.
    let words = [
        0x8000, 0x6001, 0x05dc, 0x0003, 0x2801, 0x3cfe, 0x4fff, 0x05dc, 0x2002, 0x3800, 0x5007, 0x0004,
        0x2805,
    ];
    let expected = [(1, 3), (1278, 3), (1279, 3), (5, 4)].map(|(x, y)| Event::new(1, x, y, true));
    reads(&evt3(EVT3, &words), &expected, &[(LeftOutKind::OutsideSensor, 10 + 1 + 3)]);
}

#[test]
fn imu_and_picture_words_of_evt2_are_left_out() {
    let header = "% evt 2.0\n% geometry 346x260\n% end\n";
    let mut words = evt2_words(&events());
    for (place, kind) in [(3, 0x2), (9, 0x4), (11, 0x9), (20, 0xb), (21, 0xc), (30, 0xd)] {
        words.insert(place, kind << 28 | 0x123);
    }
    reads(&evt2(header, &words), &events(), &[(LeftOutKind::OtherWords, 6)]);
    words.insert(30, 0x1000_0000 | 400 << 11);
    let counts = counts(&decode(&evt2(header, &words)).unwrap());
    assert_eq!(counts, [(LeftOutKind::OtherWords, 6), (LeftOutKind::OutsideSensor, 1)]);
}

#[test]
fn one_event_outside_the_sensor_costs_one_event_in_every_format() {
    let all = events();
    let stray = Event::new(all[20].t_us, 345, 306, true);
    let with = |stray: Event| [&all[..20], &[stray], &all[20..]].concat();
    let left_out = [(LeftOutKind::OutsideSensor, 1)];
    // A writer refuses such an event for the sensor that it writes, so the header of a smaller
    // sensor is used.
    let large = Sensor::new(346, 360);
    let mut dat = encoded(Format::Dat, Some(large), &with(stray));
    let at = dat.windows(10).position(|bytes| bytes == b"Height 360").unwrap();
    dat[at..at + 10].copy_from_slice(b"Height 260");
    reads(&dat, &all, &left_out);

    let mut records = davis_records(SENSOR, &all);
    records.insert(20, [306 << 22 | 340 << 12, all[20].t_us as u32]);
    reads(&aedat2(&DAVIS346, &records), &all, &left_out);

    reads(&aedat3(&with(stray), 7), &all, &left_out);

    for compression in Compression::ALL {
        let mut file = File::new(compression, Some(SENSOR));
        file.push(0, &event_packet(&with(stray)));
        reads(&file.bytes(), &all, &left_out);
    }

    let stray = Event::new(all[20].t_us, 345, 259, true);
    let mut es = encoded(Format::Es, Some(SENSOR), &with(stray));
    let [x0, x1] = 345_u16.to_le_bytes();
    // Rows of this format count from the bottom.
    let at = es.windows(4).rposition(|bytes| bytes == [x0, x1, 0, 0]).unwrap();
    es[at..at + 2].copy_from_slice(&400_u16.to_le_bytes());
    reads(&es, &all, &left_out);
}

#[test]
fn values_that_no_event_has_cost_one_event() {
    let all = events();
    let mut npy = encoded(Format::Npy, None, &all);
    *npy.last_mut().unwrap() = 7;
    reads(&npy, &all[..39], &[(LeftOutKind::Malformed, 1)]);
    let mut dat = encoded(Format::Dat, Some(SENSOR), &all);
    *dat.last_mut().unwrap() |= 0x40;
    reads(&dat, &all[..39], &[(LeftOutKind::Malformed, 1)]);
    let on_34: Vec<_> = all.iter().map(|e| Event { x: e.x % 34, y: e.y % 34, ..*e }).collect();
    let mut digits = nmnist(&on_34);
    digits[5] = 40;
    let recording = decode_with(&digits, Format::Nmnist).unwrap();
    assert_eq!((recording.events.len(), counts(&recording)), (39, vec![(LeftOutKind::OutsideSensor, 1)]));
}

#[test]
fn packets_of_ros_pass_over_the_same_words() {
    let mut packets = EventPackets::new("evt3", SENSOR).unwrap();
    let words = [0x8000_u16, 0x6001, 0x0005, 0x2807, 0x9999, 0x1006, 0x2009, 0x0800, 0x07ff, 0x2001];
    let bytes: Vec<u8> = words.into_iter().flat_map(u16::to_le_bytes).collect();
    assert_eq!(packets.decode(0, &bytes).unwrap(), [Event::new(1, 7, 5, true)]);
    let counts: Vec<_> = packets.left_out().iter().map(|left_out| (left_out.kind, left_out.count)).collect();
    let expected =
        [(LeftOutKind::OtherWords, 1), (LeftOutKind::OtherEvents, 1), (LeftOutKind::OutsideSensor, 1)];
    assert_eq!(counts, expected);
}

#[test]
fn a_step_back_over_the_wrap_of_the_clock_is_not_two_wraps() {
    let words = [
        0x8fff, 0x6fa0, 0x0001, 0x2801, 0x8000, 0x6005, 0x2802, 0x8fff, 0x6ffa, 0x2803, 0x8000, 0x6009,
        0x2804, 0x8001, 0x6000, 0x2805,
    ];
    let times: Vec<_> = decode(&evt3(EVT3, &words)).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [16_777_120, 16_777_221, 16_777_210, 16_777_225, 16_781_312]);
    // The words of two whole periods of silence follow each other directly.
    let words = [0x8fff, 0x6fff, 0x0001, 0x2801, 0x8000, 0x8fff, 0x8000, 0x6001, 0x2801];
    let times: Vec<_> = decode(&evt3(EVT3, &words)).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [(1 << 24) - 1, (2 << 24) + 1]);
    let dat = |times: &[u32]| {
        let mut bytes = b"% Version 2\n".to_vec();
        bytes.extend([0x0c, 8]);
        times.iter().for_each(|t| bytes.extend([t.to_le_bytes(), [0; 4]].concat()));
        decode(&bytes).unwrap().events.iter().map(|e| e.t_us).collect::<Vec<_>>()
    };
    let wrap = 1_i64 << 32;
    assert_eq!(dat(&[u32::MAX, 3, u32::MAX - 1, 4]), [wrap - 1, wrap + 3, wrap - 2, wrap + 4]);
    assert_eq!(dat(&[u32::MAX, 3, 3_000_000_000]), [wrap - 1, wrap + 3, wrap + 3_000_000_000], "a silence");
}

#[test]
fn a_silence_of_nearly_a_period_after_a_wrap_comes_back() {
    let times = [(1 << 24) - 1, (1 << 24) + 5, (2 << 24) - 3, (5 << 24) + 7, (6 << 24) - 1];
    let all = times.map(|t_us| Event::new(t_us, 1, 2, true));
    assert_eq!(decode(&encoded(Format::Evt3, None, &all)).unwrap().events, all);
}

#[test]
fn the_caller_can_name_the_chip_that_a_recording_does_not() {
    let all = events();
    let bytes =
        aedat2(&["This is a raw AE data file created by AEDat2Output in v2e"], &davis_records(SENSOR, &all));
    let error = decode(&bytes).unwrap_err().to_string();
    assert!(error.contains("an option that names the chip"), "{error}");
    let chip: Chip = "davis346".parse().unwrap();
    for options in [ReadOptions::default().chip(chip), ReadOptions::default().sensor(SENSOR)] {
        let recording = decode_with(&bytes, options).unwrap();
        assert_eq!((recording.sensor, &recording.events), (Some(SENSOR), &all));
        assert!(recording.assumed.is_empty());
    }
    let small = Sensor::new(240, 180);
    let on_240: Vec<_> = all.iter().map(|e| Event { y: e.y % 180, ..*e }).collect();
    let options = ReadOptions::default().sensor(small);
    let recording = decode_with(&aedat2(&["none"], &davis_records(small, &on_240)), options).unwrap();
    assert_eq!((recording.sensor, recording.events), (Some(small), on_240));
    assert!("DAVIS9000".parse::<Chip>().unwrap_err().to_string().contains("DAVIS346"));
}

#[test]
fn a_chip_that_is_taken_for_granted_is_told() {
    let bytes = aedat2(&["no chip"], &[[0, 0], [2, 1]]);
    let recording = decode(&bytes).unwrap();
    assert_eq!(recording.sensor, Some(Sensor::new(128, 128)));
    assert!(recording.assumed[0].contains("DVS128"), "{:?}", recording.assumed);
    let said = decode_with(&bytes, ReadOptions::default().chip("DVS128".parse::<Chip>().unwrap())).unwrap();
    assert!(said.assumed.is_empty());
    // If the sensor is known, small addresses have no meaning.
    let said = decode_with(&bytes, ReadOptions::default().sensor(SENSOR)).unwrap();
    assert_eq!(said.sensor, Some(SENSOR));
}

#[test]
fn another_stream_of_events_is_read_where_it_is_asked_for() {
    let (first, second) = (events(), events().split_off(7));
    let stream = |number: u16| ReadOptions::default().stream(std::num::NonZeroU16::new(number));
    let mut file = File::new(Compression::Lz4, None);
    let declared = [(3, "left", "EVTS"), (1, "imu", "IMUS"), (4, "right", "EVTS")];
    let declared = declared
        .map(|(id, name, kind)| meissner_io_tests::codecs::aedat4::stream(id, name, kind, Some(SENSOR)));
    file.xml = meissner_io_tests::codecs::aedat4::outputs(&declared.concat());
    file.push(4, &event_packet(&second));
    file.push(3, &event_packet(&first));
    let packets = [(1, &second), (7, &first)]
        .map(|(source, events)| aedat3_packet(1, source, 8, 0, &aedat3_events(events)));
    let aedat3 = [aedat3_header(1, "DAVIS346"), packets.concat()].concat();
    for (bytes, first, second) in [(file.bytes(), &first, &second), (aedat3, &second, &first)] {
        assert_eq!(&decode(&bytes).unwrap().events, first);
        assert_eq!(&decode_with(&bytes, stream(1)).unwrap().events, first);
        assert_eq!(&decode_with(&bytes, stream(2)).unwrap().events, second);
        let error = decode_with(&bytes, stream(3)).unwrap_err().to_string();
        assert!(error.contains("found 2, and stream 3 asked for"), "{error}");
    }
    let one = encoded(Format::Dat, Some(SENSOR), &first);
    assert!(decode_with(&one, stream(2)).unwrap_err().to_string().contains("found one"));
}

#[test]
fn a_file_whose_writer_named_no_stream_is_read_by_its_packets() {
    let all = events();
    for (compression, is_named) in Compression::ALL.into_iter().flat_map(|c| [(c, true), (c, false)]) {
        let packet = |events: &[Event]| {
            let mut packet = event_packet(events);
            packet[8..12].fill(0);
            if is_named { event_packet(events) } else { packet }
        };
        let mut file = File::new(compression, None);
        file.xml = meissner_io_tests::codecs::aedat4::outputs("");
        if !is_named {
            file.table = Some(vec![8, 0, 0, 0, 4, 0, 0, 0, 4, 0, 4, 0, 4, 0, 0, 0]);
        }
        file.push(5, &meissner_io_tests::codecs::aedat4::vector(*b"IMUS", 1, &[4, 0, 0, 0]));
        file.push(0, &packet(&all[..9]));
        file.push(0, &packet(&all[9..]));
        let mut bytes = file.bytes();
        if !is_named {
            let at = bytes.windows(4).position(|bytes| bytes == b"IOHE").unwrap();
            bytes[at..at + 4].fill(0);
        }
        let recording = decode(&bytes).unwrap();
        assert_eq!((recording.sensor, &recording.events), (None, &all));
        assert_eq!(recording.other_streams[0].kind, StreamKind::Imu);
        assert!(recording.assumed[0].contains("left out"), "{:?}", recording.assumed);
    }
    let mut file = File::new(Compression::Lz4, None);
    file.xml = meissner_io_tests::codecs::aedat4::outputs("");
    let mut other = meissner_io_tests::codecs::aedat4::vector(*b"ABCD", 3, &[7; 48]);
    other[8..12].fill(0);
    file.push(0, &other);
    let error = decode(&file.bytes()).unwrap_err().to_string();
    assert!(error.contains("the program that wrote this file left it out"), "{error}");
}

#[test]
fn bad_lines_of_a_text_are_left_out_unless_they_are_most() {
    let good: Vec<String> = (0..60).map(|i| format!("{i},1,2,1")).collect();
    let mut lines = good.clone();
    lines.insert(7, "7,oops,2,1".to_owned());
    lines.insert(30, "30,1,2".to_owned());
    let text = |lines: &[String]| format!("t,x,y,p\n{}\n", lines.join("\n")).into_bytes();
    let recording = decode(&text(&lines)).unwrap();
    assert_eq!((recording.events.len(), counts(&recording)), (60, vec![(LeftOutKind::Lines, 2)]));
    assert!(recording.left_out[0].first[1].contains("line 32"), "{:?}", recording.left_out);
    assert!(strictly(&text(&lines)).unwrap_err().to_string().contains("line 9"));
    let bad = vec!["1,oops,2,1".to_owned(); 51];
    let error = decode(&text(&[&good[..40], &bad].concat())).unwrap_err();
    assert!(matches!(error, IoError::Lines { refused: 51, lines: 100, .. }), "{error}");
    let error = decode(&text(&[&bad[..3], &good[..2]].concat())).unwrap_err();
    assert!(matches!(error, IoError::Lines { refused: 3, lines: 5, .. }), "{error}");
    let error = decode(&text(&bad[..1])).unwrap_err();
    assert!(matches!(error, IoError::Malformed { .. }), "{error}");
    let late = [vec![good[1].clone(); 100], vec![bad[0].clone(); 1000]].concat();
    assert_eq!(counts(&decode(&text(&late)).unwrap()), [(LeftOutKind::Lines, 1000)]);
}

#[test]
fn records_whose_first_time_begins_as_another_format_does_are_records() {
    let marks: [&[u8]; 8] = [
        b"\x1f\x8b",
        b"\x1f\x8b\x08",
        b"BZh",
        b"PK\x03\x04",
        b"\xff\xd8\xff",
        b"P5 ",
        b"II*\0",
        b"\x28\xb5\x2f\xfd",
    ];
    for mark in marks {
        let mut time = 1_825_646_769_703_711_i64.to_le_bytes();
        time[..mark.len()].copy_from_slice(mark);
        let all = [0, 1, 2].map(|step| Event::new(i64::from_le_bytes(time) + step, 3, 4, true));
        let bytes: Vec<u8> = all.iter().flat_map(|event| record(*event)).collect();
        let arriving: Result<Vec<_>, _> = LiveEvents::new(&bytes[..], TextOptions::default()).collect();
        assert_eq!(arriving.expect("records"), all, "{mark:?}");
    }
    // Packed content is refused by its name.
    let packed =
        b"\x1f\x8b\x08\0\0\0\0\0\0\xff\x01\x15\0\xea\xff1,2,3,1\n2,2,3,1\noops\n\xa2\x1b\x69\x37\x15\0\0\0";
    let error = LiveEvents::new(&packed[..], TextOptions::default()).next().unwrap().unwrap_err();
    assert!(error.to_string().contains("gzip"), "{error}");
}
