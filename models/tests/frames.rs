//! Properties of the shipped frame networks, and the parts that weights make from a description.

use super::support;

use meissner_engine::Sensor;
use meissner_engine::frames::{FrameLayerKind, FrameNetworkParts, FrameShape};
use meissner_engine::representations::{Crop, Sampling, Scaling};
use meissner_models::description::frames::{CropPlace, SignedTiming};
use meissner_models::{
    AnyDescription, Description, FrameDescription, FrameLayer, FrameSource, ModelError, Tensor, Weights, draw,
};
use support::{SMALL, SMALL_FRAMES, changed_frames, shared};

/// Parameters as `PyTorch` counts them, and tensors in a state dict without counters of batches.
const REFERENCE: [(&str, usize, usize); 13] = [
    ("canf", 1_940_577, 92),
    ("canf-live", 433_401, 70),
    ("canf-plain", 1_927_009, 78),
    ("event-frame-cnn", 1_850_818, 20),
    ("force-cnnlstm", 23_510, 14),
    ("force-convlstm", 42_208, 10),
    ("force-lstm", 182_049, 26),
    ("force-tdnn", 1_313, 6),
    ("slip-best", 300_007, 26),
    ("slip-lstm", 26_727, 22),
    ("slip-regularised", 360_423, 19),
    ("slip-tuned", 399_271, 21),
    ("tactip-frames", 802_307, 20),
];

const LOGITS: &str = "logit, logit, logit, logit, logit, logit, logit";

fn shipped(name: &str) -> FrameDescription {
    FrameDescription::shipped(name).expect("a shipped description")
}

fn parse(text: &str) -> FrameDescription {
    FrameDescription::parse(text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn layer<'a>(description: &'a FrameDescription, name: &str) -> &'a FrameLayer {
    description.layers().iter().find(|layer| layer.name == name).expect("a layer of this name")
}

fn parts(description: &FrameDescription, weights: &Weights) -> FrameNetworkParts {
    description.network_parts(weights).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_shipped_network_has_the_parameters_and_tensors_of_its_reference() {
    assert!(FrameDescription::shipped_names().iter().eq(REFERENCE.iter().map(|(name, _, _)| name)));
    for (name, parameters, tensors) in REFERENCE {
        let description = shipped(name);
        assert_eq!((description.name(), description.parameters()), (name, parameters));
        assert_eq!(description.tensors().len(), tensors, "{name}");
    }
    assert!(FrameDescription::shipped("graphres").is_none() && Description::shipped("canf").is_none());
}

#[test]
fn every_shipped_network_predicts_what_its_reference_does() {
    for (name, output, outputs, unit) in [
        ("canf", "1 x 240 x 320", 1, "N/pixel"),
        ("canf-live", "1 x 240 x 320", 1, "N/pixel"),
        ("canf-plain", "1 x 240 x 320", 1, "N/pixel"),
        ("event-frame-cnn", "2 values", 2, "rad, rad"),
        ("force-cnnlstm", "1 values", 1, "N"),
        ("force-convlstm", "1 values", 1, "N"),
        ("force-lstm", "1 values", 1, "N"),
        ("force-tdnn", "1 values", 1, "N"),
        ("slip-best", "7 values", 7, LOGITS),
        ("slip-lstm", "7 values", 7, LOGITS),
        ("slip-regularised", "7 values", 7, LOGITS),
        ("slip-tuned", "7 values", 7, LOGITS),
        ("tactip-frames", "3 values", 3, "mm, deg, deg"),
    ] {
        let description = shipped(name);
        let (names, units) = description.outputs();
        assert_eq!(
            (description.output().to_string().as_str(), names.len(), units.len()),
            (output, outputs, outputs)
        );
        assert_eq!(units.join(", "), unit);
    }
}

#[test]
fn a_name_or_a_file_of_either_kind_opens() {
    let names: Vec<&str> = AnyDescription::shipped_names().collect();
    assert_eq!(names.len(), Description::shipped_names().len() + REFERENCE.len());
    for name in names {
        let any = AnyDescription::shipped(name).expect("shipped");
        assert_eq!(any.name(), name);
        assert_eq!(matches!(any, AnyDescription::Frames(_)), FrameDescription::shipped(name).is_some());
    }
    let folder = tempfile::tempdir().expect("a place for temporary files");
    for (text, frames) in [(SMALL, false), (SMALL_FRAMES, true)] {
        let path = folder.path().join("network.toml");
        std::fs::write(&path, text).expect("a file");
        let any = AnyDescription::load(&path).expect("consistent");
        assert_eq!((matches!(any, AnyDescription::Frames(_)), any.name()), (frames, "small"));
        assert_eq!(FrameDescription::load(&path).is_ok(), frames);
    }
    assert!(AnyDescription::shipped("canfnet").is_none());
}

#[test]
fn sources_are_settings_of_the_engines_representations() {
    let FrameSource::EventCounts { period_us, place, .. } = *shipped("force-lstm").source() else {
        panic!("counts of events")
    };
    assert_eq!((period_us, place), (10_000, CropPlace::Centre));
    assert_eq!(place.crop(115, 115, Sensor::new(346, 260)), Crop::new(115, 72, 115, 115));
    assert_eq!(place.crop(115, 115, Sensor::new(64, 260)), Crop::new(0, 72, 115, 115));
    let FrameSource::Signed { timing, place, .. } = *shipped("event-frame-cnn").source() else {
        panic!("signed frames")
    };
    assert_eq!(timing, SignedTiming::Sliding { span_us: 150_000 });
    assert_eq!(place.crop(346, 260, Sensor::new(346, 260)), Crop::whole(Sensor::new(346, 260)));
    let FrameSource::TactileImage(readings) = *shipped("slip-tuned").source() else { panic!("images") };
    assert_eq!((readings.steps, readings.sampling), (5, Sampling::Sliding));
    let FrameSource::Picture(picture) = *shipped("canf").source() else { panic!("pictures") };
    assert!(picture.image_normalisation().is_ok() && picture.force_normalisation().is_ok());
    assert_eq!(picture.pixel_size().expect("a size").area_mm2(1), 0.06 * 0.06);
    assert_eq!([shipped("slip-lstm"), shipped("force-lstm")].map(|d| d.source().steps()), [Some(5), None]);
    let text = changed_frames("scaling = \"image\"", "scaling = [-1, 2.5]\nsampling = 3");
    let FrameSource::TactileImage(readings) = *parse(&text).source() else { panic!("images") };
    assert_eq!(readings.sampling, Sampling::Step { stride: 3 });
    assert_eq!(readings.scaling, Scaling::Range { minimum: -1.0, maximum: 2.5 });
}

#[test]
fn shapes_and_costs_follow_from_the_layers() {
    let canf = shipped("canf");
    assert_eq!(layer(&canf, "down4b").output, FrameShape::Image { channels: 256, height: 30, width: 40 });
    assert_eq!(layer(&canf, "join1").output, FrameShape::Image { channels: 256, height: 60, width: 80 });
    assert_eq!(layer(&canf, "join1").with(), Some("down3s"));
    assert_eq!(layer(&canf, "down1a").multiply_adds, 9 * 3 * 32 * 240 * 320);
    assert_eq!(layer(&canf, "lift3").multiply_adds, 64 * 32 * 240 * 320);
    assert_eq!(layer(&canf, "down4s").multiply_adds, 2 * 256 * 16);
    let cnn = shipped("event-frame-cnn");
    assert_eq!(
        layer(&cnn, "flat").output,
        FrameShape::Vector(256 * 4 * 5),
        "odd rows and columns are left out"
    );
    let slip = shipped("slip-tuned");
    assert_eq!(layer(&slip, "cell2").multiply_adds, 132 * (128 * 9 * 64 + 3 * 32));
    assert_eq!(layer(&slip, "cell2").state, 2 * 32 * 132);
    assert_eq!(layer(&shipped("force-lstm"), "lstm1").multiply_adds, 128 * (2 * 23 * 23 + 32));
    assert_eq!(layer(&shipped("force-tdnn"), "delay").output, FrameShape::Vector(6));
}

#[test]
fn shipped_weights_fit_say_what_they_are_and_are_the_same_every_time() {
    for name in FrameDescription::shipped_names() {
        let (description, weights) = (shipped(name), Weights::shipped(name).expect("shipped weights"));
        let about = match *name {
            "event-frame-cnn" => "trained on presses of a simulated dome",
            "tactip-frames" => "trained on presses of a real TacTip whose camera is modelled",
            name if name.starts_with("force-") => "trained on grasps of simulated bolts",
            name if name.starts_with("canf") => "trained on simulated pictures",
            _ => "trained on the Basic objects of biotac_dos, seed 0",
        };
        assert!(weights.metadata()["about"].starts_with(about), "{name}");
        assert_eq!(weights.metadata()["network"], *name);
        assert_eq!(weights, Weights::shipped(name).expect("shipped weights"));
        assert!(description.unused_tensors(&weights).expect("one prefix").is_empty());
        let network = parts(&description, &weights);
        assert_eq!((network.name.as_str(), network.layers.len()), (*name, description.layers().len()));
        for (tensor, _) in description.tensors().iter().filter(|(name, _)| name.ends_with("running_var")) {
            let variances = weights.get(tensor).and_then(Tensor::values).expect("floats");
            assert!(variances.iter().all(|&v| v > 0.0), "{tensor}");
        }
    }
}

#[test]
fn drawn_values_have_the_bits_that_another_implementation_gives() {
    // From a script in Python that follows the header of the generator; the seed is 17.
    let weights = draw(&shipped("force-tdnn"), 17);
    let hash = |name: &str| {
        let values = weights.get(name).and_then(Tensor::values).expect("floats");
        values.iter().fold(0u32, |hash, v| hash.rotate_left(5) ^ v.to_bits())
    };
    assert_eq!(["fc1.weight", "fc2.bias"].map(hash), [3_323_988_792, 772_825_928]);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_references_weights_fit_their_descriptions_under_their_prefix() {
    // Networks of this project: their twins in PyTorch are in `models/train/{slip,angle}` and in
    // `benches/peers`.
    let own = ["canf-live", "slip-best", "tactip-frames"];
    for (name, _, _) in REFERENCE.into_iter().filter(|(name, _, _)| !own.contains(name)) {
        let file = name.replace('-', "_");
        let path = shared(&format!("golden/{file}.safetensors"));
        let weights = Weights::load(path).expect("readable");
        let mut text =
            std::fs::read_to_string(format!("{}/networks/{name}.toml", env!("CARGO_MANIFEST_DIR")))
                .expect("a shipped file");
        if name == "force-convlstm" {
            // The reference uses a part of the crop.
            text = text.replace("height = 115", "height = 21").replace("width = 115", "width = 19");
        }
        let description = parse(&text);
        let network = parts(&description, &weights);
        assert_eq!(network.layers.len(), description.layers().len());
        assert_eq!(description.unused_tensors(&weights).expect("one prefix"), ["x", "y"], "{name}");
    }
}

#[test]
fn layers_refer_to_each_other_as_the_engine_counts_them() {
    let description = shipped("canf-plain");
    let network = parts(&description, &draw(&description, 1));
    let place = |name: &str| 1 + network.layers.iter().position(|layer| layer.name == name).expect("a layer");
    for (i, layer) in network.layers.iter().enumerate() {
        assert_eq!(layer.from, i, "a chain but for the joins");
    }
    for (join, with) in [("join1", "down3b"), ("join2", "down2b"), ("join3", "down1b")] {
        let FrameLayerKind::Concat { with: found } = network.layers[place(join) - 1].kind else {
            panic!("{join}")
        };
        assert_eq!(found, place(with));
    }
}

#[test]
fn batch_norm_is_part_of_weight_and_bias_rounded_once() {
    let description = parse(&changed_frames("activation = \"relu\"", "activation = \"relu\"\nnorm = \"bn\""));
    let value = |part: usize, i: usize| 0.3 + 0.41 * part as f32 + 0.07 * (i % 17) as f32;
    let tensors: Vec<(String, Vec<usize>)> = description.tensors();
    let weights = Weights::new(tensors.into_iter().enumerate().map(|(part, (name, shape))| {
        let values = (0..shape.iter().product()).map(|i| value(part, i)).collect();
        (name, Tensor::new(shape, values).expect("as many values as the shape has"))
    }));
    let network = parts(&description, &weights);
    let FrameLayerKind::Conv { weight, bias: Some(bias), relu: true, .. } = &network.layers[0].kind else {
        panic!("a convolution with a bias")
    };
    for (o, (bias, row)) in bias.iter().zip(weight.chunks_exact(9)).enumerate() {
        // The convolution's weight and bias, then gamma, beta, mean, variance.
        let [b, gamma, beta, mean, variance] = [1, 2, 3, 4, 5].map(|part| f64::from(value(part, o)));
        let scale = gamma / (variance + 1e-5).sqrt();
        assert_eq!(*bias, (b * scale + (beta - mean * scale)) as f32);
        for (i, w) in row.iter().enumerate() {
            assert_eq!(*w, (f64::from(value(0, 9 * o + i)) * scale) as f32);
        }
    }
}

#[test]
fn an_lstms_two_biases_become_one_rounded_once() {
    let description = shipped("slip-lstm");
    let weights = Weights::shipped("slip-lstm").expect("drawn weights");
    let tensor = |name: &str| weights.get(name).and_then(Tensor::values).expect("floats");
    let FrameLayerKind::Lstm { bias, weight_ih, .. } = &parts(&description, &weights).layers[1].kind else {
        panic!("an LSTM")
    };
    assert_eq!(weight_ih, tensor("lstm.weight_ih_l1"));
    for (i, b) in bias.iter().enumerate() {
        let sum = f64::from(tensor("lstm.bias_ih_l1")[i]) + f64::from(tensor("lstm.bias_hh_l1")[i]);
        assert_eq!(*b, sum as f32);
    }
}

#[test]
fn every_tensor_that_does_not_fit_is_reported() {
    let description = shipped("slip-regularised");
    let drawn = Weights::shipped("slip-regularised").expect("drawn weights");
    let broken = drawn.iter().filter(|(name, _)| *name != "fc2.bias").map(|(name, tensor)| {
        let tensor = match name {
            "cells.1.peephole" => Tensor::new(vec![1], vec![0.0]),
            "norm.running_var" => Tensor::new(vec![32], vec![-1.0; 32]),
            _ => Some(tensor.clone()),
        };
        (name.to_owned(), tensor.expect("as many values as the shape has"))
    });
    let error = description.network_parts(&Weights::new(broken)).expect_err("three tensors do not fit");
    let ModelError::Weights { problems, .. } = &error else { panic!("{error}") };
    let names: Vec<&str> = problems.iter().map(|problem| problem.tensor.as_str()).collect();
    assert_eq!(names, ["cells.1.peephole", "norm.running_var", "fc2.bias"], "{error}");
}

#[test]
fn the_table_the_data_and_the_pictures_name_every_layer() {
    for name in FrameDescription::shipped_names() {
        let description = shipped(name);
        let json = serde_json::to_value(description.summary()).expect("data");
        assert_eq!(json["layers"].as_array().map(Vec::len), Some(description.layers().len()));
        assert_eq!(json["parameters"], description.parameters());
        assert_eq!(json["source"]["frames"], description.source().word());
        let any = AnyDescription::shipped(name).expect("shipped");
        assert_eq!(serde_json::to_value(any.summary()).expect("data"), json);
        let texts = [any.to_table(), any.to_dot(), any.to_svg(), json.to_string()];
        for layer in description.layers() {
            assert!(texts.iter().all(|text| text.contains(&layer.name)), "{}", layer.name);
        }
        assert!(texts[1].starts_with("digraph") && texts[1].trim_end().ends_with('}'));
        let joins = description.layers().iter().filter(|layer| layer.with().is_some()).count();
        assert_eq!(texts[1].matches("style = dashed").count(), joins);
        assert_eq!(texts[2].matches("stroke-dasharray").count(), joins);
    }
}
