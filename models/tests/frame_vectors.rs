//! Descriptions of networks over vectors: readings that are scaled twice, vectors that are joined.

use super::support;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameShape};
use meissner_engine::representations::Scaling;
use meissner_models::{AnyDescription, FrameDescription, FrameSource, draw};
use support::{SMALL_FRAMES, changed_frames};

/// Two members that read the same frame.
const VIEWS: &str = r#"[network]
name = "views"

[input]
kind = "vector"
values = 48
frames = "electrodes"
steps = 5
scaling = ["reading", [1911, 3743.5]]

[[layer]]
name = "recurrent"
kind = "lstm"
hidden = 4

[[layer]]
name = "past"
kind = "delay"
from = "frame"
frames = 3

[[layer]]
name = "join"
kind = "concat"
from = "recurrent"
with = "past"

[[layer]]
name = "fc"
kind = "dense"
outputs = 2

[output]
names = ["left", "right"]
unit = "logit"
"#;

fn views(old: &str, new: &str) -> String {
    assert!(VIEWS.contains(old), "{old:?} must be in the description");
    VIEWS.replacen(old, new, 1)
}

/// The only problem, as printed.
#[track_caller]
fn only(text: &str) -> String {
    let error = FrameDescription::parse(text).expect_err("the description must be refused");
    assert_eq!(error.problems().len(), 1, "{error}");
    error.to_string()
}

#[test]
fn readings_are_scaled_twice_where_a_file_says_so() {
    let description = FrameDescription::parse(VIEWS).expect("consistent");
    let FrameSource::Electrodes(readings) = *description.source() else { panic!("electrodes") };
    assert_eq!(readings.scaling, Scaling::ReadingAndRange { minimum: 1911.0, maximum: 3743.5 });
    assert_eq!(description.input(), FrameShape::Vector(48));
    let shown = description.source().to_string();
    assert!(shown.ends_with(r#"scaling = ["reading",[1911.0,3743.5]]"#), "{shown}");
}

#[test]
fn a_frame_of_readings_has_as_many_values_as_its_scaling_gives() {
    assert_eq!(
        only(&views("values = 48", "values = 24")),
        "line 5: kind: expected a vector of 48 values, as frames = \"electrodes\" with scaling = \
         [\"reading\",[1911.0,3743.5]] gives, found 24 values"
    );
    for scaling in ["\"reading\"", "\"image\"", "[1911, 3743]"] {
        assert_eq!(
            only(&views("[\"reading\", [1911, 3743.5]]", scaling)),
            "line 5: kind: expected a vector of 24 values, as frames = \"electrodes\" gives, found 48 values"
        );
    }
}

#[test]
fn two_scalings_are_a_reading_and_a_range() {
    for found in [
        "[\"reading\", [2, 1]]",
        "[\"image\", [1, 2]]",
        "[\"reading\"]",
        "[\"reading\", 3]",
        "[\"reading\", [1, 2, 3]]",
        "[\"reading\", [1, [2]]]",
        "[[1, 2], \"reading\"]",
        "[\"reading\", [1, 2], [1, 2]]",
    ] {
        let shown = found.replace("[2]]]", "an array]]");
        assert_eq!(
            only(&views("[\"reading\", [1911, 3743.5]]", found)),
            format!(
                "line 9: scaling: expected \"image\", \"reading\", a range such as [1800, 3500], or [\"reading\", \
                 [1800, 3500]], found {shown}"
            )
        );
    }
}

#[test]
fn an_image_is_scaled_in_one_way() {
    assert_eq!(
        only(&changed_frames("scaling = \"image\"", "scaling = [\"reading\", [1911, 3743]]")),
        "line 11: scaling: expected only with frames = \"electrodes\": an image has one value for each electrode"
    );
}

#[test]
fn joined_vectors_are_as_long_as_both_and_computed_from_both() {
    let description = FrameDescription::parse(VIEWS).expect("consistent");
    let join = &description.layers()[2];
    assert_eq!((join.output, join.with()), (FrameShape::Vector(4 + 3 * 48), Some("past")));
    assert_eq!((join.state, join.parameters, join.multiply_adds), (0, 0, 0));
    let weights = draw(&description, 1);
    assert_eq!(weights.get("fc.weight").expect("drawn").shape(), [2, 148]);
    let engine = |text: &str| {
        let description = FrameDescription::parse(text).expect("consistent");
        let parts = description.network_parts(&weights).expect("the weights fit");
        let network = FrameNetwork::new(parts, Convolution::Direct).expect("the parts fit");
        FrameEngine::new(network).expect("options in range")
    };
    // The same values, with the prediction before its last sum.
    let (head, _) = VIEWS.split_once("[[layer]]\nname = \"fc\"").expect("a layer");
    let names: Vec<String> = (0..148).map(|i| format!("\"{i}\"")).collect();
    let before = format!("{head}[output]\nnames = [{}]\nunit = \"1\"\n", names.join(", "));
    let (mut whole, mut before) = (engine(VIEWS), engine(&before));
    let frame: Vec<f32> = (0..48).map(|i| i as f32 / 48.0).collect();
    for engine in [&mut whole, &mut before] {
        engine.push(&frame).expect("a frame");
    }
    let joined = before.predict().expect("finite").values;
    assert!(joined[..4].iter().all(|value| value.abs() < 1.0 && *value != 0.0), "{joined:?}");
    assert!(joined[4..].chunks_exact(3).zip(&frame).all(|(series, &v)| series == [0.0, 0.0, v]));
    let tensor = |name: &str| weights.get(name).and_then(|tensor| tensor.values()).expect("floats");
    let found = whole.predict().expect("finite").values;
    for (row, (found, bias)) in tensor("fc.weight").chunks_exact(148).zip(found.iter().zip(tensor("fc.bias")))
    {
        let products = row.iter().zip(joined).map(|(&w, &v)| f64::from(w) * f64::from(v));
        let expected = products.sum::<f64>() + f64::from(*bias);
        assert!((f64::from(*found) - expected).abs() < 1e-5, "{found} and {expected}");
    }
}

#[test]
fn a_vector_is_not_joined_with_an_image() {
    assert_eq!(
        only(&changed_frames("with = \"conv1\"", "with = \"total\"").replace(
            "[[layer]]\nname = \"join\"",
            "[[layer]]\nname = \"total\"\nkind = \"sum\"\nfrom = \"conv1\"\n\n[[layer]]\nname = \"join\"\nfrom = \"cell\"",
        )),
        "line 34: layer \"join\": with: expected an image, found sum layer \"total\" on line 25 (3 values)"
    );
    let join = "kind = \"concat\"\nfrom = \"flat\"\nwith = \"conv1\"";
    let text = SMALL_FRAMES.replace(
        "kind = \"dense\"\noutputs = 2",
        &format!("{join}\n\n[[layer]]\nname = \"last\"\nkind = \"dense\"\noutputs = 2"),
    );
    assert_eq!(
        only(&text),
        "line 38: layer \"fc\": with: expected a vector (an image becomes one in a flatten layer), found conv layer \
         \"conv1\" on line 13 (3 x 12 x 11)"
    );
}

#[test]
fn inspection_shows_both_vectors_that_are_joined() {
    let any = AnyDescription::parse(VIEWS).expect("consistent");
    let table = any.to_table();
    let row = table.lines().find(|line| line.trim_start().starts_with("join")).expect("a row");
    assert!(row.contains("recurrent, past") && row.contains("148 values"), "{row}");
    assert!(table.contains(r#"scaling = ["reading",[1911.0,3743.5]]"#), "{table}");
    assert_eq!(any.to_dot().matches("style = dashed").count(), 1);
    assert_eq!(any.to_svg().matches("stroke-dasharray").count(), 1);
    let json = serde_json::to_value(any.summary()).expect("data");
    assert_eq!(json["source"]["scaling"], serde_json::json!(["reading", [1911.0, 3743.5]]));
    assert_eq!(json["layers"][2]["with"], "past");
}
