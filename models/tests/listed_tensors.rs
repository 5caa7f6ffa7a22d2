//! The tensors that a description lists: enough information to write weights that the engine can
//! read.

use std::collections::BTreeMap;

use super::support;

use meissner_engine::{ConvolutionScratch, Normalisation};
use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, Neighbour};
use meissner_models::{AnyDescription, Description, Tensor, Weights, draw, drawn_file};
use serde_json::Value;
use support::SMALL;
use support::network_text::NetworkText;

const PAGE: &str = include_str!("../../docs/weights-from-pytorch.md");

/// A network of one spline block that has only its kernel.
fn strides() -> String {
    NetworkText::over_events("strides")
        .graph("kind = \"knn\"; k = 1; candidates = \"past\"; lifetime = \"frozen\"; scale = 0.5")
        .layer("conv", "spline", "channels = 1; kernel = [3, 2, 4]; norm = false; elu = false")
        .readout("grid = [1, 1]", &["value"], "1")
}

/// The output of `meissner inspect --json`.
fn listed(description: &AnyDescription) -> Value {
    serde_json::to_value(description.summary()).expect("summaries are JSON")
}

fn sizes(list: &Value) -> Vec<usize> {
    list.as_array().expect("a list").iter().map(|size| size.as_u64().expect("a size") as usize).collect()
}

fn shipped() -> impl Iterator<Item = (&'static str, AnyDescription)> {
    let names = AnyDescription::shipped_names();
    names.map(|name| (name, AnyDescription::shipped(name).expect("a shipped network")))
}

#[test]
fn a_file_of_exactly_the_listed_names_and_shapes_is_accepted_by_every_shipped_network() {
    for (name, description) in shipped() {
        let summary = listed(&description);
        let tensors = summary["tensors"].as_array().expect("a list of tensors");
        let weights = Weights::new(tensors.iter().map(|tensor| {
            assert_eq!(tensor["dtype"], "F32", "{name}: {tensor}");
            let shape = sizes(&tensor["shape"]);
            let values = vec![0.5; shape.iter().product()];
            let name = tensor["name"].as_str().expect("a name").to_owned();
            (name, Tensor::new(shape, values).expect("as many values as the shape has"))
        }));
        let preparation = summary["preparation"].as_str();
        let metadata = preparation.map(|text| ("preparation".to_owned(), text.to_owned()));
        let bytes = weights.to_safetensors(&metadata.into_iter().collect());
        let read = Weights::from_bytes(&bytes).expect("a file that was just written");
        let (accepted, unused) = match &description {
            AnyDescription::Events(d) => (d.network(&read).map(drop), d.unused_tensors(&read)),
            AnyDescription::Frames(d) => (d.network_parts(&read).map(drop), d.unused_tensors(&read)),
        };
        accepted.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(unused.expect("one prefix").is_empty(), "{name}");
    }
}

#[test]
fn the_listed_slot_strides_are_those_of_the_kernel() {
    let description = Description::parse(&strides()).expect("consistent");
    let summary = listed(&AnyDescription::Events(description.clone()));
    let kernel = &summary["tensors"][0];
    assert_eq!((kernel["layer"].as_str(), sizes(&kernel["shape"])), (Some("conv"), vec![24, 1, 1]));
    let strides = sizes(&kernel["slot_strides"]);
    assert!(summary["tensors"][1].get("slot_strides").is_none(), "a dense layer has no slots");
    let one = Matrix::from_rows(1, &[1.0]);
    for (x, y, t) in (0..24).map(|i| (i % 3, i / 3 % 2, i / 6)) {
        let slot = strides[0] * x + strides[1] * y + strides[2] * t;
        let drawn = draw(&description, 1);
        let weights = Weights::new(drawn.iter().map(|(name, tensor)| {
            let mut values = vec![0.0; tensor.shape().iter().product()];
            if name == "conv.conv.weight" {
                values[slot] = 1.0;
            }
            (name.to_owned(), Tensor::new(tensor.shape().to_vec(), values).expect("as many values"))
        }));
        let network = description.network(&weights).expect("all tensors are there");
        let u = [x as f32 / 2.0, y as f32, t as f32 / 3.0];
        let row = GraphRow { neighbours: &[Neighbour { row: 0, u }], ..GraphRow::default() };
        let mut out = [Lanes::ZERO];
        let conv = &network.level(0).blocks[0].conv;
        conv.rows(Isa::best(), &one, &[row], &mut ConvolutionScratch::default(), &mut out);
        assert!((out[0].0[0] - 1.0).abs() < 1e-6, "slot {slot} at {u:?} gives {}", out[0].0[0]);
    }
}

#[test]
fn the_listed_scales_are_those_of_the_networks_edge_attributes() {
    for name in Description::shipped_names() {
        let description = Description::shipped(name).expect("a shipped network");
        let summary = listed(&AnyDescription::Events(description.clone()));
        let network = description.network(&draw(&description, 1)).expect("drawn for it");
        let levels = summary["edge_attributes"]["levels"].as_array().expect("a list of levels");
        assert_eq!(levels.len(), network.levels(), "{name}");
        for (number, level) in levels.iter().enumerate() {
            assert_eq!(level["level"], number, "{name}");
            let scale = level["scale"].as_f64().map(|scale| scale as f32);
            let fixed = network.parts().normalisation == Normalisation::Fixed;
            assert_eq!(scale, fixed.then(|| network.level(number).scale), "{name}, level {number}");
        }
    }
}

#[test]
fn the_page_on_weights_has_the_meaning_of_every_tensor_in_the_words_of_inspect() {
    let small = AnyDescription::parse(SMALL).expect("consistent");
    let mut meanings = BTreeMap::new();
    for (name, description) in shipped().chain([("small", small)]) {
        for tensor in listed(&description)["tensors"].as_array().expect("a list of tensors") {
            meanings.insert(tensor["meaning"].as_str().expect("a meaning").to_owned(), name);
        }
    }
    assert!(meanings.len() > 15, "{meanings:?}");
    for (meaning, name) in meanings {
        assert!(PAGE.contains(&meaning), "{name}: docs/weights-from-pytorch.md lacks {meaning:?}");
    }
}

#[test]
fn a_drawn_file_says_that_nothing_trained_it_and_is_the_same_for_the_same_seed() {
    for text in [SMALL, &strides()] {
        let description = AnyDescription::parse(text).expect("consistent");
        let bytes = drawn_file(&description, 7);
        assert!(bytes == drawn_file(&description, 7) && bytes != drawn_file(&description, 8));
        let weights = Weights::from_bytes(&bytes).expect("a file that was just written");
        assert_eq!(weights.metadata()["about"], "drawn, untrained, seed 7");
        assert_eq!(weights.metadata()["network"], description.name());
    }
}
