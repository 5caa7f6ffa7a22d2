//! Real recordings if they are available, and recordings that were cut short.

use meissner_engine::{Event, Sensor};
use meissner_io::{
    Format, IoError, Place, ReadOptions, Recording, StreamKind, decode, decode_with, read, write,
};

use crate::shared_files::shared;
use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet};
use meissner_io_tests::codecs::{SENSOR, encoded, events, samples};

fn recording(name: &str) -> Recording {
    read(&shared(&format!("data/events/{name}"))).unwrap()
}

fn span_us(recording: &Recording) -> i64 {
    let times = recording.events.iter().map(|e| e.t_us);
    times.clone().max().unwrap() - times.min().unwrap()
}

fn counts(recording: &Recording) -> Vec<(StreamKind, u64, u64)> {
    recording.other_streams.iter().map(|s| (s.kind, s.packets, s.elements)).collect()
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn evt3_and_dat_of_one_recording_agree_event_by_event() {
    let (evt3, dat) = (recording("evk4_1280x720.evt3.raw"), recording("evk4_1280x720.dat"));
    assert_eq!((evt3.format, dat.format), (Format::Evt3, Format::Dat));
    assert_eq!((evt3.sensor, dat.sensor), (Some(Sensor::new(1280, 720)), Some(Sensor::new(1280, 720))));
    assert_eq!((evt3.events.len(), dat.events.len()), (1_218_618, 1_218_618));
    for (a, b) in evt3.events.iter().zip(&dat.events) {
        assert_eq!((a.t_us - b.t_us, a.x, a.y, a.on), (11_194_368, b.x, b.y, b.on));
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn nine_steps_back_of_time_low_leave_the_peak_at_8_8_ms_and_in_order() {
    let peak = recording("evk3_1280x720_peak.evt3.raw");
    assert_eq!((peak.events.len(), peak.sensor), (219_596, None));
    assert_eq!(span_us(&peak), 8_801);
    // The steps are between time words without events between them: the events themselves are in
    // order.
    assert!(peak.events.is_sorted_by_key(|e| e.t_us));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_evt2_burst_is_whole_and_names_no_sensor() {
    let burst = recording("gen3_640x480_burst.evt2.raw");
    assert_eq!((burst.format, burst.sensor, burst.events.len()), (Format::Evt2, None, 521_252));
    assert_eq!(span_us(&burst), 95_871);
    assert!(burst.events.iter().all(|e| e.x < 640 && e.y < 480));
    assert!(burst.events.is_sorted_by_key(|e| e.t_us));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_tactile_stream_is_whole() {
    let dots = recording("tactile_dots.aedat4");
    assert_eq!((dots.sensor, dots.events.len()), (Some(Sensor::new(240, 180)), 239_449));
    assert_eq!((dots.events[0].t_us, span_us(&dots)), (1_741_072_435_018_666, 80_596_855));
    assert!(dots.other_streams.is_empty());
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn frames_imu_and_triggers_are_told_from_the_events() {
    let davis = recording("davis346.aedat4");
    assert_eq!((davis.sensor, davis.events.len()), (Some(Sensor::new(346, 260)), 78_830));
    assert_eq!(span_us(&davis), 2_359_945);
    let expected =
        [(StreamKind::Frames, 59, 59), (StreamKind::Imu, 236, 2_363), (StreamKind::Triggers, 177, 236)];
    assert_eq!(counts(&davis), expected);
    let short = recording("davis346_short.aedat4");
    assert_eq!((short.events.len(), span_us(&short)), (117_667, 129_999));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn every_digit_is_read_as_such() {
    for (part, expected) in [("train", 1_000), ("test", 100)] {
        let folder = shared(&format!("data/nmnist/{part}"));
        let mut read_files = 0;
        for digit in 0..10 {
            for file in folder.join(digit.to_string()).read_dir().unwrap() {
                let digit = read(&file.unwrap().path()).unwrap();
                assert_eq!((digit.format, digit.sensor), (Format::Nmnist, Some(Sensor::new(34, 34))));
                assert!((1_069..=7_152).contains(&digit.events.len()), "{}", digit.events.len());
                assert!(span_us(&digit) < 400_000);
                read_files += 1;
            }
        }
        assert_eq!(read_files, expected);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn a_recording_survives_every_encoder() {
    let peak = recording("evk3_1280x720_peak.evt3.raw");
    let folder = tempfile::tempdir().unwrap();
    for format in [Format::Csv, Format::Npy, Format::Dat, Format::Evt3] {
        let path = folder.path().join("peak").with_extension(format.extension());
        write(&path, format, Some(Sensor::new(1280, 720)), &peak.events).unwrap();
        assert_eq!(read(&path).unwrap().events, peak.events, "{format}");
    }
}

fn salvage(format: Format, bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, ReadOptions::from(format).salvage(true))
}

/// End of a salvaged part of `bytes`.
fn end(recording: &Recording, bytes: &[u8]) -> usize {
    recording.salvaged.map_or(bytes.len(), |salvaged| bytes.len() - salvaged.bytes_not_read as usize)
}

/// For a sample file, the number of complete events in its first `length` bytes; `None` if the
/// header is not complete.
fn whole(format: Format, bytes: &[u8], length: usize) -> Option<usize> {
    let start = match format {
        Format::Nmnist => 0,
        Format::Csv => bytes.iter().position(|&b| b == b'x').unwrap_or(0),
        Format::Npy => bytes.iter().position(|&b| b == b'\n').unwrap() + 1,
        Format::Dat => bytes.windows(2).position(|w| w == [0x0c, 8]).unwrap() + 2,
        Format::Evt2 | Format::Evt21 | Format::Evt3 => {
            bytes.windows(5).position(|w| w == b"% end").unwrap() + 6
        }
        Format::Aedat2 => bytes.windows(8).position(|w| w == b"Header\r\n").unwrap() + 8,
        Format::Aedat3 => bytes.windows(8).position(|w| w == b"HEADER\r\n").unwrap() + 8,
        Format::Es => 20,
        Format::Aedat4 | Format::Hdf5 | Format::Mcap => unreachable!(),
    };
    let content = bytes.get(start..length)?;
    Some(match format {
        Format::Nmnist => content.len() / 5,
        Format::Dat | Format::Aedat2 => content.len() / 8,
        // Packets of 15, 15 and 10 events.
        Format::Aedat3 => [148, 296, 404]
            .iter()
            .zip([15, 15, 10])
            .filter(|(end, _)| content.len() >= **end)
            .map(|p| p.1)
            .sum(),
        // The sample's first step takes 7 overflows, the others 5.
        Format::Es => (content.len() + 3).saturating_sub(5) / 10,
        Format::Npy => content.len() / 13,
        Format::Evt2 => content.chunks_exact(4).filter(|w| w[3] >> 4 <= 1).count(),
        Format::Evt21 => {
            let words = content.chunks_exact(8).filter(|w| w[3] >> 4 <= 1);
            words.flat_map(|w| &w[4..]).map(|byte| byte.count_ones() as usize).sum()
        }
        Format::Csv => {
            let lines = bytes[..length].split_inclusive(|&b| b == b'\n').filter(|line| line.ends_with(b"\n"));
            lines.filter(|line| line[0].is_ascii_digit()).count()
        }
        // Cut exactly between two words: compared with the reader itself, which other tests check.
        _ => decode_with(&bytes[..length - content.len() % 2], format).unwrap().events.len(),
    })
}

#[test]
fn salvage_gives_exactly_the_whole_events_before_a_cut_at_any_byte() {
    let has_packets = |format| matches!(format, Format::Aedat4 | Format::Mcap);
    for (format, bytes) in samples().into_iter().filter(|(format, _)| !has_packets(*format)) {
        let all = decode(&bytes).unwrap();
        assert_eq!(salvage(format, &bytes).unwrap(), all, "nothing is left out of a whole {format}");
        for length in 0..bytes.len() {
            let cut = &bytes[..length];
            let Some(expected) = whole(format, &bytes, length) else { continue };
            let salvaged = salvage(format, cut).unwrap_or_else(|e| panic!("{format} cut at {length}: {e}"));
            assert_eq!(salvaged.events, all.events[..expected], "{format} cut at {length}");
            assert!(end(&salvaged, cut) <= length);
            // If nothing is left out, the cut cannot be detected, or the array's stated length is
            // not reached.
            if salvaged.salvaged.is_none() {
                assert_eq!(decode_with(cut, format).unwrap().events, salvaged.events);
            } else if format != Format::Csv {
                let error = decode_with(cut, format).unwrap_err();
                assert!(matches!(error, IoError::Truncated { .. }), "{format} cut at {length}: {error}");
            }
        }
    }
}

#[test]
fn salvage_of_aedat4_gives_exactly_the_whole_packets() {
    for compression in Compression::ALL {
        for is_closed in [true, false] {
            let packets: Vec<Vec<Event>> = events().chunks(15).map(<[Event]>::to_vec).collect();
            let mut file = File::new(compression, Some(SENSOR));
            file.table = file.table.filter(|_| is_closed);
            let empty = File { packets: Vec::new(), table: None, ..File::new(compression, Some(SENSOR)) };
            let mut ends = vec![empty.bytes().len()];
            for packet in &packets {
                file.push(0, &event_packet(packet));
                ends.push(ends.last().unwrap() + 8 + file.packets.last().unwrap().1.len());
            }
            let bytes = file.bytes();
            for length in ends[0]..bytes.len() {
                let cut = &bytes[..length];
                let salvaged = salvage(Format::Aedat4, cut).unwrap();
                let whole = ends[1..].iter().filter(|&&end| end <= length).count();
                assert_eq!(salvaged.events, packets[..whole].concat(), "{compression:?} cut at {length}");
                match decode(cut) {
                    Ok(recording) => assert_eq!(recording.events, salvaged.events),
                    Err(_) => assert!(salvaged.salvaged.is_some(), "{compression:?} cut at {length}"),
                }
                if let Some(salvaged) = salvaged.salvaged.filter(|_| whole < packets.len()) {
                    let Place::Byte(byte) = salvaged.place else { panic!("{salvaged:?}") };
                    assert_eq!(
                        (byte, salvaged.bytes_not_read),
                        (ends[whole] as u64, (length - ends[whole]) as u64)
                    );
                }
            }
        }
    }
}

#[test]
fn a_strict_reader_refuses_a_damaged_recording_with_salvage_as_without() {
    let mut damaged = Vec::new();
    for (format, bytes) in samples() {
        let middle = bytes.len() * 3 / 4;
        let mut changed = bytes.clone();
        match format {
            Format::Csv => changed[middle..middle + 4].copy_from_slice(b"oops"),
            // Column 255 of 34; an invalid polarity; a pixel beyond the sensor; a reserved word.
            Format::Nmnist => changed[100] = 255,
            Format::Npy => changed[bytes.len() - 1] = 9,
            Format::Dat => *changed.last_mut().unwrap() = 0x70,
            Format::Evt21 => changed[bytes.len() - 5] = 0x70,
            Format::Evt2 | Format::Es => changed[bytes.len() - 1] = 0x70,
            Format::Evt3 => changed[bytes.len() - 1] = 0x90,
            // A row beyond the sensor.
            Format::Aedat2 => changed[bytes.len() - 8] = 0x7f,
            Format::Aedat3 => changed[bytes.len() - 7] = 0x70,
            Format::Aedat4 | Format::Hdf5 | Format::Mcap => continue,
        }
        damaged.push((format, changed));
    }
    for (format, bytes) in damaged {
        let strict = ReadOptions::from(format).strict(true);
        assert!(decode_with(&bytes, strict).is_err(), "{format}");
        let refused = decode_with(&bytes, strict.salvage(true)).unwrap_err();
        assert!(!matches!(refused, IoError::Truncated { .. }), "{format}: {refused}");
    }
    let mut file = File::new(Compression::None, Some(SENSOR));
    file.packets.push((7, vec![1]));
    file.push(0, &event_packet(&events()));
    let refused = salvage(Format::Aedat4, &file.bytes()).unwrap_err();
    assert!(matches!(refused, IoError::Malformed { what: "stream of a packet", .. }), "{refused}");
}

#[test]
fn digits_that_were_cut_within_an_event_are_known_and_refused_as_cut() {
    let bytes: Vec<u8> = (0..20).flat_map(|i| [i, 33 - i, 0x80, 0, i]).collect();
    let error = decode(&bytes[..98]).unwrap_err();
    assert!(matches!(error, IoError::Truncated { format: "N-MNIST", .. }), "{error}");
    let salvaged = salvage(Format::Nmnist, &bytes[..98]).unwrap();
    assert_eq!((salvaged.events.len(), salvaged.salvaged.unwrap().bytes_not_read), (19, 3));
}

#[test]
fn what_is_left_out_is_counted_with_its_place() {
    let text = encoded(Format::Csv, Some(SENSOR), &events());
    let salvaged = salvage(Format::Csv, &text[..text.len() - 3]).unwrap();
    let left_out = salvaged.salvaged.unwrap();
    assert_eq!((salvaged.events.len(), left_out.place), (39, Place::Line(42)));
    let dat = encoded(Format::Dat, Some(SENSOR), &events());
    let left_out = salvage(Format::Dat, &dat[..dat.len() - 3]).unwrap().salvaged.unwrap();
    assert_eq!((left_out.place, left_out.bytes_not_read), (Place::Byte(dat.len() as u64 - 8), 5));
}
