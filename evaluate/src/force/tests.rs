use std::path::Path;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::{FrameDescription, Weights};
use meissner_run::predictor::Mode;
use rayon::ThreadPoolBuilder;

use super::{Options, PERIOD_US, Report, evaluate};
use crate::metrics::{MeanStd, time_warping};
use crate::prepare::grasps;
use crate::streams::Streams;
use crate::trainings::{Evaluation, Request};
use crate::workers::Workers;

const RECORDINGS: usize = 3;

/// A file of grasps in its own folder.
fn file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("grasps.safetensors");
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    let bytes = grasps(RECORDINGS, 4, &pool).expect("recordings").file.into_bytes();
    std::fs::write(&path, bytes).expect("it is written");
    (folder, path)
}

fn judged(path: &Path, network: &str, every_us: i64, threads: usize) -> Evaluation<Report> {
    let networks = [network.to_owned()];
    let request = Request { networks: &networks, ..Request::default() };
    let options = Options { request, every_us, mode: Mode::Incremental };
    let workers: Workers = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").into();
    evaluate(path, &options, &workers, |_, _| {}).expect("it is judged")
}

/// Frames that are counted event by event, and their forces by the engine.
fn naive(path: &Path, network: &str) -> Vec<Vec<f32>> {
    let description = FrameDescription::shipped(network).expect("a network");
    let weights = Weights::shipped(network).expect("weights");
    let parts = description.network_parts(&weights).expect("the weights fit");
    let built = FrameNetwork::new(parts, Convolution::Direct).expect("it is built");
    let streams = Streams::read(path).expect("streams");
    let part = |events: &&[meissner_engine::Event]| {
        let mut engine = FrameEngine::new(built.clone()).expect("an engine");
        let force = |frame: i64| {
            let mut counts = vec![0.0_f32; 2 * 115 * 115];
            for event in events.iter().filter(|event| event.t_us / PERIOD_US == frame) {
                let pixel = usize::from(event.y) * 115 + usize::from(event.x);
                counts[usize::from(event.on) * 115 * 115 + pixel] += 1.0 / 8.0;
            }
            engine.push(&counts).expect("a frame");
            engine.predict().expect("a force").values[0]
        };
        (0..41).map(force).collect()
    };
    streams.parts().iter().map(part).collect()
}

#[test]
fn frame_networks_see_each_frame_once_and_their_errors_are_those_of_the_frames() {
    let (_folder, path) = file();
    for network in ["force-tdnn", "force-lstm"] {
        let report = judged(&path, network, 1_000, 1).report;
        let expected = naive(&path, network);
        for (trace, expected) in report.networks[0].result.traces.iter().zip(&expected) {
            let found: Vec<f64> = trace.iter().map(|pair| pair.1).collect();
            assert_eq!(found.len(), 41);
            let close = |(found, expected): (&f64, &f32)| (found - f64::from(*expected)).abs() < 1e-6;
            assert!(found.iter().zip(expected).all(close), "{network}: {found:?}, {expected:?}");
        }
        let errors = report.networks[0].result.traces.iter().flatten().map(|(truth, found)| found - truth);
        let squares: Vec<f64> = errors.map(|error| error * error).collect();
        let figures = &report.networks[0].result.figures.as_ref().expect("figures").mean;
        let mean = MeanStd::of(&squares).expect("frames").mean;
        assert!((figures.parts[0].mse.mean - mean).abs() < 1e-12);
        let named: Vec<&str> = figures.parts.iter().map(|part| part.part.as_str()).collect();
        assert_eq!(named, ["all", "grasping", "holding", "releasing", "8 mm", "12 mm", "16 mm"]);
        // Frames of the phases are all frames, and so are those of the bolts.
        let sum =
            |range: std::ops::Range<usize>| figures.parts[range].iter().map(|part| part.frames).sum::<u64>();
        assert_eq!([sum(0..1), sum(1..4), sum(4..7)], [41 * RECORDINGS as u64; 3]);
        let weighted: f64 = figures.parts[1..4].iter().map(|part| part.mse.mean * part.frames as f64).sum();
        assert!((weighted / (41.0 * RECORDINGS as f64) - mean).abs() < 1e-9);
        // The frames in contact are those with a force, of the part's own recordings and times.
        let traces = &report.networks[0].result.traces;
        let touched = |trace: &[(f64, f64)]| -> Vec<(f64, f64)> {
            trace.iter().copied().filter(|pair| pair.0 != 0.0).collect()
        };
        let small = touched(&traces[0]);
        let found = figures.contact.iter().find(|part| part.part == "8 mm").expect("its bolt");
        let absolute: f64 = small.iter().map(|(truth, found)| (found - truth).abs()).sum();
        let (truth, values): (Vec<f64>, Vec<f64>) = small.iter().copied().unzip();
        assert!(found.frames == small.len() as u64 && found.frames < 41);
        assert!((found.mae.mean - absolute / small.len() as f64).abs() < 1e-12);
        assert!((found.time_warping.mean - time_warping(&values, &truth)).abs() < 1e-9);
        let frames = traces.iter().map(|trace| touched(trace).len() as u64).sum::<u64>();
        assert_eq!(figures.contact[0].frames, frames);
        assert_eq!(figures.contact[1..4].iter().map(|part| part.frames).sum::<u64>(), frames);
    }
}

#[test]
fn the_number_of_threads_changes_no_force() {
    let (_folder, path) = file();
    let forces = |threads| judged(&path, "force-cnnlstm", 10_000, threads).logits.into_bytes();
    assert_eq!(forces(1), forces(3));
}

#[test]
fn a_network_of_other_quantities_and_a_time_that_does_not_divide_a_frame_are_refused() {
    let (_folder, path) = file();
    let refused = |network: &str, every_us| {
        let networks = [network.to_owned()];
        let request = Request { networks: &networks, ..Request::default() };
        let options = Options { request, every_us, mode: Mode::Incremental };
        let workers: Workers = ThreadPoolBuilder::new().num_threads(1).build().expect("a thread").into();
        evaluate(&path, &options, &workers, |_, _| {}).err().expect("it is refused").to_string()
    };
    assert!(refused("tactigraph-past", 10_000).contains("which predicts roll, pitch"));
    assert!(refused("force-tdnn", 3_000).contains("divides 10000 us"));
}
