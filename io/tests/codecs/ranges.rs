//! Parts of recordings by time: equal to the cut whole recording; the other parts are not read.

use std::fs;
use std::ops::Range;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::{
    DISORDER_US, Format, ReadOptions, Recording, TimeRange, blocks, decode, decode_with, read_with,
};
use proptest::prelude::*;

use crate::shared_files::shared;
use meissner_io_tests::codecs::aedat::{self, DAVIS346, aedat2, davis_records};
use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet};
use meissner_io_tests::codecs::{SENSOR, encoded, evt2, evt2_words, evt21, evt21_words, samples};

fn part(bytes: &[u8], range: TimeRange) -> Recording {
    decode_with(bytes, ReadOptions::default().range(range)).unwrap()
}

fn cut(events: &[Event], times: &Range<i64>) -> Vec<Event> {
    events.iter().copied().filter(|event| times.contains(&event.t_us)).collect()
}

/// Checks that the part equals that of the whole recording, in the file's times and since the first
/// event.
fn is_cut(format: Format, bytes: &[u8], times: &Range<i64>) {
    let whole = decode_with(bytes, format).unwrap();
    let first = whole.events.first().map_or(0, |event| event.t_us);
    for range in [
        TimeRange::of_file(times.clone()),
        TimeRange::since_first(times.start - first..times.end.saturating_sub(first)),
    ] {
        let part = decode_with(bytes, ReadOptions::from(format).range(range)).unwrap();
        assert_eq!(part.events, cut(&whole.events, times), "{format} {range:?}");
        assert_eq!((part.format, part.sensor, part.salvaged), (format, whole.sensor, None));
    }
}

/// The records of DAT of `events`, whose times may go beyond 32 bits.
fn dat(events: &[Event]) -> Vec<u8> {
    let mut bytes = encoded(Format::Dat, Some(SENSOR), &[]);
    for e in events {
        let pixel = u32::from(e.x) | u32::from(e.y) << 14 | u32::from(e.on) << 28;
        bytes.extend([(e.t_us as u32).to_le_bytes(), pixel.to_le_bytes()].concat());
    }
    bytes
}

/// `events` in every format; formats that hold only ascending times get them sorted.
fn files(events: &[Event], packet: usize) -> Vec<(Format, Vec<u8>)> {
    let mut sorted = events.to_vec();
    sorted.sort_by_key(|event| event.t_us);
    let mut records = davis_records(SENSOR, events);
    // The values of frames are between the events.
    (0..records.len()).rev().step_by(7).for_each(|i| records.insert(i, [1 << 31, records[i][1]]));
    let mut files = vec![
        (Format::Dat, dat(events)),
        (Format::Npy, encoded(Format::Npy, None, events)),
        (Format::Csv, encoded(Format::Csv, Some(SENSOR), events)),
        (Format::Evt2, evt2("% evt 2.0\n% geometry 346x260\n% end\n", &evt2_words(events))),
        (
            Format::Evt21,
            evt21("% format EVT21;height=260;width=346;endianness=legacy\n", &evt21_words(events), true),
        ),
        (Format::Aedat2, aedat2(&DAVIS346, &records)),
        (Format::Aedat3, aedat::aedat3(events, packet)),
    ];
    if sorted.last().is_none_or(|event| event.t_us < 1 << 33) {
        files.push((Format::Evt3, encoded(Format::Evt3, Some(SENSOR), &sorted)));
        files.push((Format::Es, encoded(Format::Es, Some(SENSOR), &sorted)));
    }
    for (compression, is_closed) in Compression::ALL.into_iter().zip([true, false, true]) {
        let mut file = File::new(compression, Some(SENSOR));
        file.table = file.table.filter(|_| is_closed);
        file.push(0, &event_packet(&[]));
        events.chunks(packet).for_each(|events| file.push(0, &event_packet(events)));
        files.push((Format::Aedat4, file.bytes()));
    }
    files
}

/// `count` events from `first_us` on, with a mean distance of `step_us`, and steps back of up to
/// `back_us`.
fn stream(count: i64, first_us: i64, step_us: i64, back_us: i64) -> Vec<Event> {
    let event = |i: i64| {
        let wobble = (i * 7919) % (back_us / 2 + 1);
        let t_us = (first_us + i * step_us - wobble).max(first_us);
        Event::new(t_us, (i % 346) as u16, (i % 259) as u16, i % 3 == 0)
    };
    (0..count).map(event).collect()
}

#[test]
fn every_format_gives_the_part_of_the_whole() {
    for (format, bytes) in samples() {
        let last = decode(&bytes).unwrap().events.last().unwrap().t_us;
        for times in [0..last, 1000..1001, 9_000..20_000, last..i64::MAX, last + 1..i64::MAX, 5_000..5_000] {
            is_cut(format, &bytes, &times);
        }
    }
}

#[test]
fn a_recording_without_events_has_empty_parts() {
    for (format, bytes) in files(&[], 5) {
        is_cut(format, &bytes, &(0..100));
    }
}

#[test]
fn the_clock_is_followed_over_its_wraps() {
    // Five hours, with an event every two seconds: four wraps of 32 bits, one of 34 bits.
    let events = stream(9_000, 5, 2_000_000, 400_000);
    let minute = 60_000_000;
    for (format, bytes) in files(&events, 40) {
        for times in [0..minute, 70 * minute..73 * minute, 143 * minute..144 * minute, 280 * minute..i64::MAX]
        {
            is_cut(format, &bytes, &times);
            if format == Format::Dat {
                assert_eq!(part(&bytes, TimeRange::of_file(times.clone())).events, cut(&events, &times));
            }
        }
    }
}

/// The events of the blocks of a file; `None` if it has no blocks.
fn in_blocks(path: &Path, format: Format) -> Option<Vec<Recording>> {
    Some(blocks(path, format).unwrap()?.map(|block| block.unwrap()).collect())
}

#[test]
fn the_blocks_of_a_file_are_the_whole_recording() {
    let folder = tempfile::tempdir().unwrap();
    // Times step back, and the clock of 32 bits wraps twice: in a block and between two blocks.
    for (count, step_us, back_us) in [(150_000, 70_000, 90_000), (3, 5, 0), (0, 0, 0)] {
        for (i, (format, bytes)) in
            files(&stream(count, 1_000_000, step_us, back_us), 900).into_iter().enumerate()
        {
            let path = folder.path().join(format!("{count}.{i}"));
            fs::write(&path, &bytes).unwrap();
            let whole = decode_with(&bytes, format).unwrap();
            let Some(blocks) = in_blocks(&path, format) else {
                assert!(matches!(format, Format::Evt3 | Format::Es | Format::Csv) || count == 0, "{format}");
                continue;
            };
            assert!(
                blocks.iter().all(|block| (block.format, block.sensor) == (format, whole.sensor)),
                "{format}"
            );
            assert!(blocks.len() > 1 || count < 100_000, "{format}");
            let events: Vec<Event> = blocks.into_iter().flat_map(|block| block.events).collect();
            assert!(events == whole.events, "{format} with {count} events");
        }
    }
}

#[test]
fn a_fault_of_a_block_is_found_when_it_is_read_and_ends_the_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("events.npy");
    let mut bytes = encoded(Format::Npy, None, &stream(100_000, 0, 10, 0));
    *bytes.last_mut().unwrap() = 7;
    fs::write(&path, &bytes).unwrap();
    let mut blocks = blocks(&path, ReadOptions::default().strict(true)).unwrap().unwrap();
    assert!(blocks.next().unwrap().is_ok() && blocks.next().unwrap().is_err() && blocks.next().is_none());
}

#[test]
fn what_is_beyond_the_part_is_not_read() {
    let events = stream(50_000, 1_000_000, 1_000, 0);
    let times = 20_000_000..21_000_000;
    let expected = cut(&events, &times);
    for (format, mut bytes) in files(&events, 100) {
        let whole = match format {
            // The first and last eighth are damaged: rows beyond the sensor, and packets that
            // cannot be unpacked.
            Format::Dat | Format::Npy | Format::Evt2 => {
                let length = bytes.len();
                for i in [length / 8, length - length / 8] {
                    let end = (length - (length - i) / 8 * 8).min(length - 8);
                    bytes[end..end + 8].fill(if format == Format::Npy { 0x7f } else { 0xdf });
                }
                decode_with(&bytes, ReadOptions::from(format).strict(true))
            }
            _ => continue,
        };
        assert!(whole.is_err(), "{format}");
        let part = ReadOptions::from(format).strict(true).range(TimeRange::of_file(times.clone()));
        assert_eq!(decode_with(&bytes, part).unwrap().events, expected, "{format}");
    }
}

#[test]
fn packets_beyond_the_part_are_not_unpacked() {
    let events = stream(20_000, 1_000_000, 1_000, 0);
    let mut file = File::new(Compression::Lz4, Some(SENSOR));
    events.chunks(100).for_each(|events| file.push(0, &event_packet(events)));
    for packet in [3, 170] {
        file.packets[packet].1.fill(0xff);
    }
    let times = 9_000_000..10_000_000;
    let bytes = file.bytes();
    assert!(decode(&bytes).is_err());
    assert_eq!(part(&bytes, TimeRange::of_file(times.clone())).events, cut(&events, &times));
}

#[test]
fn a_recording_that_is_cut_short_is_refused_or_salvaged_as_without_a_range() {
    let bytes = encoded(Format::Dat, Some(SENSOR), &stream(1_000, 0, 10_000, 0));
    let options = ReadOptions::default().range(TimeRange::since_first(0..50_000));
    assert!(decode_with(&bytes[..bytes.len() - 1], options).is_err());
    let salvaged = decode_with(&bytes[..bytes.len() - 1], options.salvage(true)).unwrap();
    assert_eq!((salvaged.events.len(), salvaged.salvaged.is_some()), (5, true));
}

#[test]
fn a_long_header_is_read_before_the_part() {
    let events = stream(5_000, 7, 10_000, 0);
    let entry = format!("<entry key=\"Davis346B.bias\" value=\"{}\"/>", "7".repeat(100));
    let mut lines = vec![entry.as_str(); 4_000];
    lines.extend(DAVIS346);
    let bytes = aedat2(&lines, &davis_records(SENSOR, &events));
    is_cut(Format::Aedat2, &bytes, &(30_000_000..31_000_000));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn parts_of_real_recordings_are_those_of_the_whole() {
    for (name, has_table) in [
        ("tactile_dots.aedat4", true),
        ("davis346.aedat4", true),
        ("evk4_1280x720.dat", true),
        ("gen3_640x480_burst.evt2.raw", true),
        ("evk4_1280x720.evt3.raw", false),
    ] {
        let path = shared(&format!("data/events/{name}"));
        let whole = read_with(&path, ReadOptions::default()).unwrap();
        let (first, last) = (whole.events[0].t_us, whole.events.last().unwrap().t_us);
        for (from, to) in
            [(0, 1000), ((last - first) / 2, (last - first) * 6 / 10), ((last - first) * 9 / 10, i64::MAX)]
        {
            let options = ReadOptions::default().range(TimeRange::since_first(from..to));
            let part = read_with(&path, options).unwrap();
            assert_eq!(part.events, cut(&whole.events, &(first + from..first.saturating_add(to))), "{name}");
            assert!(has_table || part.other_streams == whole.other_streams);
        }
    }
}

#[test]
fn a_file_is_read_as_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let events = stream(3_000, 99, 5_000, 1_000);
    let options = ReadOptions::default().range(TimeRange::since_first(4_000_000..5_000_000));
    for (format, bytes) in files(&events, 50) {
        fs::write(&path, &bytes).unwrap();
        assert_eq!(read_with(&path, options).unwrap(), decode_with(&bytes, options).unwrap(), "{format}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_part_read_by_seeking_is_the_whole_cut(
        times in prop::collection::vec(0_i64..30_000_000, 1..200),
        wobbles in prop::collection::vec(0..DISORDER_US, 200),
        packet in 1..20_usize,
        (a, b) in (0_i64..31_000_000, 0_i64..31_000_000),
        first_us in prop_oneof![Just(0_i64), Just((1_i64 << 32) - 10_000_000)],
    ) {
        // Sorted, then each made earlier by less than the allowed step back.
        let mut times = times;
        times.sort_unstable();
        let events: Vec<Event> = times
            .iter()
            .zip(&wobbles)
            .enumerate()
            .map(|(i, (t, wobble))| Event::new(first_us + (t - wobble).max(0), i as u16, 9, i % 2 == 0))
            .collect();
        let range = first_us + a.min(b)..first_us + a.max(b);
        for (format, bytes) in files(&events, packet) {
            is_cut(format, &bytes, &range);
        }
    }

    #[test]
    fn noise_is_an_error_or_a_part(
        sample in 0..samples().len(),
        keep in 0.0..1.0_f64,
        noise in prop::collection::vec(any::<u8>(), 0..300),
        (a, b) in any::<(i64, i64)>(),
    ) {
        let (format, mut bytes) = samples().swap_remove(sample);
        bytes.truncate((bytes.len() as f64 * keep) as usize);
        bytes.extend(noise);
        for range in [TimeRange::of_file(a..b), TimeRange::since_first(a..b)] {
            let _ = decode_with(&bytes, ReadOptions::from(format).range(range));
        }
    }
}

#[test]
fn a_sensor_is_named_by_a_part_as_by_the_whole() {
    let bytes = aedat2(&["no chip"], &[[0, 5], [2, 100_000_000]]);
    let nothing = part(&bytes, TimeRange::of_file(50_000_000..50_000_001));
    assert_eq!((nothing.events.len(), nothing.sensor), (0, Some(Sensor::new(128, 128))));
}
