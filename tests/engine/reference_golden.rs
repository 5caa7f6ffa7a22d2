//! The f64 reference against `PyTorch`, through the golden files: what it computes is right, not only what the engine computes,
//! too. `PyTorch`'s f32 is what remains of the differences.

use std::sync::Arc;

use meissner_engine::{Event, Sensor, Stream};
use meissner_models::{Description, Weights};
use meissner_reference::{Difference, EventReference, EventTrace, FrameReference, Rows};
use meissner_tests::shared::{Golden, POINTNET, frame_description, shared};

const SENSOR: Sensor = Sensor { width: 240, height: 180 };
const LAYER: f64 = 1e-5;
const PREDICTION: f64 = 1e-5;

/// Asserts that the golden values are within a share of the largest magnitude of the reference's.
fn assert_close(what: &str, golden: &[f32], reference: &[f64], share: f64) {
    let mut difference = Difference::default();
    difference.add_all(golden, reference);
    assert!(difference.relative() <= share, "{what}: relative error {:e}", difference.relative());
}

fn assert_rows(what: &str, golden: &Golden, name: &str, rows: &Rows) {
    assert_close(what, golden.floats(name), &rows.concat(), LAYER);
}

fn trace(golden: &Golden, name: &str, weights: &Weights) -> EventTrace {
    trace_of(golden, &Description::shipped(name).expect("a shipped network"), weights)
}

fn trace_of(golden: &Golden, description: &Description, weights: &Weights) -> EventTrace {
    let network = Arc::new(description.network_ignoring_preparation(weights).expect("the weights fit"));
    let rows = golden.integers("events").chunks_exact(4);
    let events: Vec<Event> = rows.map(|e| Event::new(e[0], e[1] as u16, e[2] as u16, e[3] == 1)).collect();
    EventReference::new(network, SENSOR, None).expect("fixed scales").forward(Stream::new(&events))
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_in_f64_agrees_with_the_golden_files() {
    let path = shared("data/checkpoints/contact_angle_graphres.safetensors");
    let weights = Weights::load(&path).expect("readable weights");
    for window in ["a", "idle", "late"] {
        let name = format!("graphres_fixed_{window}");
        let golden = Golden::load(&name);
        let trace = trace(&golden, "graphres", &weights);
        let [events, pooled] = &trace.levels[..] else { panic!("{name} has two levels") };
        for n in 1..=7 {
            let rows = if n <= 5 { &events.features[n] } else { &pooled.features[n - 5] };
            assert_rows(&format!("{name}: conv{n}"), &golden, &format!("conv{n}"), rows);
        }
        assert_rows(&format!("{name}: pool"), &golden, "pool_x", &pooled.features[0]);
        assert_rows(&format!("{name}: readout"), &golden, "readout", &trace.readout);
        assert_close(&format!("{name}: y"), golden.floats("y"), &trace.prediction, PREDICTION);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_in_f64_agrees_with_the_golden_file() {
    let path = shared("golden/tactigraph.safetensors");
    let golden = Golden::load("tactigraph");
    let weights = Weights::load(&path).expect("readable weights");
    let trace = trace(&golden, "tactigraph", &weights);
    for (l, (level, feature)) in trace.levels.iter().zip([4, 3, 3]).enumerate() {
        assert_rows(&format!("level{l}"), &golden, &format!("level{l}"), &level.features[feature]);
    }
    assert_close("y", golden.floats("y"), &trace.prediction, PREDICTION);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn pointnet_in_f64_agrees_with_the_golden_file() {
    let golden = Golden::load("pointnet");
    let weights = Weights::load(shared("golden/pointnet.safetensors")).expect("readable weights");
    let trace = trace_of(&golden, &Description::parse(POINTNET).expect("consistent"), &weights);
    for (n, rows) in trace.levels[0].features.iter().enumerate().skip(1) {
        assert_rows(&format!("conv{n}"), &golden, &format!("conv{n}"), rows);
    }
    assert_rows("conv4", &golden, "conv4", &trace.levels[1].features[1]);
    assert_close("y", golden.floats("y"), &trace.prediction, PREDICTION);
}

/// Runs every sequence of the golden file; `each` says whether there is an answer for each step.
fn check_frames(name: &str, file: &str, size: Option<[usize; 2]>, each: bool) {
    let golden = Golden::load(file);
    let path = shared(&format!("golden/{file}.safetensors"));
    let weights = Weights::load(path).expect("readable");
    let description = frame_description(name, size);
    let mut reference =
        FrameReference::new(description.network_parts(&weights).expect("the weights fit")).expect("they fit");
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
    assert_close(name, golden.floats("y"), &answers, PREDICTION);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn frame_networks_in_f64_agree_with_the_golden_files() {
    for name in ["slip-tuned", "slip-regularised", "slip-lstm"] {
        check_frames(name, &name.replace('-', "_"), None, false);
    }
    check_frames("force-convlstm", "force_convlstm", Some([21, 19]), true);
    for name in ["force-cnnlstm", "force-lstm", "force-tdnn"] {
        check_frames(name, &name.replace('-', "_"), None, true);
    }
    check_frames("event-frame-cnn", "event_frame_cnn", None, false);
    check_frames("canf", "canf", Some([48, 64]), false);
    check_frames("canf-plain", "canf_plain", Some([48, 64]), false);
}
