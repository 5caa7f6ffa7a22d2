//! Readings that are scaled in two ways, for a network whose members see one frame: prepared,
//! judged and run alike.

use std::collections::BTreeMap;
use std::path::Path;

use meissner_engine::frames::FrameEngine;
use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use meissner_models::{FrameDescription, Weights, draw};
use safetensors::SafeTensors;
use serde_json::{Value, json};

use crate::eval_slip::{confusion, counts, report};
use crate::frames::{OwnNetwork, engine, predicted};
use crate::frames_electrodes::{csv, reading};
use crate::slip_data::{CLASSES, OBJECTS, SlipFolder, WINDOWS, readings, training};
use crate::support::{argument, bits, file, lines, meissner, meissner_reading, message};

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
