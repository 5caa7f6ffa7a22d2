//! HDF5 of DSEC and Prophesee. The files are next to this one; `hdf5/write.py` wrote them.

use std::path::{Path, PathBuf};

use meissner_engine::{Event, Sensor};
use meissner_io::{
    CsvEvents, Format, IoError, Kind, Place, ReadOptions, Recording, TimeRange, blocks, decode, decode_with,
    read, read_range,
};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("codecs/hdf5").join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).unwrap()
}

/// The first `count` events of the pattern that `write.py` writes, from `origin_us` on.
fn pattern(count: i64, origin_us: i64) -> Vec<Event> {
    let event = |i: i64| {
        let (t_us, on) = (7 * i + 40_000 * (i / 1000), i * i / 5 % 2 == 1);
        Event::new(origin_us + t_us, (i % 640) as u16, (i / 640 % 480) as u16, on)
    };
    (0..count).map(event).collect()
}

fn refusal(name: &str) -> String {
    decode(&bytes(name)).unwrap_err().to_string()
}

#[test]
fn the_arrays_of_dsec_are_events_with_the_offset_in_their_times() {
    let Recording { format, sensor, events, other_streams, salvaged, .. } = read(&path("dsec.h5")).unwrap();
    assert_eq!((format, sensor, salvaged), (Format::Hdf5, None, None));
    assert!(other_streams.is_empty());
    assert_eq!(events, pattern(1500, 49_599_300_523));
    assert_eq!(Kind::of(&bytes("dsec.h5")), Some(Kind::Events(Format::Hdf5)));
}

#[test]
fn the_records_of_prophesee_are_events_with_a_sensor() {
    let recording = read(&path("prophesee.h5")).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Hdf5, Some(Sensor::new(640, 480))));
    assert_eq!(recording.events, pattern(600, 0));
}

#[test]
fn every_codec_of_blosc_that_is_read_gives_the_same_events_in_many_blocks() {
    assert_eq!(read(&path("codecs.h5")).unwrap().events, pattern(100_003, 0));
}

#[test]
fn integers_of_any_size_sign_and_byte_order_are_read() {
    assert_eq!(read(&path("types.h5")).unwrap().events, pattern(1000, 0));
}

#[test]
fn a_chunk_that_blosc_could_not_compress_is_read() {
    let events = read(&path("stored.h5")).unwrap().events;
    assert_eq!((events.len(), events[0]), (64, Event::new(5, 0, 0, true)));
    assert!(events.iter().enumerate().all(|(i, e)| usize::from(e.x) == i && e.x == e.y));
}

#[test]
fn a_file_without_events_is_an_empty_recording() {
    assert_eq!(read(&path("empty.h5")).unwrap().events, []);
    let range = TimeRange::since_first(0..1000);
    let part = read_range(&path("empty.h5"), ReadOptions::default(), range).unwrap().unwrap();
    assert_eq!(part.events, []);
    assert_eq!(blocks(&path("empty.h5"), ReadOptions::default()).unwrap().unwrap().count(), 0);
}

#[test]
fn a_part_and_the_blocks_are_those_of_the_whole() {
    for name in ["dsec.h5", "prophesee.h5", "codecs.h5", "types.h5"] {
        let whole = read(&path(name)).unwrap().events;
        let joined: Vec<_> = blocks(&path(name), Format::Hdf5)
            .unwrap()
            .unwrap()
            .flat_map(|block| block.unwrap().events)
            .collect();
        assert_eq!(joined, whole, "{name}");
        let first_us = whole[0].t_us;
        for times in
            [0..1, 0..i64::MAX, 6_000..7_000, 7_000..47_000, 47_000..47_001, 3_000_000..3_100_000, -5..0]
        {
            let expected: Vec<_> =
                whole.iter().filter(|event| times.contains(&(event.t_us - first_us))).copied().collect();
            let range = TimeRange::since_first(times.clone());
            let part = read_range(&path(name), ReadOptions::default(), range).unwrap().unwrap();
            assert_eq!(part.events, expected, "{name} {times:?}");
            let options = ReadOptions::default().range(range);
            assert_eq!(decode_with(&bytes(name), options).unwrap().events, expected, "{name} {times:?}");
        }
    }
}

/// One chunk in the middle of the part is damaged, and one far from it.
#[test]
fn chunks_beyond_the_part_are_not_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let whole = bytes("codecs.h5");
    let damaged = folder.path().join("damaged.h5");
    let first_second = ReadOptions::default().range(TimeRange::since_first(0..1000));
    let mut outcomes = Vec::new();
    for at in (0..whole.len()).step_by(64) {
        let mut bytes = whole.clone();
        bytes[at..(at + 8).min(whole.len())].fill(0x55);
        std::fs::write(&damaged, &bytes).unwrap();
        let part = meissner_io::read_with(&damaged, first_second);
        outcomes.push((read(&damaged).is_ok_and(|r| r.events == pattern(100_003, 0)), part.is_ok()));
    }
    assert!(outcomes.contains(&(false, true)), "damage beyond the part ends it");
    assert!(outcomes.contains(&(false, false)), "damage in the part is not found");
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    assert_eq!(
        refusal("other.h5"),
        "unsupported: expected HDF5 with events/t, x, y and p (DSEC) or CD/events (Prophesee), found HDF5 with poses, images"
    );
    assert!(refusal("bits.h5").contains("found bits shuffled"), "{}", refusal("bits.h5"));
    assert!(refusal("blosclz.h5").contains("found BloscLZ"), "{}", refusal("blosclz.h5"));
    assert!(
        refusal("uneven.h5").contains("expected one length, found [4, 4, 4, 3]"),
        "{}",
        refusal("uneven.h5")
    );
    assert!(refusal("floats.h5").contains("integers of 1, 2, 4 or 8 bytes"), "{}", refusal("floats.h5"));
    let as_text = CsvEvents::new(&bytes("dsec.h5")[..]).next().unwrap().unwrap_err().to_string();
    assert_eq!(as_text, "expected events as text, found a recording of events (HDF5)");
    let error = decode_with(b"\x89HDF\r\n\x1a\n", Format::Hdf5).unwrap_err();
    assert!(matches!(error, IoError::Malformed { place: Place::Byte(0), .. }), "{error}");
}

#[test]
fn an_event_beside_the_sensor_is_left_out_or_refused_with_its_number() {
    let mut file = bytes("prophesee.h5");
    let at = file.windows(7).position(|window| window == b"640x480").unwrap();
    file[at..at + 7].copy_from_slice(b"100x480");
    let problem = "HDF5: pixel at event 100: expected x < 100 and y < 480, found x = 100, y = 0";
    let Recording { events, left_out, .. } = decode(&file).unwrap();
    let [outside] = &left_out[..] else { panic!("{left_out:?}") };
    assert_eq!((events.len(), outside.count, outside.first[0].as_str()), (100, 500, problem));
}

#[test]
fn a_cut_or_damaged_file_gives_an_error_or_a_recording() {
    for name in ["stored.h5", "prophesee.h5"] {
        let whole = bytes(name);
        for length in (0..whole.len()).step_by(7) {
            if let Ok(recording) = decode_with(&whole[..length], Format::Hdf5) {
                assert_eq!(recording, decode(&whole).unwrap(), "{name} cut at {length}");
            }
        }
        let mut damaged = whole.clone();
        for at in 0..whole.len() {
            for value in [0, 0x7f, 0xff] {
                damaged[at] = value;
                let _ = decode_with(&damaged, Format::Hdf5);
            }
            damaged[at] = whole[at];
        }
    }
}
