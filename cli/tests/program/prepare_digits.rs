//! Events of digits with labels, splits and folds, as a file for training.

use std::path::Path;

use meissner_engine::Event;
use meissner_evaluate::events::folds;
use meissner_models::Weights;
use safetensors::{Dtype, SafeTensors};
use serde_json::{Value, json};

use crate::digits_data::{DigitsFolder, RECORDINGS, TRAIN, digits};
use crate::exit_status::fails;
use crate::shared_files::shared;
use crate::support::{argument, meissner, message, text};

fn prepare(data: &Path, more: &[&str]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let out = folder.path().join("out.safetensors");
    let own = ["prepare", "digits", argument(data), "--out", argument(&out)];
    let output = meissner(&[&own[..], more].concat());
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("events of"), "{}", text(&output));
    std::fs::read(out).expect("it was written")
}

fn integers(file: &SafeTensors<'_>, name: &str) -> Vec<i64> {
    let tensor = file.tensor(name).expect("it is there");
    let number = |bytes: &[u8]| i64::from_le_bytes(bytes.try_into().expect("8 bytes"));
    let values: Vec<i64> = tensor.data().chunks_exact(8).map(number).collect();
    assert_eq!((tensor.dtype(), tensor.shape()), (Dtype::I64, &[values.len()][..]));
    values
}

fn metadata(bytes: &[u8], key: &str) -> Value {
    let weights = Weights::from_bytes(bytes).expect("a valid file");
    serde_json::from_str(&weights.metadata()[key]).expect("metadata is JSON")
}

#[test]
fn the_file_holds_the_events_of_all_recordings_with_label_split_and_fold() {
    let data = DigitsFolder::new();
    let bytes = prepare(data.path(), &["--folds", "3"]);
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let [t_us, x, y, on, start] = ["t_us", "x", "y", "on", "start"].map(|name| integers(&file, name));
    let digits = digits();
    assert_eq!((start.len(), start[0]), (RECORDINGS + 1, 0));
    for (i, digit) in digits.iter().enumerate() {
        let range = start[i] as usize..start[i + 1] as usize;
        let event = |k: usize| Event::new(t_us[k], x[k] as u16, y[k] as u16, on[k] == 1);
        assert_eq!(range.map(event).collect::<Vec<_>>(), digit.events, "{}", digit.name);
    }
    assert_eq!(t_us.len(), start[RECORDINGS] as usize);
    let classes: Vec<usize> = digits.iter().map(|digit| digit.class).collect();
    let label: Vec<i64> = classes.iter().map(|&class| class as i64).collect();
    let split: Vec<i64> = (0..RECORDINGS).map(|i| i64::from(i >= 10 * TRAIN)).collect();
    let expected = folds(&classes, 3).expect("enough recordings");
    let fold: Vec<i64> = expected.into_iter().map(|fold| fold as i64).collect();
    assert_eq!(["label", "split", "fold"].map(|name| integers(&file, name)), [label, split, fold]);
    let names: Vec<&str> = digits.iter().map(|digit| digit.name.as_str()).collect();
    assert_eq!(metadata(&bytes, "recordings"), json!(names));
    assert_eq!(metadata(&bytes, "sensor"), json!([34, 34]));
    assert_eq!(metadata(&bytes, "classes")[9], "9");
    assert_eq!(prepare(data.path(), &["--folds", "3"]), bytes, "equal data gives equal bytes");
}

#[test]
fn there_are_ten_folds_where_nothing_else_is_said() {
    let data = DigitsFolder::new();
    let bytes = prepare(data.path(), &[]);
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let fold = integers(&file, "fold");
    assert!((0..10).all(|i| fold.iter().filter(|&&fold| fold == i).count() == RECORDINGS / 10));
}

#[test]
fn what_cannot_be_prepared_is_bad_input_or_bad_usage() {
    let data = DigitsFolder::new();
    let out = data.path().join("out");
    let prepare = |data: &Path, out: &Path, folds: &str| {
        meissner(&["prepare", "digits", argument(data), "--out", argument(out), "--folds", folds])
    };
    fails(&prepare(&data.path().join("no"), &out, "2"), 1, &["no: expected a folder", "train, test"]);
    fails(&prepare(data.path(), &data.path().join("no/out"), "2"), 1, &["no/out"]);
    fails(&prepare(data.path(), &out, "31"), 2, &["2 to 30", "found 31"]);
    fails(&prepare(data.path(), &out, "1"), 2, &["--folds"]);
    data.write("test/0/77", &[]);
    fails(&prepare(data.path(), &out, "2"), 1, &["77.bin", "expected events"]);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shared_digits_have_1_100_recordings_in_ten_folds_of_110() {
    let data = shared("data/nmnist");
    let bytes = prepare(&data, &[]);
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let (start, split, fold) = (integers(&file, "start"), integers(&file, "split"), integers(&file, "fold"));
    let lengths = || start.windows(2).map(|pair| pair[1] - pair[0]);
    assert_eq!((lengths().min(), lengths().max()), (Some(1_069), Some(7_152)));
    assert_eq!((split.len(), split.iter().sum::<i64>()), (1_100, 100));
    assert!((0..10).all(|i| fold.iter().filter(|&&fold| fold == i).count() == 110));
}
