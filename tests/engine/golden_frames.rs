//! Frame networks against `PyTorch`, frame by frame: direct, Winograd, skipping, and in f64.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_kernels::WinogradTile;
use meissner_models::{FrameDescription, Weights};
use meissner_reference::FrameReference;
use meissner_tests::shared::{Golden, assert_close, frame_description};
use meissner_verify::bits;

use crate::golden_networks::{WIDE, assert_wide};

const PREDICTION: f32 = 1e-4;

/// Networks, the sides of images in ../shared, and whether there is an answer for each step.
const SLIP: [Case; 4] = [
    ("slip-best", None, false),
    ("slip-tuned", None, false),
    ("slip-regularised", None, false),
    ("slip-lstm", None, false),
];
const FORCE: [Case; 4] = [
    ("force-convlstm", Some([21, 19]), true),
    ("force-cnnlstm", None, true),
    ("force-lstm", None, true),
    ("force-tdnn", None, true),
];
const EVENT_FRAMES: [Case; 1] = [("event-frame-cnn", None, false)];
const U_NETS: [Case; 3] = [
    ("canf", Some([48, 64]), false),
    ("canf-plain", Some([48, 64]), false),
    ("canf-live", Some([48, 64]), false),
];
/// Networks without a file in ../shared.
const SMALL_ALONE: [&str; 2] = ["slip-best", "canf-live"];

type Case = (&'static str, Option<[usize; 2]>, bool);

/// The available golden files of a network, with its description for their images and its weights.
fn goldens((name, size, _): Case) -> Vec<(Golden, FrameDescription, Weights)> {
    let large = name.replace('-', "_");
    let small = format!("{large}_small");
    let names = if SMALL_ALONE.contains(&name) { vec![&small[..]] } else { vec![&small[..], &large[..]] };
    let of = |(file, golden): (&str, Golden)| {
        if Golden::is_small(file) {
            // The dense layer of this network is for whole images.
            let size = size.filter(|_| name != "force-convlstm");
            (golden, frame_description(name, size), Weights::shipped(name).expect("shipped weights"))
        } else {
            let weights = Weights::load(Golden::path(file)).expect("readable");
            (golden, frame_description(name, size), weights)
        }
    };
    Golden::at_hand(&names).into_iter().map(of).collect()
}

/// Runs every sequence of the golden file.
fn check(case: Case) {
    goldens(case)
        .iter()
        .for_each(|(golden, description, weights)| check_one(case, golden, description, weights));
}

fn check_one((name, _, each): Case, golden: &Golden, description: &FrameDescription, weights: &Weights) {
    let (x, y) = (golden.floats("x"), golden.floats("y"));
    let sequences = golden.shape("x")[0];
    let frame = description.input().values();
    let whole = FrameOptions::new().with_skip(Skip::Nothing);
    let ways = [
        (Convolution::Direct, whole),
        (Convolution::Direct, FrameOptions::default()),
        (Convolution::Direct, FrameOptions::new().with_sparse(true)),
        (Convolution::Winograd(WinogradTile::Two), whole),
        (Convolution::Winograd(WinogradTile::Four), whole),
    ];
    let mut direct: Option<Vec<u32>> = None;
    for (convolution, options) in ways {
        let parts = description.network_parts(weights).expect("the weights fit");
        let network = FrameNetwork::new(parts, convolution).expect("the parts fit");
        let mut engine = FrameEngine::with_options(network, options).expect("options in range");
        let mut answers = Vec::new();
        for sequence in x.chunks_exact(x.len() / sequences) {
            engine.reset();
            for frame in sequence.chunks_exact(frame) {
                engine.push(frame).expect("a frame that fits");
                if each {
                    answers.extend_from_slice(engine.predict().expect("finite").values);
                }
            }
            if !each {
                answers.extend_from_slice(engine.predict().expect("finite").values);
            }
        }
        assert_close(&format!("{name}, {convolution:?}, {options:?}"), &answers, y, PREDICTION);
        if convolution == Convolution::Direct {
            assert_eq!(direct.get_or_insert_with(|| bits(&answers)), &bits(&answers), "{name}: {options:?}");
        }
    }
}

/// The same in f64.
fn check_wide(case: Case) {
    goldens(case)
        .iter()
        .for_each(|(golden, description, weights)| wide_one(case, golden, description, weights));
}

fn wide_one((name, _, each): Case, golden: &Golden, description: &FrameDescription, weights: &Weights) {
    let parts = description.network_parts(weights).expect("the weights fit");
    let mut reference = FrameReference::new(parts).expect("they fit");
    let x: Vec<f64> = golden.floats("x").iter().map(|&v| f64::from(v)).collect();
    let mut answers = Vec::new();
    for sequence in x.chunks_exact(x.len() / golden.shape("x")[0]) {
        reference.reset();
        for frame in sequence.chunks_exact(description.input().values()) {
            let prediction = reference.push(frame);
            if each {
                answers.extend_from_slice(prediction);
            }
        }
        if !each {
            answers.extend_from_slice(reference.prediction());
        }
    }
    assert_wide(name, golden.floats("y"), &answers, WIDE);
}

#[test]
fn slip_networks_agree_with_the_reference() {
    SLIP.into_iter().for_each(check);
}

#[test]
fn force_networks_agree_with_the_reference_step_by_step() {
    FORCE.into_iter().for_each(check);
}

#[test]
fn the_event_frame_network_agrees_with_the_reference() {
    EVENT_FRAMES.into_iter().for_each(check);
}

#[test]
fn the_u_nets_agree_with_the_reference() {
    U_NETS.into_iter().for_each(check);
}

#[test]
fn frame_networks_in_f64_agree_with_the_golden_files() {
    SLIP.into_iter().chain(FORCE).chain(EVENT_FRAMES).chain(U_NETS).for_each(check_wide);
}
