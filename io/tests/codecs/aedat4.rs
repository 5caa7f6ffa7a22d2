//! AEDAT4: containers, streams, compressions.

use std::io::{Cursor, Write};

use lz4_flex::frame::{BlockSize, FrameDecoder, FrameEncoder, FrameInfo};
use meissner_engine::{Event, Sensor};
use meissner_io::{Aedat4Writer, IoError, Place, StreamKind, StreamSummary, decode};
use proptest::prelude::*;

use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet, outputs, sample, stream, vector};
use meissner_io_tests::codecs::{SENSOR, any_event, events, strictly};

fn summary(name: &str, kind: StreamKind, packets: u64, elements: u64) -> StreamSummary {
    StreamSummary { name: name.to_owned(), kind, packets, elements }
}

#[test]
fn events_are_decoded_and_the_other_streams_are_counted_whatever_the_compression() {
    for compression in Compression::ALL {
        let recording = decode(&sample(compression)).unwrap();
        assert_eq!(recording.sensor, Some(SENSOR), "{compression:?}");
        assert_eq!(recording.events, events(), "{compression:?}");
        let expected = [
            summary("frames", StreamKind::Frames, 1, 1),
            summary("imu", StreamKind::Imu, 2, 3),
            summary("triggers", StreamKind::Triggers, 1, 1),
        ];
        assert_eq!(recording.other_streams, expected, "{compression:?}");
    }
}

#[test]
fn a_recording_that_was_not_closed_has_no_packet_table_and_is_whole() {
    let mut file = File::new(Compression::Lz4, None);
    file.table = None;
    file.push(0, &event_packet(&events()));
    let recording = decode(&file.bytes()).unwrap();
    assert_eq!(recording.events, events());
    assert_eq!(recording.sensor, None);
}

#[test]
fn a_second_event_stream_is_counted_and_not_mixed_with_the_first() {
    let mut file = File::new(Compression::Zstd, None);
    let second = Sensor::new(10, 10);
    file.xml = outputs(
        &[stream(5, "left", "EVTS", Some(SENSOR)), stream(2, "right", "EVTS", Some(second))].concat(),
    );
    file.push(2, &event_packet(&events()[..3]));
    file.push(5, &event_packet(&events()));
    let recording = decode(&file.bytes()).unwrap();
    assert_eq!((recording.sensor, recording.events), (Some(SENSOR), events()));
    assert_eq!(recording.other_streams, [summary("right", StreamKind::Events, 1, 3)]);
}

#[test]
fn a_stream_of_another_type_counts_by_packets() {
    let mut file = File::new(Compression::Lz4, None);
    file.xml = outputs(&[stream(0, "events", "EVTS", None), stream(1, "boxes", "BOXS", None)].concat());
    file.push(1, b"anything");
    file.push(1, b"anything");
    let recording = decode(&file.bytes()).unwrap();
    assert_eq!(recording.other_streams, [summary("boxes", StreamKind::Other, 2, 2)]);
}

#[test]
fn the_error_of_an_event_beside_the_sensor_names_packet_and_byte() {
    let mut file = File::new(Compression::Lz4, Some(Sensor::new(100, 100)));
    let at = file.bytes().len() - Compression::Lz4.pack(file.table.as_ref().unwrap()).len();
    file.push(0, &event_packet(&[Event::new(0, 99, 99, true), Event::new(0, 100, 0, true)]));
    let error = strictly(&file.bytes()).unwrap_err();
    let expected = Place::Packet { packet: at as u64, byte: 32 + 16 + 8 };
    assert!(
        matches!(error, IoError::OutsideSensor { place, x: 100, y: 0, .. } if place == expected),
        "{error}"
    );
    assert_eq!(
        error.to_string(),
        format!(
            "AEDAT4: pixel at byte 56 of the packet at byte {at}: expected x < 100 and y < 100, found x = 100, y = 0"
        )
    );
}

#[test]
fn a_packet_of_a_stream_that_was_not_declared_is_refused() {
    let mut file = File::new(Compression::Lz4, None);
    file.push(9, &event_packet(&events()));
    let error = decode(&file.bytes()).unwrap_err();
    assert!(matches!(&error, IoError::Malformed { what: "stream of a packet", actual, .. } if actual == "9"));
}

#[test]
fn a_packet_of_another_type_than_its_stream_is_refused() {
    let mut file = File::new(Compression::Lz4, None);
    file.push(0, &vector(*b"IMUS", 0, &[]));
    let error = decode(&file.bytes()).unwrap_err();
    assert!(
        matches!(&error, IoError::Malformed { expected, actual, .. } if expected == "`EVTS`" && actual == "`IMUS`")
    );
}

#[test]
fn an_lz4_frame_cut_at_the_end_of_a_block_is_refused() {
    // Two blocks of at most 64 KiB; without the second and the end mark, the frame still decodes
    // without an error.
    let many: Vec<_> =
        (0..6000).map(|i| Event::new(i64::from(i) * 7919, i % 346, i % 260, i % 2 == 0)).collect();
    let blocks = FrameInfo::new().block_size(BlockSize::Max64KB);
    let mut encoder = FrameEncoder::with_frame_info(blocks, Vec::new());
    encoder.write_all(&event_packet(&many)).unwrap();
    let whole = encoder.finish().unwrap();
    let block = u32::from_le_bytes(whole[7..11].try_into().unwrap()) as usize & 0x7fff_ffff;
    let mut file = File::new(Compression::Lz4, None);
    file.packets.push((0, whole[..11 + block].to_vec()));
    let error = decode(&file.bytes()).unwrap_err();
    assert!(
        matches!(&error, IoError::Malformed { what: "packet of events", actual, .. } if actual == "65532"),
        "{error}"
    );
}

#[test]
fn bytes_after_a_compressed_frame_are_refused() {
    for compression in [Compression::Lz4, Compression::Zstd] {
        let mut file = File::new(compression, None);
        let mut packet = compression.pack(&event_packet(&events()));
        packet.extend(compression.pack(b"a second frame"));
        file.packets.push((0, packet));
        let error = decode(&file.bytes()).unwrap_err();
        assert!(matches!(&error, IoError::Malformed { what: "compressed packet", .. }), "{error}");
    }
}

#[test]
fn a_zstandard_frame_whose_checksum_differs_is_refused() {
    let mut file = File::new(Compression::Zstd, None);
    let mut packet = Compression::Zstd.pack(&event_packet(&events()));
    *packet.last_mut().unwrap() ^= 1;
    file.packets.push((0, packet));
    let error = decode(&file.bytes()).unwrap_err();
    assert!(error.to_string().contains("checksum"), "{error}");
}

proptest! {
    #[test]
    fn every_event_comes_back(
        packets in prop::collection::vec(prop::collection::vec(any_event(any::<i64>(), 1 << 15), 0..50), 0..4),
        compression in prop::sample::select(&Compression::ALL),
    ) {
        let mut file = File::new(compression, None);
        for packet in &packets {
            file.push(0, &event_packet(packet));
        }
        prop_assert_eq!(decode(&file.bytes()).unwrap().events, packets.concat());
    }
}

/// The output of a recorder for these batches of events, before and after it is finished.
fn recorded(batches: &[&[Event]]) -> [Vec<u8>; 2] {
    let mut file = Cursor::new(Vec::new());
    let mut writer = Aedat4Writer::new(&mut file, SENSOR).unwrap();
    for batch in batches {
        writer.write(batch).unwrap();
    }
    let length = writer.length() as usize;
    writer.finish().unwrap();
    let finished = file.into_inner();
    let mut open = finished[..length].to_vec();
    open[46..54].fill(0xff);
    [open, finished]
}

proptest! {
    #[test]
    fn what_a_recorder_writes_is_read_whole_whether_it_was_finished_or_not(
        events in prop::collection::vec(any_event(any::<i64>(), 260), 0..100),
        cuts in prop::collection::vec(0..100_usize, 0..4),
    ) {
        let mut cuts: Vec<_> = cuts.into_iter().map(|cut| cut.min(events.len())).collect();
        cuts.extend([0, events.len()]);
        cuts.sort_unstable();
        let batches: Vec<_> = cuts.windows(2).map(|ends| &events[ends[0]..ends[1]]).collect();
        for file in recorded(&batches) {
            let recording = strictly(&file).unwrap();
            prop_assert_eq!((recording.sensor, &recording.events), (Some(SENSOR), &events));
        }
    }
}

#[test]
fn many_events_are_written_in_packets_of_at_most_8192_with_their_places_in_the_table() {
    let many: Vec<_> = (0..20_000_i64).map(|i| Event::new(i * i % 977, 3, 4, i % 2 == 0)).collect();
    let [_, file] = recorded(&[&many, &[], &many[..1]]);
    assert_eq!(strictly(&file).unwrap().events, [&many[..], &many[..1]].concat());
    let table = i64::from_le_bytes(file[46..54].try_into().unwrap()) as usize;
    let mut unpacked = Vec::new();
    std::io::Read::read_to_end(&mut FrameDecoder::new(&file[table..]), &mut unpacked).unwrap();
    let word = |at: usize| i32::from_le_bytes(unpacked[at..at + 4].try_into().unwrap());
    assert_eq!((word(0) as usize, &unpacked[8..12], word(40)), (unpacked.len() - 4, &b"FTAB"[..], 4));
    let mut at = 14 + 4 + word_of(&file, 14) as usize;
    for (entry, events) in [8192, 8192, 3616, 1].into_iter().enumerate() {
        let offset = 44 + 4 * entry;
        let table = offset + word(offset) as usize;
        let vtable = table - word(table) as usize;
        let field = |index: usize| {
            let entry = vtable + 4 + 2 * index;
            table + usize::from(u16::from_le_bytes(unpacked[entry..entry + 2].try_into().unwrap()))
        };
        let long = |index| i64::from_le_bytes(unpacked[field(index)..field(index) + 8].try_into().unwrap());
        assert!([0, 2, 3, 4].iter().all(|&index| field(index) % 8 == 0), "entry {entry}");
        assert_eq!((long(0) as usize, long(2)), (at + 8, events), "entry {entry}");
        assert_eq!((word(field(1)), word(field(1) + 4)), (0, word_of(&file, at + 4)), "entry {entry}");
        assert!(long(3) <= long(4) && (0..977).contains(&long(3)), "entry {entry}");
        at += 8 + word_of(&file, at + 4) as usize;
    }
    assert_eq!(at, table);
}

fn word_of(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}
