//! AEDAT4 as it arrives: streams of `dv-processing`, and files through a pipe.

use std::io::{BufReader, Cursor};

use meissner_engine::{Event, Sensor};
use meissner_io::limits::PACKET_BYTES;
use meissner_io::{Aedat4Writer, Format, IoError, LiveEvents, ReadOptions, decode, decode_with};
use proptest::prelude::*;

use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet, outputs, sample, stream, vector};
use meissner_io_tests::codecs::{SENSOR, any_event, events};

/// All results for these bytes, read in pieces.
fn arriving(bytes: &[u8], options: ReadOptions) -> (Vec<Result<Event, IoError>>, Option<Sensor>) {
    let input = BufReader::with_capacity(7, bytes);
    let mut items = LiveEvents::raw(input, Format::Aedat4, options).expect("a raw format");
    (items.by_ref().collect(), items.sensor())
}

/// The events of bytes without a fault, and the sensor.
fn sound(bytes: &[u8], options: ReadOptions) -> (Vec<Event>, Option<Sensor>) {
    let (items, sensor) = arriving(bytes, options);
    (items.into_iter().map(|item| item.expect("an event")).collect(), sensor)
}

/// The error that ends these bytes, and the number of events before it.
fn refused(bytes: &[u8]) -> (usize, String) {
    let (mut items, _) = arriving(bytes, ReadOptions::default());
    let last = items.pop().expect("an error").expect_err("an error");
    assert!(items.iter().all(Result::is_ok));
    (items.len(), last.to_string())
}

#[test]
fn a_file_of_any_compression_gives_its_events_with_its_magic_number_and_without() {
    for compression in Compression::ALL {
        let file = sample(compression);
        assert_eq!(sound(&file, ReadOptions::default()), (events(), Some(SENSOR)), "{compression:?}");
        let mut open = File::new(compression, Some(SENSOR));
        open.table = None;
        open.push(0, &event_packet(&events()));
        let bytes = open.bytes();
        for start in [0, 14] {
            assert_eq!(sound(&bytes[start..], ReadOptions::default()), (events(), Some(SENSOR)));
        }
    }
}

/// Formerly, each packet was identified only by itself: both of two streams were read, and a packet
/// with a damaged name ended the events.
#[test]
fn where_the_header_declares_no_stream_packets_are_of_what_those_before_told() {
    let mut file = File::new(Compression::Lz4, None);
    file.xml = outputs("");
    let mut unnamed = vector(*b"ABCD", 3, &[7; 48]);
    unnamed[8..12].fill(0);
    let mut damaged = event_packet(&events()[3..5]);
    damaged[8] = 0xff;
    for (id, packet) in [
        (1, &unnamed),
        (4, &event_packet(&events()[..3])),
        (9, &event_packet(&events()[2..4])),
        (4, &event_packet(&events()[3..])),
    ] {
        file.push(id, packet);
    }
    let options = |number| ReadOptions::default().stream(std::num::NonZeroU16::new(number));
    assert_eq!(sound(&file.bytes(), options(1)).0, events());
    assert_eq!(sound(&file.bytes(), options(2)).0, events()[2..4]);
    for number in [1, 2] {
        let whole = decode_with(&file.bytes(), options(number)).expect("a recording");
        assert_eq!(whole.events, sound(&file.bytes(), options(number)).0);
    }
    let (mut items, _) = arriving(&file.bytes(), options(3));
    let error = items.pop().expect("an item").expect_err("there are two").to_string();
    assert!(error.contains("found 2, and stream 3 asked for"), "{error}");
    // A stream of events remains one, whatever the name of a packet is.
    file.push(4, &damaged);
    let (count, error) = refused(&file.bytes());
    let expected = decode(&file.bytes()).expect_err("the name of a packet").to_string();
    assert_eq!((count, error), (events().len(), expected));
}

#[test]
fn another_stream_of_events_is_read_where_it_is_asked_for() {
    let mut file = File::new(Compression::Lz4, None);
    let second = Sensor::new(10, 10);
    file.xml = outputs(
        &[stream(5, "left", "EVTS", Some(SENSOR)), stream(2, "right", "EVTS", Some(second))].concat(),
    );
    file.push(2, &event_packet(&events()[..3]));
    file.push(5, &event_packet(&events()));
    let options = |number| ReadOptions::default().stream(std::num::NonZeroU16::new(number));
    assert_eq!(sound(&file.bytes(), options(1)), (events(), Some(SENSOR)));
    // The engine counts events outside the sensor.
    assert_eq!(sound(&file.bytes(), options(2)), (events()[..3].to_vec(), Some(second)));
    let (items, _) = arriving(&file.bytes(), options(3));
    assert!(matches!(&items[..], [Err(IoError::Unsupported { .. })]), "{items:?}");
}

#[test]
fn odd_events_of_a_packet_are_told_and_the_others_come() {
    let mut elements: Vec<u8> = event_packet(&events()[..4])[32 - 8 + 8..].to_vec();
    elements[16 + 12] = 7;
    let mut file = File::new(Compression::Lz4, Some(SENSOR));
    file.table = None;
    file.push(0, &vector(*b"EVTS", 4, &elements));
    file.push(0, &event_packet(&events()[4..6]));
    let (items, _) = arriving(&file.bytes(), ReadOptions::default());
    let [Err(first), rest @ ..] = &items[..] else { panic!("{items:?}") };
    assert!(first.is_about_a_line() && matches!(first, IoError::Datagram { number: 1, .. }), "{first}");
    let found: Vec<_> = rest.iter().map(|item| *item.as_ref().expect("an event")).collect();
    assert_eq!(found, [&events()[..1], &events()[2..6]].concat());
}

#[test]
fn a_stream_that_is_cut_or_no_stream_ends_with_its_place() {
    let mut bytes = Vec::new();
    let mut writer = Aedat4Writer::stream(&mut bytes, SENSOR).unwrap();
    let greeting = writer.length() as usize;
    writer.write(&events()).unwrap();
    for (length, what) in [
        (0, "size of the header at byte 0 is cut short"),
        (3, "size of the header at byte 0 is cut short"),
        (greeting - 1, "header at byte 0 is cut short"),
        (greeting + 7, "header of a packet"),
        (bytes.len() - 1, "packet at byte"),
    ] {
        let (events, error) = refused(&bytes[..length]);
        assert!(events == 0 && error.contains(what) && error.contains("cut short"), "{length}: {error}");
    }
    assert_eq!(sound(&bytes[..greeting], ReadOptions::default()), (Vec::new(), Some(SENSOR)));
    for size in [-1, i32::MAX, PACKET_BYTES as i32 + 1] {
        let mut odd = bytes.clone();
        odd.extend([&0_i32.to_le_bytes()[..], &size.to_le_bytes()].concat());
        let (found, error) = refused(&odd);
        assert_eq!(found, events().len(), "{error}");
        assert!(error.contains(if size < 0 { "size of a packet" } else { "is too large" }), "{error}");
    }
    assert!(refused(b"10,3,4,1\n20,3,4,1\n").1.contains("header"), "a text");
    assert!(refused(&[0xff; 100]).1.contains("too large"), "other bytes");
}

proptest! {
    #[test]
    fn what_is_streamed_is_what_is_read_of_the_file_whatever_the_pieces(
        events in prop::collection::vec(any_event(any::<i64>(), 260), 0..60),
        size in 1..20_usize,
    ) {
        let (mut network, mut file) = (Vec::new(), Cursor::new(Vec::new()));
        let mut stream = Aedat4Writer::stream(&mut network, SENSOR).unwrap();
        let mut writer = Aedat4Writer::new(&mut file, SENSOR).unwrap();
        for some in events.chunks(size) {
            stream.write(some).unwrap();
            writer.write(some).unwrap();
        }
        writer.finish().unwrap();
        let decoded = decode(file.get_ref()).unwrap().events;
        prop_assert_eq!(&decoded, &events);
        for bytes in [&network, file.get_ref()] {
            prop_assert_eq!(&sound(bytes, ReadOptions::default()).0, &events);
        }
    }

    #[test]
    fn damage_gives_events_or_an_error_and_ends(at in 0..3_000_usize, byte in any::<u8>(), cut in 0..3_000_usize) {
        let mut bytes = sample(Compression::Lz4);
        let length = bytes.len();
        bytes[at % length] ^= byte;
        bytes.truncate(length.saturating_sub(cut));
        let (items, _) = arriving(&bytes, ReadOptions::default());
        let ends = items.iter().filter(|item| item.as_ref().is_err_and(|error| !error.is_about_a_line()));
        prop_assert!(ends.count() <= 1);
    }
}
