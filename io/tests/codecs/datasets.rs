//! Data sets folder by folder: digits, electrodes, pictures of a gel.

use std::error::Error;
use std::fs;
use std::path::Path;

use meissner_io::IoError;
use meissner_io::datasets::{BadRows, SlipDataset};
use tempfile::TempDir;

use crate::shared_files::shared;

const CLASSES: [&str; 3] = ["e", "n", "w"];

/// A recording of `rows` readings; reading i has value i.
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

mod digits {
    //! The data set of digits, folder by folder.

    use std::error::Error;
    use std::fs;
    use std::path::Path;

    use meissner_engine::Event;
    use meissner_io::IoError;
    use meissner_io::datasets::{EventDataset, Split};
    use tempfile::TempDir;

    use crate::shared_files::shared;
    use meissner_io_tests::codecs::nmnist;

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
        assert!(
            message.contains(nowhere.to_str().unwrap()) && message.contains("found nothing"),
            "{message}"
        );
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
        let steps_back =
            |events: &[Event]| events.windows(2).filter(|pair| pair[1].t_us < pair[0].t_us).count();
        assert_eq!(set.recordings.iter().map(|recording| steps_back(&recording.events)).sum::<usize>(), 0);
    }
}

mod gelsight {
    //! Pictures of balls: arrays in a `NumPy` archive.

    use std::path::Path;

    use meissner_io::IoError;
    use meissner_io::datasets::{BallPictures, SlopeColours};

    use crate::packed::zip;
    use crate::shared_files::shared;
    use meissner_io_tests::codecs::chain;

    /// A file of version 1 with this type and shape.
    fn npy(descr: &str, shape: &str, values: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(values);
        bytes
    }

    /// Two pictures of 2 x 1 pixels.
    fn arrays() -> [(&'static str, Vec<u8>); 4] {
        let difference: [i16; 12] = [5, -5, 0, 250, -250, 1, 0, 0, 0, 0, 0, 7];
        let circle = [1.0_f64, 0.5, 2.0, 0.0, 0.25, 3.0];
        let bytes = |values: &[i16]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>();
        let circle: Vec<u8> = circle.iter().flat_map(|value| value.to_le_bytes()).collect();
        [
            ("background.npy", npy("|u1", "(1, 2, 3)", &[10, 20, 30, 40, 50, 60])),
            ("difference.npy", npy("<i2", "(2, 1, 2, 3)", &bytes(&difference))),
            ("circle.npy", npy("<f8", "(2, 3)", &circle)),
            ("notes.txt", b"not an array".to_vec()),
        ]
    }

    /// The result of `read` for an archive of these arrays.
    fn archived<T>(
        arrays: &[(&str, Vec<u8>)],
        read: impl Fn(&Path) -> Result<T, IoError>,
    ) -> Result<T, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arrays.npz");
        std::fs::write(&path, zip(arrays.iter().map(|(name, content)| (*name, content.clone())))).unwrap();
        read(&path).map_err(|error| chain(&error))
    }

    fn read(arrays: &[(&str, Vec<u8>)]) -> Result<BallPictures, String> {
        archived(arrays, |path| BallPictures::read(path))
    }

    #[test]
    fn colours_of_slopes_are_those_of_the_sensor_that_is_asked_for() {
        let values: Vec<u8> = (0..72).flat_map(|value| (value as f32).to_le_bytes()).collect();
        let arrays = [
            ("other.npy", npy("<f4", "(3, 1, 1, 6)", &values[..72])),
            ("sensor.npy", npy("<f4", "(3, 2, 2, 6)", &values)),
            ("skewed.npy", npy("<f4", "(3, 2, 1, 6)", &values[..144])),
            ("wide.npy", npy("<f8", "(3, 1, 1, 6)", &values[..144])),
        ];
        let read = |sensor: &str| archived(&arrays, |path| SlopeColours::read(path, sensor));
        let found = read("sensor").unwrap();
        assert_eq!((found.bins, found.table.len(), found.table[71]), (2, 72, 71.0));
        assert_eq!(read("other").unwrap().bins, 1);
        let missing = read("third").unwrap_err();
        assert!(missing.contains("expected an array third, found other, sensor, skewed, wide"), "{missing}");
        let skewed = read("skewed").unwrap_err();
        assert!(skewed.contains("expected skewed (3, bins, bins, 6), found [3, 2, 1, 6]"), "{skewed}");
        let wide = read("wide").unwrap_err();
        assert!(wide.contains("<f4") && wide.contains("<f8"), "{wide}");
    }

    #[test]
    fn a_picture_is_the_background_and_the_difference_between_black_and_white() {
        let read = read(&arrays()).unwrap();
        assert_eq!((read.width, read.height), (2, 1));
        assert_eq!(read.background, [10, 20, 30, 40, 50, 60]);
        let pictures: Vec<_> = read.balls.iter().map(|ball| ball.picture.clone()).collect();
        assert_eq!(pictures, [[15, 15, 30, 255, 0, 61], [10, 20, 30, 40, 50, 67]]);
        assert_eq!(read.balls[1].circle, [0.0, 0.25, 3.0]);
    }

    #[test]
    fn arrays_that_are_missing_or_do_not_fit_are_refused() {
        for missing in 0..3 {
            let left: Vec<_> = arrays()
                .into_iter()
                .enumerate()
                .filter(|(i, _)| *i != missing)
                .map(|(_, array)| array)
                .collect();
            let name = arrays()[missing].0.trim_end_matches(".npy");
            let message = read(&left).unwrap_err();
            assert!(message.contains(&format!("expected an array {name}, found none")), "{message}");
        }
        let with = |index: usize, content: Vec<u8>| {
            let mut arrays = arrays();
            arrays[index].1 = content;
            read(&arrays).unwrap_err()
        };
        let message = with(0, npy("|u1", "(2, 1, 3)", &[0; 6]));
        assert!(message.contains("[2, 1, 3], [2, 1, 2, 3], [2, 3]"), "{message}");
        assert!(with(0, npy("|u1", "(1, 2, 3)", &[0; 5])).contains("6 bytes of the shape [1, 2, 3]"));
        let message = with(1, npy("<f4", "(2, 1, 2, 3)", &[0; 48]));
        assert!(message.contains("the type <i2 before this") && message.contains("<f4"), "{message}");
        let infinite = [f64::INFINITY; 6].iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>();
        assert!(with(2, npy("<f8", "(2, 3)", &infinite)).contains("expected finite circles, found inf"));
    }

    #[test]
    #[cfg_attr(no_shared, ignore = "no ../shared")]
    fn the_published_pictures_have_their_circles_inside() {
        let balls = BallPictures::read(shared("data/gelsight/balls.npz")).unwrap();
        assert_eq!((balls.width, balls.height, balls.balls.len()), (120, 160, 30));
        for ball in &balls.balls {
            let [column, row, radius] = ball.circle;
            assert!((radius..120.0 - radius).contains(&column) && (radius..160.0 - radius).contains(&row));
            assert_ne!(ball.picture, balls.background);
        }
    }
}
