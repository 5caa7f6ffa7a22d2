//! Real recordings, where they are at hand: counts, spans and a second format as the oracle.

use meissner_engine::Sensor;
use meissner_io::{Format, Recording, StreamKind, read, write};

use crate::shared_files::shared;

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
    // The steps are of time words with no event between them: the events themselves are in order.
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
