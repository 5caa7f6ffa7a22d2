//! Each oddity, with its count and its first example.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, ReadOptions};

use super::{Folder, kinds, odd};
use crate::presses::{Oddity, OddityKind, Options};

/// The only oddity of three presses with these labels.
fn only(labels: &str) -> Oddity {
    let folder = Folder::three();
    folder.file("labels.csv", labels);
    let presses = folder.read();
    assert_eq!(presses.odd.len(), 1, "{:?}", presses.odd);
    presses.odd[0].clone()
}

#[test]
fn labels_outside_of_their_recording_are_counted() {
    let odd = only(
        "recording,t_us,x\npress0,0,1\npress1,1000000,2\npress1,0,9\npress2,5000000,9\npress2,2000000,3\n",
    );
    assert_eq!((odd.kind, odd.count), (OddityKind::Outside, 2));
    assert!(odd.first.starts_with("line 4: 0 us, and press1.es lasts from 1000000"), "{odd}");
    assert_eq!(odd.to_string(), format!("labels outside of their recording: 2, the first {}", odd.first));
}

#[test]
fn a_label_in_the_silence_behind_the_last_event_counts() {
    let folder = Folder::three();
    folder.file("labels.csv", "recording,t_us,x\npress0,190000,1\npress1,1000000,2\npress2,2000000,3\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), []);
    assert_eq!(presses.rows_of(0)[0].t_us, 190_000);
}

#[test]
fn a_recording_without_labels_is_named() {
    let odd = only("recording,x\npress0,1\npress2,2\n");
    assert_eq!((odd.kind, odd.count, odd.first.as_str()), (OddityKind::Unlabelled, 1, "press1.es"));
}

#[test]
fn a_name_of_no_recording_comes_with_a_similar_one() {
    let odd = only("recording,x\npress0,1\npress1,2\npress2,3\npres_2,2\n");
    assert_eq!((odd.kind, odd.count), (OddityKind::UnknownRecording, 1));
    assert_eq!(odd.first, "line 5: \"pres_2\" (similar: press2)");
}

#[test]
fn a_label_with_one_value_is_named() {
    let odd = only("recording,x,class\npress0,1,a\npress1,2,a\npress2,3,a\n");
    assert_eq!((odd.kind, odd.first.as_str()), (OddityKind::Constant, "class, which is \"a\""));
}

#[test]
fn missing_values_and_texts_among_numbers_are_counted() {
    let odd = only("recording,x\npress0,1\npress1,\npress2,3\n");
    assert_eq!((odd.kind, odd.count, odd.first.as_str()), (OddityKind::Missing, 1, "x, line 3"));
    let odd = only("recording,x\npress0,1\npress1,2\npress2,none?\n");
    assert_eq!((odd.kind, odd.count, odd.first.as_str()), (OddityKind::NotNumber, 1, "x, line 4: \"none?\""));
}

#[test]
fn rows_that_repeat_or_contradict_another_are_told_apart() {
    let odd = only("recording,x\npress0,1\npress1,2\npress2,3\npress0,1\n");
    assert_eq!((odd.kind, odd.first.as_str()), (OddityKind::Repeated, "line 5, after line 2"));
    let odd = only("recording,x\npress0,1\npress1,2\npress2,3\npress0,9\n");
    assert_eq!((odd.kind, odd.first.as_str()), (OddityKind::Contradicts, "line 5, after line 2"));
}

#[test]
fn presses_without_events_or_with_few_or_at_another_rate_are_named() {
    let folder = Folder::three();
    folder.press("press3.es", [0, 100_000], 10, 3).press("press4.es", [0, 1_000_000], 300, 4);
    folder.events("press5.es", &[]);
    folder.file("labels.csv", "recording,x\npress0,1\npress1,2\npress2,3\npress3,1\npress4,1\npress5,1\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), [OddityKind::Empty, OddityKind::Few, OddityKind::Rate]);
    assert_eq!(odd(&presses, OddityKind::Empty).first, "press5.es");
    assert_eq!(odd(&presses, OddityKind::Few).first, "press3.es with 10, the median is 200");
    assert!(odd(&presses, OddityKind::Rate).first.starts_with("press4.es with 300 a second"));
}

#[test]
fn a_copy_of_a_recording_is_found_in_another_format_and_at_another_time() {
    let folder = Folder::three();
    folder.press("copy.npy", [7_000_000, 7_100_000], 200, 1);
    folder.file("labels.csv", "recording,x\npress0,1\npress1,2\npress2,3\ncopy,3\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), [OddityKind::Same]);
    assert_eq!(presses.odd[0].first, "press1.es, which has the events of copy.npy");
}

#[test]
fn times_that_step_back_and_other_sensors_are_named() {
    let folder = Folder::three();
    let back: Vec<Event> =
        (0..200).map(|i| Event::new(if i == 100 { 0 } else { i * 500 }, 1, 1, true)).collect();
    folder.events("back.npy", &back);
    let events: Vec<Event> = (0..200).map(|i| Event::new(i * 500, 1, 1, true)).collect();
    let other = folder.path().join("other.es");
    meissner_io::write(&other, Format::Es, Some(Sensor::new(64, 64)), &events).expect("it can be written");
    folder.file("labels.csv", "recording,x\npress0,1\npress1,2\npress2,3\nback,4\nother,5\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), [OddityKind::StepsBack, OddityKind::SensorSize]);
    assert!(odd(&presses, OddityKind::StepsBack).first.starts_with("back.npy, in which 1 events"));
    assert_eq!(odd(&presses, OddityKind::SensorSize).first, "other.es with 64x64, most have 32x24");
    assert_eq!(presses.events(0).expect("it is read").len(), 199, "late events are left out");
    // A given sensor applies to all recordings, and events outside of it are odd.
    let read = ReadOptions::default().sensor(Sensor::new(2, 2));
    let presses = folder.try_read(&Options { read, ..Options::default() }).expect("they join");
    assert!(kinds(&presses).contains(&OddityKind::OutsideSensor), "{:?}", presses.odd);
    assert!(!kinds(&presses).contains(&OddityKind::SensorSize), "{:?}", presses.odd);
}

#[test]
fn poses_that_step_back_or_leave_gaps_are_counted() {
    let folder = Folder::new();
    folder.press("a.es", [0, 1_000_000], 500, 0);
    folder.file("labels.csv", "t_ms,z\n-20,1\n10,2\n5,3\n10,2\n80,4\n400,5\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), [OddityKind::Repeated, OddityKind::PosesStepBack, OddityKind::PoseGap]);
    assert_eq!(odd(&presses, OddityKind::PosesStepBack).first, "line 4, by 5,000 us");
    assert_eq!(odd(&presses, OddityKind::PoseGap).first, "320,000 us before line 7");
    assert_eq!(presses.rows_of(0).first().map(|row| row.t_us), Some(0), "between two poses");
}

#[test]
fn recordings_that_overlap_are_named_where_poses_are_of_all() {
    let folder = Folder::three();
    folder.press("press3.es", [2_050_000, 2_150_000], 200, 3);
    let pose = |i: i64| format!("{},{}\n", i * 50_000, i);
    folder.file("labels.csv", &format!("t_us,z\n{}", (0..60).map(pose).collect::<String>()));
    let presses = folder.read();
    assert_eq!(odd(&presses, OddityKind::Overlap).first, "press3.es, which begins during press2.es");
}

#[test]
fn recordings_that_the_list_lacks_are_named_where_each_has_its_offset() {
    let folder = Folder::new();
    (0..3).for_each(|i| {
        folder.press(&format!("p{i}.es"), [0, 100_000], 200, i);
    });
    folder.file("recordings.csv", "recording,first_us,host_us\np0,0,1000000\np1,0,3000000\n");
    folder.file("labels.csv", "recording,host_us,x\np0,1050000,1\np1,3050000,2\np2,5050000,3\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), [OddityKind::Unlabelled, OddityKind::NoHostTime]);
    assert_eq!(presses.rows.iter().map(|row| row.t_us).collect::<Vec<_>>(), [50_000, 50_000]);
    assert_eq!(odd(&presses, OddityKind::NoHostTime).first, "p2.es");
}
