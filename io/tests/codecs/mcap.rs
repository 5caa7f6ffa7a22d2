//! MCAP: events of every encoding and compression, pictures, topics, cuts, checksums and bombs.

use std::fs;

use meissner_engine::{Event, Sensor};
use meissner_io::limits::PACKET_BYTES;
use meissner_io::{
    EventPackets, Format, Image, ImageSequence, IoError, McapWriter, Place, ReadOptions, StreamKind, decode,
    decode_with, encode, encode_png,
};
use proptest::prelude::*;

use meissner_io_tests::codecs::aedat4::Compression;
use meissner_io_tests::codecs::mcap::{
    Cdr, channel, chunk, crc32, file, message, mono_packet, packed_chunk, packet, record, schema,
};
use meissner_io_tests::codecs::{SENSOR, any_event, encoded, events, evt3, strictly};

/// The records that declare channel 1 as `topic` of messages of the type `name`.
fn declared(topic: &str, name: &str, encoding: &str) -> Vec<u8> {
    [schema(1, name), channel(1, 1, topic, encoding)].concat()
}

const PACKET: &str = "event_camera_msgs/msg/EventPacket";

/// A file with these messages of one topic of packets, in a chunk that is not compressed.
fn packets(messages: &[Vec<u8>]) -> Vec<u8> {
    let messages = messages.iter().map(|data| message(1, 0, data)).collect::<Vec<_>>().concat();
    file(&[chunk("", &[declared("/events", PACKET, "cdr"), messages].concat())])
}

proptest! {
    #[test]
    fn any_events_come_back_exactly(
        events in prop::collection::vec(any_event(prop_oneof![0..1_i64 << 20, 0..18_446_744_073_709_551_i64], 32768), 0..200)
    ) {
        let sensor = Sensor::new(32768, 32768);
        let recording = strictly(&encoded(Format::Mcap, Some(sensor), &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (Some(sensor), events));
    }
}

#[test]
fn many_events_are_written_in_several_chunks_and_packets() {
    let events: Vec<_> = (0..200_000).map(|i| Event::new(i * 50, (i % 346) as u16, 7, i % 3 == 0)).collect();
    let bytes = encoded(Format::Mcap, Some(SENSOR), &events);
    assert!(bytes.len() < events.len() * 9, "{} bytes", bytes.len());
    assert_eq!(strictly(&bytes).unwrap().events, events);
}

#[test]
fn times_and_rows_that_no_packet_holds_are_refused() {
    for event in [Event::new(-1, 0, 0, true), Event::new(18_446_744_073_709_552, 0, 0, true)] {
        let error = encode(Format::Mcap, Some(SENSOR), &[event], &mut Vec::new()).unwrap_err();
        assert!(matches!(error, IoError::CannotHold { field: "t_us", .. }), "{error}");
        let mut writer = McapWriter::new(Vec::new()).unwrap();
        let channel = writer.event_channel("/events").unwrap();
        let error = writer.events(channel, SENSOR, &[event]).unwrap_err().to_string();
        assert!(error.starts_with("MCAP holds times of 0 to"), "{error}");
    }
}

#[test]
fn every_compression_gives_the_same_events() {
    let records = [declared("/e", PACKET, "cdr"), message(1, 5, &mono_packet(SENSOR, 0, &events()))].concat();
    for (name, packed) in [
        ("", records.clone()),
        ("lz4", Compression::Lz4.pack(&records)),
        ("zstd", Compression::Zstd.pack(&records)),
    ] {
        let recording = strictly(&file(&[packed_chunk(name, &records, &packed)])).unwrap();
        assert_eq!((recording.sensor, recording.events), (Some(SENSOR), events()), "{name}");
    }
    // Without a chunk.
    assert_eq!(strictly(&file(std::slice::from_ref(&records))).unwrap().events, events());
    let error = decode(&file(&[packed_chunk("bz2", &records, &records)])).unwrap_err().to_string();
    assert_eq!(
        error,
        "unsupported: expected MCAP with chunks in lz4, in zstd or not compressed, found \"bz2\""
    );
}

#[test]
fn every_encoding_of_a_packet_is_read() {
    let words = evt3("", &[0x8001, 0x6002, 0x0003, 0x2805, 0x3004, 0x4003]);
    // Time 3 << 12 | 4, column 7, an event of row 9, a vector from row 16 on, twice.
    let compressed = evt3("", &[0x0003, 0x1004, 0x2007, 0x3809, 0x4010, 0x5005, 0x5001]);
    let libcaer: Vec<u8> = [(5_u32 << 17 | 6 << 2 | 3, 0x7fff_ffff_u32), (1 << 17 | 2 << 2 | 1, 1)]
        .iter()
        .flat_map(|(data, time)| [data.to_le_bytes(), time.to_le_bytes()].concat())
        .collect();
    let base = 1_000_000_000;
    let at = 1_000_000 + (3 << 12 | 4);
    let expected: [(&str, &[u8], Vec<Event>); 3] = [
        (
            "evt3",
            &words,
            vec![Event::new(4098, 5, 3, true), Event::new(4098, 4, 3, false), Event::new(4098, 5, 3, false)],
        ),
        (
            "libcaer_cmp",
            &compressed,
            [(9, true), (16, false), (18, false), (24, false)]
                .map(|(y, on)| Event::new(at, 7, y, on))
                .to_vec(),
        ),
        (
            "libcaer",
            &libcaer,
            vec![
                Event::new(1_000_000 + 0x7fff_ffff, 5, 6, true),
                Event::new(1_000_000 + (1 << 31) + 1, 1, 2, false),
            ],
        ),
    ];
    for (encoding, content, events) in expected {
        let bytes = packets(&[packet(SENSOR, 0, base, encoding, content)]);
        assert_eq!(strictly(&bytes).unwrap().events, events, "{encoding}");
        let mut live = EventPackets::new(encoding, SENSOR).unwrap();
        assert_eq!(live.decode(base, content).unwrap(), events, "{encoding}");
    }
    let error = decode(&packets(&[packet(SENSOR, 0, 0, "trigger", &[])])).unwrap_err().to_string();
    assert_eq!(
        error,
        "unsupported: expected an event packet in evt3, mono, libcaer or libcaer_cmp, found \"trigger\""
    );
}

#[test]
fn an_event_of_libcaer_before_its_column_is_left_out_and_so_is_another_word() {
    let mut live = EventPackets::new("libcaer_cmp", SENSOR).unwrap();
    let words = evt3("", &[0x3809, 0x6000, 0x2001, 0x3809]);
    assert_eq!(live.decode(0, &words).unwrap(), [Event::new(0, 1, 9, true)]);
    assert_eq!(live.left_out().iter().map(|kind| kind.count).sum::<u64>(), 2);
    live.resync();
    assert_eq!(live.decode(0, &words[..2]).unwrap(), []);
}

#[test]
fn arrays_of_events_are_read_in_either_byte_order() {
    for big in [false, true] {
        let mut cdr = Cdr::new(big);
        cdr.header();
        cdr.u32(260).u32(346).u32(events().len() as u32);
        for event in events() {
            cdr.u16(event.x).u16(event.y).u32(0).u32(event.t_us as u32 * 1000 + 999).u8(event.on.into());
        }
        for name in ["dvs_msgs/msg/EventArray", "prophesee_event_msgs/msg/EventArray"] {
            let bytes = file(&[declared("/dvs/events", name, "cdr"), message(1, 0, &cdr.bytes)]);
            let recording = strictly(&bytes).unwrap();
            assert_eq!((recording.sensor, recording.events), (Some(SENSOR), events()), "{name} {big}");
        }
    }
}

/// Two topics of events with other messages between them, and one topic that no reader reads.
fn topics() -> Vec<u8> {
    let right: Vec<_> = events()[..3].to_vec();
    let records = [
        schema(1, PACKET),
        schema(2, "sensor_msgs/msg/Imu"),
        channel(0, 1, "/silent", "cdr"),
        channel(1, 1, "/left", "cdr"),
        channel(2, 1, "/right", "cdr"),
        channel(3, 2, "/imu", "cdr"),
        message(3, 0, &[0, 1, 0, 0]),
        message(1, 1, &mono_packet(SENSOR, 0, &events())),
        message(2, 2, &mono_packet(SENSOR, 0, &right)),
        message(3, 3, &[0, 1, 0, 0]),
    ];
    file(&[chunk("", &records.concat())])
}

#[test]
fn the_first_topic_of_events_is_read_or_the_one_that_is_asked_for() {
    let other = |recording: &meissner_io::Recording| -> Vec<_> {
        let each = recording.other_streams.iter();
        each.map(|stream| (stream.name.clone(), stream.kind, stream.packets, stream.elements)).collect()
    };
    let imu = ("/imu".to_owned(), StreamKind::Imu, 2, 2);
    let left = strictly(&topics()).unwrap();
    assert_eq!(left.events, events());
    assert_eq!(other(&left), [("/right".to_owned(), StreamKind::Events, 1, 3), imu.clone()]);
    let asked = |number| {
        let stream = std::num::NonZeroU16::new(number);
        decode_with(&topics(), ReadOptions::default().stream(stream))
    };
    let right = asked(2).unwrap();
    assert_eq!(right.events, events()[..3]);
    assert_eq!(other(&right), [("/left".to_owned(), StreamKind::Events, 1, 40), imu]);
    let error = asked(3).unwrap_err().to_string();
    assert!(error.ends_with("found 2, and stream 3 asked for"), "{error}");
}

#[test]
fn a_file_without_events_names_what_it_has() {
    let bytes = file(&[declared("/camera", "sensor_msgs/msg/Image", "cdr"), message(1, 0, &[0, 1, 0, 0])]);
    let error = decode(&bytes).unwrap_err().to_string();
    assert!(error.ends_with("found /camera (frames)"), "{error}");
    assert_eq!(decode(&file(&[])).unwrap().events, []);
}

#[test]
fn a_gap_in_the_numbers_of_packets_leaves_out_what_has_no_time_any_more() {
    let words = |words: &[u16]| evt3("", words);
    let first = words(&[0x8001, 0x6002, 0x0003, 0x2805]);
    let next = words(&[0x2006, 0x8001, 0x6003, 0x0004, 0x2007]);
    let of = |seq| packets(&[packet(SENSOR, 7, 0, "evt3", &first), packet(SENSOR, seq, 0, "evt3", &next)]);
    assert_eq!(strictly(&of(8)).unwrap().events.len(), 3);
    let lost = decode(&of(9)).unwrap();
    assert_eq!(lost.events, [Event::new(4098, 5, 3, true), Event::new(4099, 7, 4, false)]);
    assert_eq!((lost.other_streams[0].kind, lost.other_streams[0].elements), (StreamKind::Unplaced, 1));
}

#[test]
fn a_cut_file_is_refused_and_salvaged_up_to_the_cut() {
    let parts: Vec<Vec<Event>> = events().chunks(15).map(<[Event]>::to_vec).collect();
    for is_compressed in [true, false] {
        let mut bytes = Vec::new();
        let mut ends = vec![];
        if is_compressed {
            let mut writer = McapWriter::new(&mut bytes).unwrap();
            let channel = writer.event_channel("/events").unwrap();
            for part in &parts {
                writer.events(channel, SENSOR, part).unwrap();
                writer.flush().unwrap();
            }
            writer.finish().unwrap();
        } else {
            bytes = packets(&parts.iter().map(|part| mono_packet(SENSOR, 0, part)).collect::<Vec<_>>());
        }
        let all = strictly(&bytes).unwrap().events;
        assert_eq!(all, events());
        for length in 0..bytes.len() {
            let cut = &bytes[..length];
            let error = decode_with(cut, Format::Mcap).unwrap_err();
            assert!(matches!(error, IoError::Truncated { .. }), "cut at {length}: {error}");
            let Ok(salvaged) = decode_with(cut, ReadOptions::from(Format::Mcap).salvage(true)) else {
                assert!(length < 8, "cut at {length}");
                continue;
            };
            let left_out = salvaged.salvaged.unwrap();
            let (Place::Byte(place) | Place::Packet { byte: place, .. }) = left_out.place else { panic!() };
            assert_eq!(place + left_out.bytes_not_read, length as u64);
            assert_eq!(salvaged.events, all[..salvaged.events.len()]);
            if ends.last() != Some(&salvaged.events.len()) {
                ends.push(salvaged.events.len());
            }
        }
        assert_eq!(ends, [0, 15, 30, 40], "whole packets");
    }
}

#[test]
fn a_checksum_that_is_another_is_an_error_with_its_place() {
    let good = packets(&[mono_packet(SENSOR, 0, &events())]);
    let mut bytes = good.clone();
    // The last byte of the last event, in a chunk that is not compressed.
    let end = bytes.windows(9).position(|w| w == [0x0f, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    bytes[end - 1] ^= 0x80;
    for salvage in [false, true] {
        let options = ReadOptions::from(Format::Mcap).salvage(salvage);
        let error = decode_with(&bytes, options).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "chunk", place: Place::Byte(_), .. }), "{error}");
    }
    // The checksum of the data section, which this file does not have.
    let mut bytes = good;
    bytes[end + 9] = 1;
    let error = decode(&bytes).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "data section", .. }), "{error}");
    let crc = crc32(&bytes[..end]);
    bytes[end + 9..end + 13].copy_from_slice(&crc.to_le_bytes());
    assert_eq!(strictly(&bytes).unwrap().events, events());
}

#[test]
fn odd_events_are_left_out_and_counted() {
    let beside = Event::new(1041, 346, 0, true);
    let all = [events(), vec![beside]].concat();
    let bytes = packets(&[mono_packet(SENSOR, 0, &all)]);
    let recording = decode(&bytes).unwrap();
    assert_eq!((recording.events, recording.left_out[0].count), (events(), 1));
    assert!(matches!(strictly(&bytes).unwrap_err(), IoError::OutsideSensor { x: 346, .. }));
}

#[test]
fn what_contradicts_the_messages_before_it_or_the_format_is_refused_with_its_place() {
    let packet_of = |sensor, encoding| packet(sensor, 0, 0, encoding, &[]);
    let mono = packet_of(SENSOR, "mono");
    let other = Sensor::new(640, 480);
    let cases = [
        (packets(&[mono.clone(), packet_of(other, "mono")]), "sensor of an event packet"),
        (packets(&[mono.clone(), packet_of(SENSOR, "evt3")]), "encoding of an event packet"),
        (packets(&[packet_of(Sensor::new(0, 3), "mono")]), "sensor at"),
        (packets(&[vec![0, 7, 0, 0]]), "expected CDR (0x0000 or 0x0001), found 0x0007"),
        (packets(&[mono[..mono.len() - 1].to_vec()]), "is cut short"),
        (packets(&[packet(SENSOR, 0, 0, "mono", &[1; 9])]), "the last event"),
        (file(&[message(9, 0, &[])]), "channel of a message"),
        (file(&[packed_chunk("lz4", &[0; 40], &[1, 2, 3])]), "one LZ4 frame"),
        (file(&[packed_chunk("zstd", &[0; 40], &Compression::Zstd.pack(&[0; 39]))]), "unpacked chunk"),
    ];
    for (bytes, expected) in cases {
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn a_chunk_or_events_beyond_the_bounds_are_refused() {
    let zeros = vec![0; PACKET_BYTES as usize + 1];
    let bomb = file(&[packed_chunk("lz4", &zeros, &Compression::Lz4.pack(&zeros))]);
    assert!(matches!(decode(&bomb).unwrap_err(), IoError::TooLarge { limit: PACKET_BYTES, .. }));
    // Endless vectors of EVT3: six events per byte, and hundreds of bytes per packed byte.
    let mut words = vec![0x8001, 0x6002, 0x0003];
    words.extend([0x3000, 0x4fff].repeat(1 << 20));
    let messages = message(1, 0, &packet(SENSOR, 0, 0, "evt3", &evt3("", &words)));
    let records = [declared("/events", PACKET, "cdr"), messages].concat();
    let bomb = file(&[packed_chunk("lz4", &records, &Compression::Lz4.pack(&records))]);
    let error = decode(&bomb).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { what: "events so far", .. }), "{error}");
}

/// 3 x 2 pixels, all different.
fn image() -> Image {
    Image { width: 3, height: 2, data: (0..18).map(|i| i * 13).collect() }
}

/// A message of `sensor_msgs/msg/Image`; its rows have two bytes more.
fn ros_image(encoding: &str, rows: &[&[u8]]) -> Vec<u8> {
    let mut cdr = Cdr::new(false);
    cdr.header();
    cdr.u32(2).u32(3).text(encoding).u8(0).u32(rows[0].len() as u32 + 2);
    cdr.sequence(&rows.iter().flat_map(|row| [row, &[9_u8, 9][..]].concat()).collect::<Vec<_>>());
    cdr.bytes
}

#[test]
fn pictures_of_every_form_are_read_one_after_the_other() {
    use base64::Engine;
    let to_64 = |bytes: &[u8]| base64::prelude::BASE64_STANDARD.encode(bytes);
    let image = image();
    let rows: Vec<&[u8]> = image.data.chunks(9).collect();
    let swapped: Vec<u8> = image.data.chunks(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
    let alpha: Vec<u8> = image.data.chunks(3).flat_map(|p| [p[0], p[1], p[2], 77]).collect();
    let png = encode_png(3, 2, &image.data).unwrap();
    let mut compressed = Cdr::new(false);
    compressed.header();
    compressed.text("png").sequence(&png);
    let stamp = r#""timestamp":{"sec":1,"nsec":2},"frame_id":"""#;
    let json_file = format!(r#"{{{stamp},"format":"png","data":"{}"}}"#, to_64(&png));
    let json_raw = format!(
        r#"{{{stamp},"width":3,"height":2,"encoding":"rgb8","step":9,"data":"{}"}}"#,
        to_64(&image.data)
    );
    let field = |number: u8, bytes: &[u8]| [&[number << 3 | 2, bytes.len() as u8], bytes].concat();
    let proto_file = [field(2, &png), field(3, b"png"), vec![0x08, 0x80, 0x01]].concat();
    let fixed = |number: u8, value: u32| [&[number << 3 | 5][..], &value.to_le_bytes()].concat();
    let proto_raw =
        [fixed(2, 3), fixed(3, 2), field(4, b"rgb8"), fixed(5, 9), field(6, &image.data), field(7, b"cam")]
            .concat();
    let ros = "sensor_msgs/msg/Image";
    let forms: [(&str, &str, Vec<u8>); 8] = [
        (ros, "cdr", ros_image("rgb8", &rows)),
        (ros, "cdr", ros_image("bgr8", &swapped.chunks(9).collect::<Vec<_>>())),
        (ros, "cdr", ros_image("rgba8", &alpha.chunks(12).collect::<Vec<_>>())),
        ("sensor_msgs/msg/CompressedImage", "cdr", compressed.bytes),
        ("foxglove.CompressedImage", "json", json_file.into_bytes()),
        ("foxglove.RawImage", "json", json_raw.into_bytes()),
        ("foxglove.CompressedImage", "protobuf", proto_file),
        ("foxglove.RawImage", "protobuf", proto_raw),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, encoding, data) in forms {
        let path = folder.path().join("bag.mcap");
        let other =
            [schema(2, PACKET), channel(2, 2, "/events", "cdr"), message(2, 0, &mono_packet(SENSOR, 0, &[]))];
        let records = [declared("/camera", name, encoding), message(1, 0, &data), other.concat()].concat();
        let more = chunk("", &[message(1, 1, &data), message(1, 2, &data)].concat());
        fs::write(&path, file(&[chunk("lz4", &records), more, message(1, 3, &data)])).unwrap();
        let sequence = ImageSequence::open(&path).unwrap();
        assert_eq!((sequence.len(), &sequence.paths()[1]), (4, &path.join("000002.png")));
        for read in sequence {
            assert_eq!(read.unwrap().1, image, "{name} {encoding}");
        }
    }
    // Grey pictures, and refused ones.
    let path = folder.path().join("grey.mcap");
    let grey = ros_image("mono8", &[&[1, 2, 3], &[4, 5, 6]]);
    let deep = ros_image("16UC1", &[&[0; 6], &[0; 6]]);
    let short = ros_image("rgb8", &[&[1, 2, 3], &[4, 5, 6]]);
    let messages = [&grey, &deep, &short, &grey].map(|data| message(1, 0, data)).concat();
    fs::write(&path, file(&[declared("/camera", ros, "cdr"), messages])).unwrap();
    let read: Vec<_> = ImageSequence::open(&path).unwrap().collect();
    let data = vec![1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5, 5, 5, 6, 6, 6];
    assert_eq!(read[0].as_ref().unwrap().1, Image { data, ..image });
    for (result, expected) in [(&read[1], "16UC1"), (&read[2], "rows of at least 9 bytes")] {
        let IoError::Content { source, .. } = result.as_ref().unwrap_err() else { panic!() };
        assert!(source.to_string().contains(expected), "{source}");
    }
    assert!(read[3].is_ok(), "a picture after one that is refused");
}

#[test]
fn a_cut_or_empty_file_has_no_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    let bytes = file(&[chunk("", &declared("/camera", "sensor_msgs/msg/Image", "cdr"))]);
    for (bytes, expected) in
        [(&bytes[..], "topic of pictures"), (&bytes[..60], "cut short"), (&bytes[..30], "cut short")]
    {
        fs::write(&path, bytes).unwrap();
        let error = ImageSequence::open(&path).unwrap_err();
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert!(source.contains(expected), "{source}");
    }
    // A record that no reader reads, with a length that overflows together with its position.
    for op in [6, 0x80] {
        let huge = [&b"\x89MCAP0\r\n"[..], &[op], &u64::MAX.to_le_bytes()].concat();
        fs::write(&path, huge).unwrap();
        let error = ImageSequence::open(&path).unwrap_err();
        assert!(std::error::Error::source(&error).unwrap().to_string().contains("cut short"));
    }
}

#[test]
fn records_that_nobody_knows_are_passed_over() {
    let records =
        [declared("/e", PACKET, "cdr"), record(0x80, &[b"private"]), record(0x09, &[&[0; 32]])].concat();
    let bytes = file(&[records, message(1, 0, &mono_packet(SENSOR, 0, &events()))]);
    assert_eq!(strictly(&bytes).unwrap().events, events());
}
