//! A file of presses, as `prepare` writes it, against the folder that it comes from.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use meissner_engine::Sensor;
use meissner_io::ReadOptions;
use meissner_models::TensorFile;
use proptest::prelude::*;

use super::Folder;
use crate::prepare::labelled_presses;
use crate::presses::{Label, OffsetSource, Options, Presses};

/// Six presses with a number along time and two labels of classes.
fn folder() -> Folder {
    let folder = Folder::new();
    let mut table = "recording,t_us,x_mm,class,side\n".to_owned();
    for i in 0..6 {
        let first_us = 1_000_000 * i;
        folder.press(&format!("press{i}.es"), [first_us, first_us + 90_000], 40, i);
        for k in 0..3 {
            let (t_us, class) = (first_us + 40_000 * k, ["wood", "steel"][i as usize % 2]);
            let side = ["left", "right"][i as usize / 3];
            writeln!(table, "press{i},{t_us},{}.5,{class},{side}", i + k).expect("text");
        }
    }
    folder.file("labels.csv", &table);
    folder
}

/// The file of these presses, changed by `change`.
fn prepared(folder: &Folder, presses: &Presses) -> PathBuf {
    let (_, prepared) = labelled_presses(presses, 2).expect("it fits");
    let path = folder.path().join("presses.safetensors");
    fs::write(&path, prepared.file.into_bytes()).expect("it can be written");
    path
}

#[test]
fn a_file_has_the_presses_of_the_folder_that_it_was_made_of() {
    let folder = folder();
    let of_folder = folder.read();
    let of_file = Presses::read(&prepared(&folder, &of_folder), &Options::default()).expect("presses");
    let label = |name: &str, unit: Option<&str>, classes: &[&str]| Label {
        name: name.to_owned(),
        unit: unit.map(str::to_owned),
        classes: classes.iter().map(|&class| class.to_owned()).collect(),
    };
    let sides = label("side", None, &["left", "right"]);
    assert_eq!(
        of_file.labels,
        [label("x", Some("mm"), &[]), label("class", None, &["steel", "wood"]), sides]
    );
    assert_eq!((&of_file.labels, &of_file.rows), (&of_folder.labels, &of_folder.rows));
    assert_eq!(of_file.sensor().expect("one"), of_folder.sensor().expect("one"));
    assert_eq!((of_file.offset.source, of_file.kept_back), (OffsetSource::SensorClock, 0));
    for press in 0..6 {
        assert_eq!(of_file.events(press).expect("events"), of_folder.events(press).expect("events"));
        let [own, other] = [&of_file, &of_folder].map(|presses| &presses.recordings[press]);
        assert_eq!((&own.name, own.fingerprint, own.events), (&other.name, other.fingerprint, other.events));
        for t_us in [0, 20_000, 40_000, 60_000].map(|t_us| 1_000_000 * press as i64 + t_us) {
            let at = |presses: &Presses, label| presses.at(press, label, t_us);
            assert!((0..3).all(|label| at(&of_file, label) == at(&of_folder, label)), "{press} {t_us}");
        }
    }
}

/// Two presses with classes alone; the second one belongs to the split test.
struct Classes(Vec<(&'static str, String)>, Vec<(&'static str, Vec<i64>)>);

impl Classes {
    fn new() -> Self {
        let metadata = [
            ("sensor", "[10, 8]"),
            ("classes", r#"["a", "b"]"#),
            ("recordings", r#"["train/a/1", "test/b/2"]"#),
        ];
        let tensors = [
            ("t_us", vec![5, 9, 7]),
            ("x", vec![1, 9, 3]),
            ("y", vec![7, 0, 3]),
            ("on", vec![1, 0, 1]),
            ("start", vec![0, 2, 3]),
            ("label", vec![0, 1]),
            ("split", vec![0, 1]),
        ];
        Self(metadata.map(|(key, text)| (key, text.to_owned())).into(), tensors.into())
    }

    fn read(&self) -> Result<Presses, String> {
        let metadata = self.0.iter().map(|(key, text)| ((*key).to_owned(), text.clone()));
        let mut file = TensorFile::new(metadata.collect());
        self.1.iter().for_each(|(name, values)| file.i64(name, &[values.len()], values));
        let folder = tempfile::tempdir().expect("a place");
        let path = folder.path().join("presses.safetensors");
        fs::write(&path, file.into_bytes()).expect("it can be written");
        Presses::read(&path, &Options::default()).map_err(|error| {
            let mut text = error.to_string();
            let mut source = std::error::Error::source(&error);
            while let Some(error) = source {
                text = format!("{text}: {error}");
                source = error.source();
            }
            text
        })
    }

    /// The same with this text; without the entry if it is `None`.
    fn text(mut self, key: &str, text: Option<&str>) -> Self {
        self.0.retain_mut(|entry| {
            if entry.0 == key {
                entry.1 = text.unwrap_or_default().to_owned();
            }
            entry.0 != key || text.is_some()
        });
        self
    }

    fn values(mut self, name: &str, values: Option<&[i64]>) -> Self {
        self.1.retain_mut(|entry| {
            if entry.0 == name {
                entry.1 = values.unwrap_or_default().to_vec();
            }
            entry.0 != name || values.is_some()
        });
        self
    }
}

#[test]
fn a_class_holds_for_a_whole_press_and_the_split_test_is_left_out() {
    let presses = Classes::new().read().expect("presses");
    assert_eq!((presses.kept_back, presses.labelled().collect::<Vec<_>>()), (1, vec![0]));
    assert_eq!((presses.rows_of(0)[0].t_us, presses.at(0, 0, 6)), (9, Some(0.0)));
    assert_eq!((presses.rows_of(1).len(), presses.recordings[1].name.as_str()), (0, "test/b/2"));
    assert_eq!(presses.sensor().expect("one"), Sensor::new(10, 8));
    let all = Classes::new().values("split", None).text("recordings", None).read().expect("presses");
    assert_eq!((all.kept_back, all.labelled().count(), all.recordings[1].name.as_str()), (0, 2, "press 1"));
}

#[test]
fn a_file_that_does_not_fit_is_refused_with_its_place() {
    for (file, expected) in [
        (
            Classes::new().text("classes", None),
            "metadata classes: expected a JSON list of names, found nothing",
        ),
        (
            Classes::new().text("classes", Some("ab")),
            "metadata classes: expected a JSON list of names, found ab",
        ),
        (
            Classes::new().text("classes", Some("[\"a\"]")),
            "label 1: expected an index into 1 classes, found 1",
        ),
        (
            Classes::new().text("recordings", Some("[\"a\"]")),
            "metadata recordings: expected a JSON list of 2 names, found 1",
        ),
        (
            Classes::new().values("label", Some(&[0, -1])),
            "label 1: expected an index into 2 classes, found -1",
        ),
        (Classes::new().values("label", Some(&[0])), "tensor label: expected I64 (2)"),
        (Classes::new().values("split", Some(&[1, 1])), "2 presses, 2 of them of the split test"),
        (Classes::new().values("label", None), "expected presses with labels"),
        (Classes::new().values("split", Some(&[])), "tensor split: expected I64 (2)"),
        (Classes::new().values("t_us", Some(&[9, 5, 7])), "event 1: expected a time"),
    ] {
        let refused = file.read().expect_err("it does not fit");
        assert!(
            refused.contains("presses.safetensors") && refused.contains(expected),
            "{refused}, not {expected}"
        );
    }
}

#[test]
fn what_is_for_folders_is_refused() {
    let folder = folder();
    let path = prepared(&folder, &folder.read());
    let refused = |options: Options| Presses::read(&path, &options).expect_err("refused").to_string();
    let labels = refused(Options { labels: Some("labels.csv".into()), ..Options::default() });
    let offset = refused(Options { offset_us: Some(1), ..Options::default() });
    let sensor = ReadOptions::default().sensor(Some(Sensor::new(9, 9)));
    let read = refused(Options { read: sensor, ..Options::default() });
    for refused in [labels, offset, read] {
        assert!(
            refused.contains("a folder of recordings") && refused.contains("presses.safetensors"),
            "{refused}"
        );
    }
    let strict = Options { read: ReadOptions::default().strict(true), ..Options::default() };
    assert!(Presses::read(&path, &strict).is_ok());
}

proptest! {
    #[test]
    fn any_values_give_presses_or_an_error(name in 0..7_usize, values in prop::collection::vec(prop_oneof![-2..11_i64, any::<i64>()], 0..4)) {
        let name = Classes::new().1[name].0;
        let _ = Classes::new().values(name, Some(&values)).read();
    }
}
