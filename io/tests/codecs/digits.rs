//! The data set of digits, folder by folder.

use std::error::Error;
use std::fs;
use std::path::Path;

use meissner_engine::Event;
use meissner_io::IoError;
use meissner_io::datasets::{EventDataset, Split};
use tempfile::TempDir;

use crate::shared_files::shared;
use crate::support::nmnist;

/// A recording of `count` events.
fn digit(count: u16) -> Vec<u8> {
    let events = (0..count).map(|i| Event::new(7 + i64::from(i) * 100, i % 34, 33 - i % 34, i % 2 == 0));
    nmnist(&events.collect::<Vec<_>>())
}

/// A folder with these files.
fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

/// The message for a folder with these files.
fn refusal(files: &[(&str, &[u8])]) -> String {
    EventDataset::nmnist(folder(files).path()).unwrap_err().to_string()
}

#[test]
fn recordings_come_by_split_then_by_class_and_then_by_number() {
    let (one, two, three) = (digit(1), digit(2), digit(3));
    let folder = folder(&[
        ("test/0/00003.bin", &one),
        ("train/9/00004.BIN", &two),
        ("train/0/10.bin", &three),
        ("train/0/9.bin", &two),
        ("train/0/.8.bin", b"hidden"),
        ("train/0/notes.txt", b"of the operator"),
        ("train/labels", b"beside the digits"),
        ("README", b"about"),
    ]);
    let set = EventDataset::nmnist(folder.path()).unwrap();
    let found: Vec<_> =
        set.recordings.iter().map(|r| (r.name.as_str(), r.split, r.class, r.events.len())).collect();
    let expected = [
        ("train/0/9", Split::Train, 0, 2),
        ("train/0/10", Split::Train, 0, 3),
        ("train/9/00004", Split::Train, 9, 2),
        ("test/0/00003", Split::Test, 0, 1),
    ];
    assert_eq!(found, expected);
    assert_eq!(set.recordings[0].events, [Event::new(7, 0, 33, true), Event::new(107, 1, 32, false)]);
    let passed_over: Vec<_> = set.passed_over.iter().filter_map(|path| path.file_name()).collect();
    assert_eq!(passed_over, ["README", "labels", "notes.txt"]);
}

#[test]
fn one_split_is_enough() {
    for split in Split::ALL {
        let folder = folder(&[(&format!("{split}/4/1.bin"), &digit(1))]);
        let set = EventDataset::nmnist(folder.path()).unwrap();
        assert_eq!((set.recordings.len(), set.recordings[0].split), (1, split));
    }
}

#[test]
fn a_folder_that_is_no_split_or_no_digit_is_refused_by_name() {
    let one = digit(1);
    let message = refusal(&[("train/1/1.bin", &one), ("valid/1/1.bin", &one)]);
    assert!(message.contains("train, test") && message.ends_with("found also valid"), "{message}");
    let message = refusal(&[("test/1/1.bin", &one), ("test/10/1.bin", &one), ("test/ten/1.bin", &one)]);
    assert!(message.contains("test: ") && message.ends_with("8, 9, found also 10, ten"), "{message}");
}

#[test]
fn what_is_missing_is_said() {
    let nowhere = tempfile::tempdir().unwrap().path().join("data");
    let message = EventDataset::nmnist(&nowhere).unwrap_err().to_string();
    assert!(message.contains(nowhere.to_str().unwrap()) && message.contains("found nothing"), "{message}");
    assert!(refusal(&[("README", b"about")]).contains("<train|test>/<digit>/<number>.bin"));
    let message = refusal(&[("train/3/1.bin", b"")]);
    assert!(message.contains("1.bin") && message.contains("expected events"), "{message}");
}

#[test]
fn a_bad_recording_is_an_error_with_path_and_byte() {
    let broken = [&digit(2)[..], &[1, 2]].concat();
    let folder = folder(&[("train/3/00123.bin", &broken)]);
    let error = EventDataset::nmnist(folder.path()).unwrap_err();
    assert!(matches!(error, IoError::Content { .. }));
    let message = format!("{error}: {}", error.source().expect("why"));
    let place = Path::new("train").join("3").join("00123.bin");
    assert!(message.contains(place.to_str().unwrap()) && message.contains("byte 10"), "{message}");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shared_digits_are_1_000_and_100_of_1_069_to_7_152_events() {
    let folder = shared("data/nmnist");
    let set = EventDataset::nmnist(folder).unwrap();
    let count = |split| set.recordings.iter().filter(|recording| recording.split == split).count();
    assert_eq!((count(Split::Train), count(Split::Test), set.passed_over.len()), (1_000, 100, 0));
    assert!((0..10).all(|class| set.recordings.iter().any(|recording| recording.class == class)));
    let lengths = || set.recordings.iter().map(|recording| recording.events.len());
    assert_eq!((lengths().min(), lengths().max()), (Some(1_069), Some(7_152)));
    let steps_back = |events: &[Event]| events.windows(2).filter(|pair| pair[1].t_us < pair[0].t_us).count();
    assert_eq!(set.recordings.iter().map(|recording| steps_back(&recording.events)).sum::<usize>(), 0);
}
