//! Event Stream 2, N-MNIST, and recordings inside gzip and zip.

use std::fs;
use std::io::Write;

use flate2::write::DeflateEncoder;
use flate2::{Compression, GzBuilder};
use meissner_engine::{Event, Sensor};
use meissner_io::limits::{EXPANSION, PACKET_BYTES};
use meissner_io::{
    Format, IoError, Place, ReadOptions, TextOptions, TimeRange, TimeUnit, decode, decode_with, detect,
    encode, read, read_content,
};
use proptest::prelude::*;
use rawzip::{CompressionMethod, ZipArchiveWriter};

use meissner_io_tests::codecs::{
    SENSOR, any_event, encoded, events, nmnist, samples, sorted_events, strictly,
};

/// An archive with these entries, deflated.
pub(crate) fn zip<'a, C: AsRef<[u8]>>(entries: impl IntoIterator<Item = (&'a str, C)>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut bytes);
    for (name, content) in entries {
        let file = archive.new_file(name).compression_method(CompressionMethod::DEFLATE);
        let (mut entry, config) = file.start().unwrap();
        let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
        writer.write_all(content.as_ref()).unwrap();
        let (encoder, descriptor) = writer.finish().unwrap();
        encoder.finish().unwrap();
        entry.finish(descriptor).unwrap();
    }
    archive.finish().unwrap();
    bytes
}

/// `content` as a gzip file of one member.
fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzBuilder::new().filename("recording").write(Vec::new(), Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn every_format_is_read_from_gzip_and_zip_as_it_is_without() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("packed");
    for (format, bytes) in samples() {
        let plain = decode(&bytes).unwrap();
        for packed in [gzip(&bytes), zip([("a/recording", &bytes)])] {
            assert_eq!(decode(&packed).unwrap(), plain, "{format}");
            assert_eq!(decode_with(&packed, format).unwrap(), plain, "{format}");
            let part = ReadOptions::from(format).range(TimeRange::since_first(0..10_000));
            assert_eq!(decode_with(&packed, part).unwrap().events, plain.events[..15], "{format}");
            fs::write(&path, &packed).unwrap();
            assert_eq!(read(&path).unwrap(), plain, "{format}");
            assert_eq!(read_content(&path).unwrap(), bytes, "{format}");
            assert_eq!(detect(&packed), None, "the format is that of the content");
        }
    }
}

#[test]
fn the_members_of_a_gzip_file_are_one_content() {
    let bytes = encoded(Format::Dat, Some(SENSOR), &events());
    let (a, b) = bytes.split_at(77);
    assert_eq!(decode(&[gzip(a), gzip(b)].concat()).unwrap().events, events());
}

#[test]
fn a_recording_among_other_files_of_an_archive_is_found() {
    let bytes = encoded(Format::Evt3, Some(SENSOR), &events());
    let files: [(&str, &[u8]); 4] = [
        ("about.txt", b"A recording by hand.\n"),
        ("data/", b""),
        ("data/recording.raw", &bytes),
        ("__MACOSX/data/._recording.raw", &bytes),
    ];
    assert_eq!(decode(&zip(files)).unwrap().events, events());
}

#[test]
fn an_archive_without_one_recording_is_refused_with_their_number() {
    let bytes = encoded(Format::Evt3, None, &events());
    let error = decode(&zip([("a.raw", &bytes), ("b.raw", &bytes), ("c", &Vec::new())])).unwrap_err();
    let expected = "unsupported: expected one recording of events in a zip archive, or arrays t, x, y and p, \
                    found 2 among 3 files (a.raw, b.raw): unpack it with unzip";
    assert_eq!(error.to_string(), expected);
    let error = decode(&zip([("a", b""), ("b", b"")])).unwrap_err().to_string();
    assert!(error.contains("found 0 among 2 files"), "{error}");
    // If there is only one file, its own reader refuses it.
    let error = decode(&zip([("a", b"#ROSBAG V2.0\n")])).unwrap_err();
    assert!(matches!(error, IoError::OtherKind { .. }), "{error}");
    let error = decode(&gzip(&gzip(&bytes))).unwrap_err();
    assert!(matches!(error, IoError::OtherKind { .. }), "{error}");
}

#[test]
fn a_cut_or_damaged_gzip_file_is_refused() {
    let packed = gzip(&encoded(Format::Dat, Some(SENSOR), &events()));
    for length in 3..packed.len() {
        let error = decode(&packed[..length]).unwrap_err();
        assert!(matches!(error, IoError::Truncated { format: "gzip", .. }), "{length}: {error}");
    }
    for at in [packed.len() - 8, packed.len() - 1, packed.len() / 2] {
        let mut changed = packed.clone();
        changed[at] ^= 0x10;
        assert!(decode(&changed).is_err(), "byte {at}");
    }
    let error = decode(&[&packed[..], b"more than that"].concat()).unwrap_err();
    assert!(matches!(error, IoError::Malformed { format: "gzip", .. }), "{error}");
}

#[test]
fn a_cut_gzip_file_is_salvaged_up_to_the_cut() {
    // Every member is complete or missing.
    let bytes = encoded(Format::Dat, Some(SENSOR), &events());
    let (first, second) = bytes.split_at(bytes.len() - 80);
    let whole = gzip(first);
    let packed = [whole.clone(), gzip(second)].concat();
    let cut = &packed[..whole.len() + 12];
    assert!(decode(cut).is_err());
    let salvaged = decode_with(cut, ReadOptions::default().salvage(true)).unwrap();
    assert_eq!(salvaged.events, events()[..30]);
    assert_eq!(salvaged.salvaged.unwrap().place, Place::Byte(cut.len() as u64));
}

#[test]
fn flipped_bits_and_cuts_of_an_archive_give_an_error_or_a_recording() {
    let packed = zip([("a.dat", encoded(Format::Dat, Some(SENSOR), &events())), ("b", b"text".to_vec())]);
    for bit in 0..packed.len() * 8 {
        let mut changed = packed.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        let _ = decode(&changed);
    }
    for length in 4..packed.len() {
        assert!(decode(&packed[..length]).is_err(), "cut at {length}");
    }
}

#[test]
fn what_unpacks_beyond_the_bound_is_refused() {
    // 160 MiB of zeros in 160 KiB: beyond 64 MiB and 64 bytes for each byte.
    let zeros = vec![0; 160 << 20];
    let packed = gzip(&zeros);
    assert!(zeros.len() as u64 > PACKET_BYTES + packed.len() as u64 * EXPANSION, "{}", packed.len());
    let error = decode(&packed).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { format: "gzip", at_least: true, .. }), "{error}");
    let error = decode(&zip([("zeros", &zeros)])).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { format: "zip", what: "content", .. }), "{error}");
}

/// A file of npy with this type, shape and content.
fn npy(descr: &str, shape: &str, content: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), content].concat()
}

#[test]
fn arrays_of_anything_else_beside_the_events_are_no_recordings() {
    let records = encoded(Format::Npy, None, &events());
    let matrix = npy("'<f8'", "(2, 2)", &[0; 32]);
    let label = npy("'<i8'", "()", &[3, 0, 0, 0, 0, 0, 0, 0]);
    let files = [("K.npy", &matrix), ("events.npy", &records), ("label.npy", &label), ("t.npy", &label)];
    assert_eq!(decode(&zip(files)).unwrap().events, events());
    // If there are two recordings, the one with this name is read.
    let other = encoded(Format::Npy, None, &events()[..7]);
    assert_eq!(
        decode(&zip([("triggers.npy", &other), ("a/events.npy", &records)])).unwrap().events,
        events()
    );
    let error = decode(&zip([("left.npy", &other), ("right.npy", &records)])).unwrap_err().to_string();
    assert!(error.contains("found 2 among 2 files (left.npy, right.npy)"), "{error}");
}

#[test]
fn four_arrays_of_an_archive_are_put_together_to_events() {
    let all = events();
    let shape = format!("({},)", all.len());
    let column = |descr: &str, value: &dyn Fn(&Event) -> Vec<u8>| {
        npy(descr, &shape, &all.iter().flat_map(value).collect::<Vec<u8>>())
    };
    let x = column("'>i4'", &|e| i32::from(e.x).to_be_bytes().to_vec());
    let y = column("'<u2'", &|e| e.y.to_le_bytes().to_vec());
    let whole = column("'<i8'", &|e| e.t_us.to_le_bytes().to_vec());
    let seconds = column("'<f8'", &|e| (e.t_us as f64 / 1e6).to_le_bytes().to_vec());
    let floats = column("'<f4'", &|e| (e.t_us as f32).to_le_bytes().to_vec());
    let p = column("'|b1'", &|e| vec![e.on.into()]);
    let signed = column("'|i1'", &|e| vec![if e.on { 1 } else { 0xff }]);
    let intrinsics = npy("'<f8'", "(3,)", &[0; 24]);
    for (t, time) in [("t", &whole), ("ts", &whole), ("timestamp", &seconds), ("time", &floats)] {
        for (polarity, sign) in [("p", &p), ("pol", &signed), ("polarity", &p)] {
            let names =
                [("x.npy", &x), ("y.npy", &y), ("K.npy", &intrinsics)].map(|(n, c)| (n.to_owned(), c));
            let named = [(format!("{t}.npy"), time), (format!("{polarity}.npy"), sign)];
            let files: Vec<_> = names.into_iter().chain(named).collect();
            let recording =
                decode(&zip(files.iter().map(|(name, content)| (name.as_str(), content)))).unwrap();
            assert_eq!(recording.events, all, "{t} {polarity}");
        }
    }
    let error = decode(&zip([("x.npy", &x), ("y.npy", &y), ("t.npy", &whole)])).unwrap_err().to_string();
    assert!(error.contains("arrays t, x, y and p"), "{error}");
    let short = npy("'|b1'", "(1,)", &[1]);
    let files = [("x.npy", &x), ("y.npy", &y), ("t.npy", &whole), ("p.npy", &short)];
    assert!(decode(&zip(files)).unwrap_err().to_string().contains("one length"));
    // Floats without a stated unit.
    let unclear = npy("'<f8'", "(1,)", &1.25_f64.to_le_bytes());
    let one = |descr: &str, width: usize| npy(descr, "(1,)", &vec![0; width]);
    let files =
        [("x.npy", one("'<u2'", 2)), ("y.npy", one("'<u2'", 2)), ("t.npy", unclear), ("p.npy", short)];
    let bytes = zip(files);
    assert!(decode(&bytes).unwrap_err().to_string().contains("names the unit"));
    let unit = TextOptions::default().time_unit(TimeUnit::Milliseconds);
    let read = decode_with(&bytes, ReadOptions::default().text(unit)).unwrap();
    assert_eq!(read.events[0].t_us, 1250);
}

/// A file of 4 x 3 pixels with this version, this type and this content.
fn es(version: [u8; 3], kind: u8, content: &[u8]) -> Vec<u8> {
    [&b"Event Stream"[..], &version, &[kind, 4, 0, 3, 0], content].concat()
}

#[test]
fn an_event_is_a_step_of_time_with_its_polarity_and_a_pixel_from_the_bottom() {
    let content = [2 << 1 | 1, 3, 0, 2, 0, 0xff, 0xff, 126 << 1, 0, 0, 1, 0];
    let recording = decode(&es([2, 0, 0], 1, &content)).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Es, Some(Sensor::new(4, 3))));
    assert_eq!(recording.events, [Event::new(2, 3, 0, true), Event::new(2 + 2 * 127 + 126, 0, 1, false)]);
}

#[test]
fn resets_and_overflows_at_the_end_say_nothing() {
    let content = [0xfe, 0xfe, 1, 0, 0, 0, 0, 0xfe, 0xff];
    assert_eq!(decode(&es([2, 1, 9], 1, &content)).unwrap().events, [Event::new(0, 0, 2, true)]);
}

#[test]
fn other_versions_and_types_are_refused_by_name() {
    let error = decode(&es([1, 0, 0], 1, &[])).unwrap_err().to_string();
    assert_eq!(error, "unsupported: expected Event Stream of version 2, found version 1.0.0");
    let error = decode(&es([2, 0, 0], 2, &[])).unwrap_err().to_string();
    assert_eq!(
        error,
        "unsupported: expected Event Stream of DVS events (type 1), found type 2 (ATIS events)"
    );
    let error = decode(&es([2, 0, 0], 9, &[])).unwrap_err().to_string();
    assert!(error.ends_with("type 9 (unknown)"), "{error}");
}

#[test]
fn a_cut_event_a_pixel_beside_the_sensor_and_an_empty_sensor_are_refused() {
    let error = decode(&es([2, 0, 0], 1, &[0, 0, 0])).unwrap_err();
    assert!(
        matches!(error, IoError::Truncated { what: "the last event", expected: 5, actual: 3, .. }),
        "{error}"
    );
    let error = strictly(&es([2, 0, 0], 1, &[0, 4, 0, 0, 0])).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { x: 4, .. }), "{error}");
    let mut empty = es([2, 0, 0], 1, &[]);
    empty[16] = 0;
    assert!(matches!(decode(&empty), Err(IoError::Malformed { what: "sensor", .. })));
    let error = decode_with(b"Event Scream\x02", Format::Es).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "magic", .. }), "{error}");
}

#[test]
fn a_writer_refuses_a_step_back_a_late_time_and_no_sensor() {
    let at = |t_us| Event::new(t_us, 0, 0, true);
    let refuse = |sensor, events: &[Event]| {
        let mut bytes = Vec::new();
        let error = encode(Format::Es, sensor, events, &mut bytes).unwrap_err();
        assert!(bytes.is_empty());
        error.to_string()
    };
    let error = refuse(Some(SENSOR), &[at(5), at(4)]);
    assert_eq!(error, "ES cannot hold event 1: expected t_us in order, found 4 after 5");
    assert!(refuse(Some(SENSOR), &[at(1 << 33)]).contains("expected t_us 0 to 8589934591"));
    assert_eq!(
        refuse(None, &[at(0)]),
        "unsupported: expected a sensor, which a file of AEDAT4, ES or MCAP must name, found none"
    );
}

#[test]
fn a_silence_of_any_length_comes_back() {
    for silence in [126, 127, 128, 4096 * 127 - 1, 4096 * 127, 4096 * 127 + 1, (1 << 33) - 1] {
        let events = [Event::new(0, 1, 2, true), Event::new(silence, 3, 4, false)];
        let bytes = encoded(Format::Es, Some(SENSOR), &events);
        assert_eq!(bytes.len() as i64, 20 + 5 + silence / 127 + 5, "{silence} us");
        assert_eq!(decode(&bytes).unwrap().events, events, "{silence} us");
    }
}

proptest! {
    #[test]
    fn every_event_comes_back(events in sorted_events(3_000_000, 4096)) {
        let sensor = Some(Sensor::new(4096, 4096));
        let recording = decode(&encoded(Format::Es, sensor, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (sensor, events));
    }
}

#[test]
fn polarity_is_the_top_bit_of_a_time_of_23_bits() {
    let recording = decode(&[33, 2, 0xff, 0xff, 0xff, 0, 0, 0x00, 0x01, 0x02]).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Nmnist, Some(Sensor::new(34, 34))));
    assert_eq!(recording.events, [Event::new(0x007f_ffff, 33, 2, true), Event::new(0x102, 0, 0, false)]);
}

#[test]
fn a_pixel_beside_the_sensor_is_refused_with_its_byte_by_a_strict_reader() {
    let strict = ReadOptions::from(Format::Nmnist).strict(true);
    let error = decode_with(&[0, 0, 0, 0, 0, 34, 0, 0, 0, 0], strict).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { place: Place::Byte(5), x: 34, .. }), "{error}");
}

#[test]
fn a_cut_event_is_refused_with_its_byte() {
    let error = decode_with(&[0; 13], Format::Nmnist).unwrap_err();
    assert_eq!(
        error.to_string(),
        "N-MNIST: the last event at byte 10 is cut short: expected 5 bytes, found 3"
    );
}

proptest! {
    #[test]
    fn every_event_of_n_mnist_comes_back(events in prop::collection::vec(any_event(0..1_i64 << 23, 34), 1..50)) {
        prop_assert_eq!(decode(&nmnist(&events)).unwrap().events, events);
    }
}
