//! `prepare`: inputs for training, and their place in trainings of digits.

use std::path::Path;

use meissner_models::systems::slip::SlipWindows;
use meissner_models::{FrameDescription, Weights};
use safetensors::SafeTensors;
use serde_json::{Value, json};

use crate::data::slip::{CLASSES, OBJECTS, SlipFolder, WINDOWS, csv, readings};
use crate::exit_status::fails;
use crate::shared_files::shared;
use crate::support::{argument, meissner, message, text};

fn prepare(data: &Path, network: &str) -> (Vec<u8>, String) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let out = folder.path().join("out.safetensors");
    let arguments = ["prepare", "slip", argument(data), "--network", network, "--out", argument(&out)];
    let output = meissner(&arguments);
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("windows of"), "{}", text(&output));
    (std::fs::read(out).expect("it was written"), message(&output))
}

fn integers(file: &SafeTensors<'_>, name: &str) -> Vec<usize> {
    let tensor = file.tensor(name).expect("it is there");
    let number = |bytes: &[u8]| i64::from_le_bytes(bytes.try_into().expect("8 bytes")) as usize;
    tensor.data().chunks_exact(8).map(number).collect()
}

fn metadata(bytes: &[u8], key: &str) -> Value {
    let weights = Weights::from_bytes(bytes).expect("a valid file");
    serde_json::from_str(&weights.metadata()[key]).expect("metadata is JSON")
}

/// Class and object of each window, in order.
fn labels() -> Vec<(usize, usize)> {
    let pairs = (0..CLASSES.len()).flat_map(|class| (0..OBJECTS.len()).map(move |object| (class, object)));
    pairs.flat_map(|pair| std::iter::repeat_n(pair, WINDOWS[pair.1])).collect()
}

#[test]
fn the_file_holds_the_windows_of_all_recordings_with_their_labels() {
    let data = SlipFolder::new();
    let (bytes, notes) = prepare(data.path(), "slip-regularised");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let labels = labels();
    assert_eq!(file.tensor("frames").expect("there").shape(), [labels.len(), 5, 1, 12, 11]);
    assert_eq!(file.tensor("readings").expect("there").shape(), [labels.len(), 5, 24]);
    assert_eq!(integers(&file, "label"), labels.iter().map(|label| label.0).collect::<Vec<_>>());
    assert_eq!(integers(&file, "object"), labels.iter().map(|label| label.1).collect::<Vec<_>>());
    let recordings: Vec<_> = labels.iter().map(|label| label.0 * OBJECTS.len() + label.1).collect();
    assert_eq!(integers(&file, "recording"), recordings);

    assert_eq!(metadata(&bytes, "classes"), json!(CLASSES));
    assert_eq!(metadata(&bytes, "objects"), json!(["bottle", "brush", "case", "striped"]));
    let sets = json!({"bottle": "Solids", "brush": "Small", "case": "Basic", "striped": "Textures"});
    assert_eq!(metadata(&bytes, "sets"), sets);
    assert_eq!(metadata(&bytes, "recordings")[3], "aw/strippes10");
    let preparation = json!({"frames": "tactile-image", "steps": 5, "scaling": "image"});
    assert_eq!(metadata(&bytes, "preparation"), preparation);
    let basic: Vec<f32> = (0..7).flat_map(|class| readings(class, 2)).flatten().collect();
    let range = [basic.iter().copied().fold(f32::MAX, f32::min), basic.iter().copied().fold(0.0, f32::max)];
    assert_eq!(metadata(&bytes, "range_basic"), json!(range));
    assert!(notes.contains("aw/strippes10") && notes.contains("\"striped\""), "{notes}");
}

#[test]
fn frames_and_counts_are_those_of_the_same_readings() {
    let data = SlipFolder::new();
    for network in ["slip-lstm", "slip-tuned"] {
        let (bytes, _) = prepare(data.path(), network);
        let weights = Weights::from_bytes(&bytes).expect("a valid file");
        let values =
            |name: &str| weights.get(name).and_then(|tensor| tensor.values()).expect("floats").to_vec();
        let description = FrameDescription::shipped(network).expect("it is shipped");
        let mut windows = SlipWindows::new(&description).expect("over readings");
        let (mut frames, mut counts) = (Vec::new(), Vec::new());
        for class in 0..CLASSES.len() {
            for (object, windows_of) in WINDOWS.iter().enumerate() {
                let readings = readings(class, object);
                windows.cut(&readings, &mut frames).expect("finite");
                counts.extend(readings[..5 * windows_of].concat());
            }
        }
        assert!(values("frames") == frames && values("readings") == counts, "{network}");
        assert_eq!(prepare(data.path(), network).0, bytes, "equal data gives equal bytes");
    }
}

#[test]
fn a_description_file_says_how_many_readings_and_how_they_are_scaled() {
    let data = SlipFolder::new();
    let own = include_str!("../../../models/networks/slip-lstm.toml")
        .replace("steps = 5", "steps = 4")
        .replace("scaling = \"reading\"", "scaling = [2000, 3500]")
        .replace("sampling = \"consecutive\"", "sampling = \"sliding\"");
    let path = data.path().with_extension("toml");
    std::fs::write(&path, own).expect("a temporary file can be written");
    let (bytes, _) = prepare(data.path(), argument(&path));
    std::fs::remove_file(&path).expect("it is there");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    // Consecutive all the same: 12, 10, 16 and 5 readings.
    assert_eq!(file.tensor("frames").expect("there").shape(), [7 * (3 + 2 + 4 + 1), 4, 24]);
    let preparation = json!({"frames": "electrodes", "steps": 4, "scaling": [2000.0, 3500.0]});
    assert_eq!(metadata(&bytes, "preparation"), preparation);
}

#[test]
fn what_cannot_be_prepared_is_bad_input() {
    let data = SlipFolder::new();
    let out = data.path().join("n/out.safetensors");
    let prepare = |data: &Path, network: &str, out: &Path| {
        meissner(&["prepare", "slip", argument(data), "--network", network, "--out", argument(out)])
    };
    fails(&prepare(&data.path().join("no"), "slip-lstm", &out), 1, &["no: expected a folder", "aw, cw"]);
    fails(&prepare(data.path(), "force-lstm", &out), 1, &["force-lstm", "electrodes", "event-counts"]);
    fails(&prepare(data.path(), "tactigraph", &out), 1, &["tactigraph", "a frame network"]);
    fails(&prepare(data.path(), "slip-lstm", &data.path().join("no/out")), 1, &["no/out"]);
    std::fs::write(data.path().join("n/case9.csv"), csv(&readings(0, 0)) + "1,2\n").expect("written");
    fails(&prepare(data.path(), "slip-lstm", &out), 1, &["n/case9.csv", "line 14", "24 fields"]);
    std::fs::rename(data.path().join("n/case9.csv"), data.path().join("n/cup9.csv")).expect("renamed");
    std::fs::write(data.path().join("n/cup9.csv"), csv(&readings(0, 0))).expect("written");
    fails(&prepare(data.path(), "slip-lstm", &out), 1, &["n/cup9", "\"cup\"", "Textures (plate"]);
    std::fs::create_dir(data.path().join("x")).expect("made");
    fails(&prepare(data.path(), "slip-lstm", &out), 1, &["found also x"]);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_data_set_gives_16_799_windows() {
    let data = shared("data/biotac_dos");
    let (bytes, _) = prepare(&data, "slip-lstm");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    assert_eq!(file.tensor("frames").expect("there").shape(), [16_799, 5, 24]);
    assert_eq!(metadata(&bytes, "recordings").as_array().map(Vec::len), Some(306));
    assert_eq!(metadata(&bytes, "objects").as_array().map(Vec::len), Some(11));
}

mod digits {
    //! Events of digits with labels, splits and folds, as a file for training.

    use std::path::Path;

    use meissner_engine::Event;
    use meissner_evaluate::events::folds;
    use meissner_models::Weights;
    use safetensors::{Dtype, SafeTensors};
    use serde_json::{Value, json};

    use crate::data::{DigitsFolder, RECORDINGS, TRAIN, digits};
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
        let (start, split, fold) =
            (integers(&file, "start"), integers(&file, "split"), integers(&file, "fold"));
        let lengths = || start.windows(2).map(|pair| pair[1] - pair[0]);
        assert_eq!((lengths().min(), lengths().max()), (Some(1_069), Some(7_152)));
        assert_eq!((split.len(), split.iter().sum::<i64>()), (1_100, 100));
        assert!((0..10).all(|i| fold.iter().filter(|&&fold| fold == i).count() == 110));
    }
}
