//! Frame networks against `PyTorch`, frame by frame: direct, Winograd, skipping, and in f64.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_kernels::WinogradTile;
use meissner_models::Weights;
use meissner_reference::FrameReference;
use meissner_tests::shared::{Golden, assert_close, frame_description, shared};
use meissner_verify::bits;

use crate::golden_networks::{WIDE, assert_wide};

const PREDICTION: f32 = 1e-4;

/// Networks with their golden files, sizes of images, and whether there is an answer for each step.
const SLIP: [Case; 3] = [
    ("slip-tuned", "slip_tuned", None, false),
    ("slip-regularised", "slip_regularised", None, false),
    ("slip-lstm", "slip_lstm", None, false),
];
const FORCE: [Case; 4] = [
    ("force-convlstm", "force_convlstm", Some([21, 19]), true),
    ("force-cnnlstm", "force_cnnlstm", None, true),
    ("force-lstm", "force_lstm", None, true),
    ("force-tdnn", "force_tdnn", None, true),
];
const EVENT_FRAMES: [Case; 1] = [("event-frame-cnn", "event_frame_cnn", None, false)];
const U_NETS: [Case; 2] =
    [("canf", "canf", Some([48, 64]), false), ("canf-plain", "canf_plain", Some([48, 64]), false)];

type Case = (&'static str, &'static str, Option<[usize; 2]>, bool);

/// Runs every sequence of the golden file.
fn check((name, file, size, each): Case) {
    let golden = Golden::load(file);
    let weights = Weights::load(shared(&format!("golden/{file}.safetensors"))).expect("readable");
    let description = frame_description(name, size);
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
        let parts = description.network_parts(&weights).expect("the weights fit");
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
fn check_wide((name, file, size, each): Case) {
    let golden = Golden::load(file);
    let weights = Weights::load(shared(&format!("golden/{file}.safetensors"))).expect("readable");
    let description = frame_description(name, size);
    let parts = description.network_parts(&weights).expect("the weights fit");
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
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn slip_networks_agree_with_the_reference() {
    SLIP.into_iter().for_each(check);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn force_networks_agree_with_the_reference_step_by_step() {
    FORCE.into_iter().for_each(check);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_event_frame_network_agrees_with_the_reference() {
    EVENT_FRAMES.into_iter().for_each(check);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_u_nets_agree_with_the_reference() {
    U_NETS.into_iter().for_each(check);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn frame_networks_in_f64_agree_with_the_golden_files() {
    SLIP.into_iter().chain(FORCE).chain(EVENT_FRAMES).chain(U_NETS).for_each(check_wide);
}
