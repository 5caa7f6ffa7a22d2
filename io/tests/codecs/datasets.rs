//! The data set of slips, folder by folder.

use std::error::Error;
use std::fs;
use std::path::Path;

use meissner_io::IoError;
use meissner_io::datasets::{BadRows, SlipDataset};
use tempfile::TempDir;

use crate::shared_files::shared;

const CLASSES: [&str; 3] = ["e", "n", "w"];

/// A recording of `rows` readings, reading i of value i.
fn csv(rows: usize) -> String {
    let header: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
    let rows: Vec<String> = (0..rows).map(|i| [i.to_string().as_str(); 24].join(",") + "\n").collect();
    header.join(",") + "\n" + &rows.concat()
}

/// A folder with these files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

fn read(folder: &Path) -> Result<SlipDataset, IoError> {
    SlipDataset::read(folder, &CLASSES, BadRows::Refuse)
}

/// The message for a folder with these files.
fn refusal(files: &[(&str, &str)]) -> String {
    let error = read(folder(files).path()).unwrap_err();
    let source = error.source().map(|source| format!(": {source}"));
    format!("{error}{}", source.unwrap_or_default())
}

#[test]
fn recordings_come_by_class_and_then_by_number_with_their_object() {
    let (two, three) = (csv(2), csv(3));
    let folder = folder(&[
        ("w/pen3.csv", &three),
        ("n/pen10.csv", &two),
        ("n/pen9.csv", &three),
        ("n/hd11.CSV", &two),
        ("n/.pen1.csv", "hidden"),
        ("n/notes.txt", "of the operator"),
        ("README", "about"),
    ]);
    let set = read(folder.path()).unwrap();
    let found: Vec<_> = set
        .recordings
        .iter()
        .map(|r| (r.name.as_str(), r.class, r.object.as_str(), r.readings.len()))
        .collect();
    let expected =
        [("n/hd11", 1, "hd", 2), ("n/pen9", 1, "pen", 3), ("n/pen10", 1, "pen", 2), ("w/pen3", 2, "pen", 3)];
    assert_eq!(found, expected);
    assert_eq!(set.recordings[1].readings[2].values, [2.0; 24]);
    let passed_over: Vec<_> = set.passed_over.iter().filter_map(|path| path.file_name()).collect();
    assert_eq!(passed_over, ["README", "notes.txt"]);
}

#[test]
fn a_folder_that_is_no_class_is_refused_by_name() {
    let text = csv(1);
    let message = refusal(&[("n/pen1.csv", &text), ("north/pen2.csv", &text), ("up/pen3.csv", &text)]);
    assert!(message.contains("e, n, w") && message.ends_with("found also north, up"), "{message}");
}

#[test]
fn what_is_missing_is_said() {
    let nowhere = tempfile::tempdir().unwrap().path().join("data");
    let message = read(&nowhere).unwrap_err().to_string();
    assert!(message.contains(nowhere.to_str().unwrap()) && message.contains("found nothing"), "{message}");
    let file = folder(&[("data", "")]);
    let message = read(&file.path().join("data")).unwrap_err().to_string();
    assert!(message.contains("found a file"), "{message}");
    assert!(refusal(&[("README", "about")]).contains("found none"));
    assert!(refusal(&[("n/notes.txt", "")]).contains("<class>/<object><number>.csv"));
}

#[test]
fn names_without_an_object_or_a_number_are_refused() {
    for name in ["n/pen.csv", "n/17.csv"] {
        let message = refusal(&[(name, &csv(1))]);
        assert!(message.contains(name) && message.contains("pen178.csv"), "{message}");
    }
}

#[test]
fn a_recording_without_readings_is_refused() {
    for (text, found) in [("", "header"), (&csv(0), "found none")] {
        let message = refusal(&[("n/pen1.csv", text)]);
        assert!(message.contains("n/pen1.csv") && message.contains(found), "{message}");
    }
}

#[test]
fn a_bad_row_is_an_error_with_path_and_line() {
    let text = csv(3).replacen("1,1,", "1,x,", 1);
    let folder = folder(&[("n/pen1.csv", &text)]);
    let error = read(folder.path()).unwrap_err();
    assert!(matches!(error, IoError::Content { .. }));
    let message = format!("{error}: {}", error.source().expect("why"));
    assert!(
        message.contains("n/pen1.csv") && message.contains("line 3") && message.contains("`x`"),
        "{message}"
    );
}

#[test]
fn bad_rows_that_are_passed_over_are_listed_and_part_the_readings() {
    let rows = csv(6);
    let lines: Vec<&str> = rows.lines().collect();
    let text = [&lines[..3], &["1,2"], &["3,4"], &lines[3..], &["5"]].concat().join("\n");
    let folder = folder(&[("n/pen1.csv", &text)]);
    let set = SlipDataset::read(folder.path(), &CLASSES, BadRows::PassOver).unwrap();
    let recording = &set.recordings[0];
    assert_eq!(recording.refused.iter().map(|row| row.after).collect::<Vec<_>>(), [2, 2, 6]);
    assert!(recording.refused[0].problem.to_string().contains("line 4"));
    let stretches: Vec<Vec<f32>> =
        recording.stretches().map(|s| s.iter().map(|reading| reading.values[0]).collect()).collect();
    assert_eq!(stretches, [vec![0.0, 1.0], vec![2.0, 3.0, 4.0, 5.0]]);
}

#[test]
fn a_bad_header_is_an_error_even_where_bad_rows_are_passed_over() {
    let text = csv(2).replacen("ff_e7", "pressure", 1);
    let folder = folder(&[("n/pen1.csv", &text)]);
    let error = SlipDataset::read(folder.path(), &CLASSES, BadRows::PassOver).unwrap_err();
    let error = format!("{error}: {}", error.source().expect("why"));
    assert!(error.contains("n/pen1.csv") && error.contains("line 1"), "{error}");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_data_set_has_306_recordings_of_16_799_windows() {
    let folder = shared("data/biotac_dos");
    let classes = ["aw", "cw", "e", "n", "s", "t", "w"];
    let set = SlipDataset::read(folder, &classes, BadRows::Refuse).unwrap();
    assert_eq!(set.recordings.len(), 306);
    assert_eq!(set.recordings.iter().map(|recording| recording.readings.len() / 5).sum::<usize>(), 16_799);
    assert_eq!((set.recordings[0].name.as_str(), set.passed_over.len()), ("aw/bottle0", 0));
    let misspelt: Vec<_> =
        set.recordings.iter().filter(|r| r.object == "strippes").map(|r| &r.name).collect();
    assert_eq!(misspelt, ["s/strippes305"]);
}
