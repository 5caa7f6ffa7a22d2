//! Frame networks against the reference through the golden files, frame by frame: direct, Winograd, everything computed and
//! skipping.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_kernels::WinogradTile;
use meissner_models::Weights;
use meissner_tests::shared::{Golden, assert_close, frame_description, shared};
use meissner_verify::bits;

const PREDICTION: f32 = 1e-4;

/// Runs every sequence of the golden file; `each` says whether there is an answer for each step.
fn check(name: &str, file: &str, size: Option<[usize; 2]>, each: bool) {
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

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn slip_networks_agree_with_the_reference() {
    check("slip-tuned", "slip_tuned", None, false);
    check("slip-regularised", "slip_regularised", None, false);
    check("slip-lstm", "slip_lstm", None, false);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn force_networks_agree_with_the_reference_step_by_step() {
    check("force-convlstm", "force_convlstm", Some([21, 19]), true);
    check("force-cnnlstm", "force_cnnlstm", None, true);
    check("force-lstm", "force_lstm", None, true);
    check("force-tdnn", "force_tdnn", None, true);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_event_frame_network_agrees_with_the_reference() {
    check("event-frame-cnn", "event_frame_cnn", None, false);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_u_nets_agree_with_the_reference() {
    check("canf", "canf", Some([48, 64]), false);
    check("canf-plain", "canf_plain", Some([48, 64]), false);
}
