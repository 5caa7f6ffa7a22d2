//! Networks judged on a data set of slips; and readings scaled in two ways, for a network whose
//! members see one frame.

use std::collections::BTreeMap;
use std::path::Path;

use meissner_engine::frames::FrameEngine;
use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use meissner_models::{FrameDescription, Weights, draw};
use safetensors::SafeTensors;
use serde_json::{Value, json};

use crate::data::slip::{CLASSES, OBJECTS, SlipFolder, WINDOWS, class, outputs, readings, training};
use crate::exit_status::fails;
use crate::frames::{OwnNetwork, engine, predicted};
use crate::frames_electrodes::{csv, reading};
use crate::shared_files::shared;
use crate::support::{
    argument, bits, file, lines, meissner, meissner_reading, message, object, text, words, written,
};

/// The JSON object of a successful evaluation.
pub(crate) fn report(arguments: &[&str]) -> Value {
    object(&meissner(&[&["eval", "slip"][..], arguments, &["--json"]].concat()))
}

/// The confusion matrix of the engine's own predictions on the recordings of object `object`.
pub(crate) fn confusion(outputs: &[Vec<Vec<u32>>], object: usize) -> Vec<Vec<u64>> {
    let mut counts = vec![vec![0; 7]; 7];
    for (truth, row) in counts.iter_mut().enumerate() {
        outputs[truth * 4 + object].iter().for_each(|window| row[class(window)] += 1);
    }
    counts
}

pub(crate) fn counts(matrix: &Value) -> Vec<Vec<u64>> {
    serde_json::from_value(matrix.clone()).expect("a matrix of counts")
}

#[test]
fn figures_are_those_of_the_engines_own_predictions() {
    let data = SlipFolder::new();
    for network in ["slip-lstm", "slip-regularised"] {
        let report = report(&[argument(data.path()), "--network", network]);
        let outputs = outputs(network, &Weights::shipped(network).expect("with weights"));
        let judged = &report["networks"][0];
        assert_eq!(
            (&judged["network"]["name"], &report["classes"]),
            (&network.into(), &CLASSES.as_slice().into())
        );
        // The sets' order is not that of the objects' names.
        for (i, (set, object)) in
            [("Basic", 2), ("Solids", 0), ("Small", 1), ("Textures", 3)].iter().enumerate()
        {
            let judged = &judged["sets"][i];
            let expected = confusion(&outputs, *object);
            assert_eq!(
                (judged["set"].as_str(), counts(&judged["confusion"])),
                (Some(*set), expected.clone())
            );
            let total: u64 = expected.iter().flatten().sum();
            let hits: u64 = (0..7).map(|class| expected[class][class]).sum();
            let mean = judged["accuracy"]["mean"].as_f64().expect("a number");
            assert!((mean - hits as f64 / total as f64).abs() < 1e-15, "the reader of JSON rounds");
            assert_eq!((&judged["windows"], &judged["trainings"]), (&total.into(), &1.into()));
            let trained_on = *set == "Basic";
            assert_eq!(
                (&judged["accuracy"]["std"], &judged["trained_on"]),
                (&Value::Null, &trained_on.into())
            );
            assert_eq!(judged["each"][0]["seed"], 0);
        }
    }
}

#[test]
fn the_number_of_threads_reaches_no_bit() {
    let data = SlipFolder::new();
    let run = |threads: &str| {
        let logits = data.path().join(format!("logits-{threads}"));
        let arguments = [argument(data.path()), "--threads", threads, "--logits", argument(&logits)];
        let mut report = report(&arguments);
        // The logits of another run are in the folder and are listed.
        report["data"]["notes"] = Value::Null;
        // The command line contains the number of threads.
        report["header"]["made"]["arguments"] = Value::Null;
        (report, std::fs::read(&logits).expect("it was written"))
    };
    let one = run("1");
    assert_eq!(one.0["networks"].as_array().map(Vec::len), Some(4), "every shipped network");
    assert!(one == run("2") && one == run("7"));
}

#[test]
fn logits_are_the_engines_in_the_order_of_the_windows() {
    let data = SlipFolder::new();
    let path = data.path().join("logits");
    report(&[argument(data.path()), "--network", "slip-tuned", "--logits", argument(&path)]);
    let file = Weights::load(&path).expect("a valid file");
    let logits = file.get("slip-tuned.0").expect("named by network and seed");
    let outputs = outputs("slip-tuned", &Weights::shipped("slip-tuned").expect("with weights"));
    let expected: Vec<u32> = outputs.into_iter().flatten().flatten().collect();
    let found: Vec<u32> = logits.values().expect("floats").iter().map(|value| value.to_bits()).collect();
    assert_eq!((logits.shape(), found), (&[7 * 8, 7][..], expected));
}

#[test]
fn the_text_shows_every_table_with_the_figures_of_others() {
    let data = SlipFolder::new();
    let output = meissner(&["eval", "slip", argument(data.path()), "--network", "slip-lstm"]);
    assert!(output.status.success(), "{}", message(&output));
    let text = words(&output);
    for expected in [
        "28 recordings",
        "trained on the Basic objects of biotac_dos, seed 0",
        "strippes",
        "82.56",
        "65.3",
        "support-vector machine",
        "precision",
        "slip-lstm on Textures: true class by row",
        "judged in",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(text.contains("slip-lstm, Basic (trained on)") && !text.contains("cross-validation"), "{text}");
}

#[test]
fn the_drawing_has_a_matrix_for_each_network_and_set_and_bars() {
    let data = SlipFolder::new();
    let (svg, json) = (data.path().join("slip.svg"), data.path().join("slip.json"));
    let arguments =
        ["eval", "slip", argument(data.path()), "--svg", argument(&svg), "--out", argument(&json)];
    let output = meissner(&arguments);
    assert!(output.status.success() && text(&output).contains("accuracy"), "{}", message(&output));
    let report = written(&json);
    let svg = std::fs::read_to_string(svg).expect("it was written");
    let document = roxmltree::Document::parse(&svg).expect("it is well-formed XML");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for network in report["networks"].as_array().expect("a list") {
        let name = network["network"]["name"].as_str().expect("a name");
        for set in network["sets"].as_array().expect("a list") {
            let seen = if set["trained_on"] == true { " (trained on)" } else { "" };
            let title = format!("{name}, {}{seen}", set["set"].as_str().expect("a name"));
            assert!(texts.contains(&title.as_str()), "{title}: {texts:?}");
            let accuracy = 100.0 * set["accuracy"]["mean"].as_f64().expect("a number");
            assert!(texts.iter().any(|text| text.starts_with(&format!("{accuracy:.2} %, 1 training"))));
        }
    }
    for expected in ["Direction of slip", "paper (reference)", "predicted", "Textures"] {
        assert!(texts.contains(&expected), "{expected}: {texts:?}");
    }
    // 16 matrices with 49 cells, 16 bars.
    assert!(document.descendants().filter(|node| node.has_tag_name("rect")).count() > 16 * 49 + 16);
}

#[test]
fn what_cannot_be_judged_is_bad_input_or_bad_usage() {
    let data = SlipFolder::new();
    let path = argument(data.path());
    fails(
        &meissner(&["eval", "slip", "no/such/folder"]),
        1,
        &["no/such/folder: expected a folder", "aw, cw"],
    );
    fails(
        &meissner(&["eval", "slip", path, "--network", "canf"]),
        1,
        &["canf", "\"picture\"", "\"electrodes\""],
    );
    fails(&meissner(&["eval", "slip", path, "--network", "graphres"]), 1, &["graphres", "a frame network"]);
    fails(&meissner(&["eval", "slip", path, "--network", "slipless"]), 1, &["slipless", "slip-lstm"]);
    let twice = ["eval", "slip", path, "--network", "slip-lstm", "--network", "slip-lstm"];
    fails(&meissner(&twice), 2, &["--network", "each network once"]);
    fails(&meissner(&["eval", "slip", path, "--svg", "no/such/slip.svg"]), 1, &["no/such/slip.svg"]);
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let own = folder.path().join("own.toml");
    std::fs::write(&own, include_str!("../../../models/networks/slip-lstm.toml")).expect("written");
    fails(&meissner(&["eval", "slip", path, "--network", argument(&own)]), 2, &["--trainings DIR"]);
    fails(&meissner(&["eval", "slip", argument(folder.path())]), 1, &["<class>/<object><number>.csv"]);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_data_set_is_judged_by_set() {
    let data = shared("data/biotac_dos");
    let report = report(&[argument(&data), "--network", "slip-lstm"]);
    let sets = report["networks"][0]["sets"].as_array().expect("a list");
    assert_eq!(sets.len(), 4);
    assert_eq!(sets.iter().filter_map(|set| set["windows"].as_u64()).sum::<u64>(), 16_799);
    assert_eq!(report["data"]["recordings"], 306);
    for matrix in sets.iter().map(|set| counts(&set["confusion"])) {
        assert!(matrix.iter().all(|row| row.iter().sum::<u64>() > 0), "every set has every class");
    }
}

const BOTH: Scaling = Scaling::ReadingAndRange { minimum: 1911.0, maximum: 3743.0 };

/// An LSTM and the last readings, side by side.
const VIEWS: &str = r#"
[network]
name = "views"

[input]
kind = "vector"
values = 48
frames = "electrodes"
steps = 5
sampling = "sliding"
scaling = ["reading", [1911, 3743]]

[[layer]]
name = "recurrent"
kind = "lstm"
hidden = 6

[[layer]]
name = "past"
kind = "delay"
from = "frame"
frames = 5

[[layer]]
name = "join"
kind = "concat"
from = "recurrent"
with = "past"

[[layer]]
name = "fc"
kind = "dense"
outputs = 7

[output]
names = ["aw", "cw", "e", "n", "s", "t", "w"]
unit = "logit"
"#;

/// Bits of the prediction of each window of `readings`.
fn windows(engine: &mut FrameEngine, sampling: Sampling, readings: &[[f32; 24]]) -> Vec<Vec<u32>> {
    let mut window = TactileWindow::new(5, sampling, BOTH, TactileForm::Reading).expect("it can be");
    let mut predictions = Vec::new();
    for reading in readings {
        let Some(sequence) = window.push(reading).expect("finite") else { continue };
        engine.reset();
        sequence.values.chunks_exact(48).for_each(|frame| engine.push(frame).expect("a frame"));
        predictions.push(predicted(engine));
    }
    predictions
}

/// The file that is prepared for [`VIEWS`] with other `values` and `scaling`.
fn prepared(data: &Path, values: usize, scaling: &str) -> Vec<u8> {
    let text = VIEWS
        .replace("values = 48", &format!("values = {values}"))
        .replace("scaling = [\"reading\", [1911, 3743]]", &format!("scaling = {scaling}"));
    let (folder, path) = file("views.toml", text);
    let out = folder.path().join("out.safetensors");
    let arguments =
        ["prepare", "slip", argument(data), "--network", argument(&path), "--out", argument(&out)];
    let output = meissner(&arguments);
    assert!(output.status.success(), "{}", message(&output));
    std::fs::read(out).expect("it was written")
}

/// Bits of each value of the frames, and the shape of all.
fn frames(bytes: &[u8]) -> (Vec<u32>, Vec<usize>) {
    let file = SafeTensors::deserialize(bytes).expect("a valid file");
    let tensor = file.tensor("frames").expect("it is there");
    let bits = tensor.data().chunks_exact(4).map(|v| u32::from_le_bytes(v.try_into().expect("4 bytes")));
    (bits.collect(), tensor.shape().to_vec())
}

#[test]
fn prepared_frames_are_those_of_both_scalings_side_by_side() {
    let data = SlipFolder::new();
    let both = prepared(data.path(), 48, "[\"reading\", [1911, 3743]]");
    let (values, shape) = frames(&both);
    let count = CLASSES.len() * WINDOWS.iter().sum::<usize>();
    assert_eq!(shape, [count, 5, 48]);
    let [(own, _), (range, _)] =
        ["\"reading\"", "[1911, 3743]"].map(|scaling| frames(&prepared(data.path(), 24, scaling)));
    let halves = own.chunks_exact(24).zip(range.chunks_exact(24));
    assert_eq!(values, halves.flat_map(|(own, range)| [own, range].concat()).collect::<Vec<_>>());
    let said = &Weights::from_bytes(&both).expect("a valid file").metadata()["preparation"].clone();
    let preparation = json!({"frames": "electrodes", "steps": 5, "scaling": ["reading", [1911.0, 3743.0]]});
    assert_eq!(serde_json::from_str::<Value>(said).expect("JSON"), preparation);
}

#[test]
fn figures_of_a_network_with_two_views_are_the_engines() {
    let (data, folder) = (SlipFolder::new(), tempfile::tempdir().expect("there is a place"));
    let path = folder.path().join("views.toml");
    std::fs::write(&path, VIEWS).expect("written");
    let description = FrameDescription::parse(VIEWS).expect("consistent");
    let weights = draw(&description, 3);
    let preparation = description.preparation().expect("over readings");
    let metadata =
        [("network", "views"), ("seed", "3"), ("trained_on", "Basic"), ("preparation", &preparation)];
    training(folder.path(), "views.safetensors", &weights, &metadata);
    let mut engine = engine(&description, &weights);
    let outputs: Vec<_> = (0..CLASSES.len())
        .flat_map(|class| (0..OBJECTS.len()).map(move |object| readings(class, object)))
        .map(|readings| windows(&mut engine, Sampling::Consecutive, &readings))
        .collect();
    let own = ["--network", argument(&path), "--trainings", argument(folder.path())];
    let report = report(&[&[argument(data.path())], &own[..]].concat());
    for (i, object) in [2, 0, 1, 3].into_iter().enumerate() {
        let judged = &report["networks"][0]["sets"][i];
        assert_eq!(counts(&judged["confusion"]), confusion(&outputs, object));
    }
    let said: BTreeMap<String, Value> = serde_json::from_str(&preparation).expect("JSON");
    assert_eq!(report["networks"][0]["preparation"], json!(said));
}

#[test]
fn a_stream_of_readings_reaches_both_views() {
    let network = OwnNetwork::new(VIEWS);
    let readings: Vec<_> = (0..23).map(reading).collect();
    for (option, sampling) in [("sliding", Sampling::Sliding), ("consecutive", Sampling::Consecutive)] {
        let expected = windows(&mut network.engine(), sampling, &readings);
        let arguments = network.arguments(Path::new("-"), &["--json", "--sampling", option]);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let (predictions, summary) = lines(&meissner_reading(&arguments, &csv(23)));
        assert_eq!(predictions.iter().map(bits).collect::<Vec<_>>(), expected, "{option}");
        assert_eq!(summary["readings"], 23);
    }
}
