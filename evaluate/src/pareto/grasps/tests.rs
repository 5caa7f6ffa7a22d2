//! The study on a few simulated grasps: the exact setting against `eval force`, and the effect of
//! settings on the frames.

use std::path::{Path, PathBuf};

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::{FrameDescription, TensorFile, Weights};
use meissner_run::predictor::Mode;
use rayon::ThreadPoolBuilder;

use super::force;
use crate::error::EvaluateError;
use crate::force::{self as judged, ForceErrors, PERIOD_US};
use crate::metrics::MeanStd;
use crate::pareto::{Compared, ErrorKind, Options, Report, SettingReport, State};
use crate::prepare::grasps;
use crate::streams::Streams;
use crate::trainings::Request;
use crate::workers::Workers;

const RECORDINGS: usize = 3;
const FRAMES: u64 = 41;

fn workers(threads: usize) -> Workers {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").into()
}

/// A file in its own folder.
fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("grasps.safetensors");
    std::fs::write(&path, bytes).expect("it is written");
    (folder, path)
}

fn simulated() -> (tempfile::TempDir, PathBuf) {
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    written(&grasps(RECORDINGS, 4, &pool).expect("recordings").file.into_bytes())
}

/// Recordings without events, each with its length in microseconds, under a force that rises to 1
/// N.
fn silent(lengths: &[i64]) -> (tempfile::TempDir, PathBuf) {
    let mut file = TensorFile::new([("sensor".to_owned(), "[115, 115]".to_owned())].into());
    ["t_us", "x", "y", "on"].into_iter().for_each(|name| file.i64(name, &[0], &[]));
    file.i64("start", &[lengths.len() + 1], &vec![0; lengths.len() + 1]);
    let count = 2 * lengths.len();
    let starts: Vec<i64> = (0..=lengths.len() as i64).map(|i| 2 * i).collect();
    let times: Vec<i64> = lengths.iter().flat_map(|&length| [1_000_000, 1_000_000 + length]).collect();
    file.i64("truth.start", &[starts.len()], &starts);
    file.i64("truth.t_us", &[count], &times);
    file.f32("truth.force", &[count], &[0.0, 1.0].repeat(lengths.len()));
    written(&file.into_bytes())
}

fn studied(path: &Path, networks: &[&str], only: &[&str], threads: usize) -> Result<Report, EvaluateError> {
    let [networks, only] =
        [networks, only].map(|of| of.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    let options = Options { timed: Some(2), repeats: 1, only };
    let workers = workers(threads);
    let request = Request { networks: &networks, ..Request::default() };
    force(path, request, &options, &workers)?.run(&options, &mut State::open(None).unwrap(), |_| Ok(()))
}

/// The errors of `eval force`, which reads event graphs every millisecond.
fn evaluated(path: &Path, network: &str) -> ForceErrors<MeanStd> {
    let networks = [network.to_owned()];
    let request = Request { networks: &networks, ..Request::default() };
    let options = judged::Options { request, every_us: 1_000, mode: Mode::Incremental };
    let mut report = judged::evaluate(path, &options, &workers(2), |_, _| ()).expect("it is judged").report;
    report.networks.remove(0).result.figures.expect("there are recordings").mean
}

fn setting<'a>(report: &'a Report, network: usize, name: &str) -> &'a SettingReport {
    let found = report.networks[network].settings.iter().find(|setting| setting.setting == name);
    found.unwrap_or_else(|| panic!("{name}"))
}

#[test]
fn the_exact_setting_of_both_kinds_of_network_has_the_errors_of_eval_force() {
    let (_folder, path) = simulated();
    let names = ["force-graph", "force-tdnn", "force-cnnlstm"];
    let report = studied(&path, &names, &["exact"], 2).expect("it is measured");
    assert_eq!((report.unit, report.compared), ("recording", Compared::Task(ErrorKind::SquaredForce)));
    assert_eq!((report.data.size, report.data.timed), (RECORDINGS as u64, 2));
    for (network, name) in names.iter().enumerate() {
        let exact = setting(&report, network, "exact");
        let (task, expected) = (&exact.measurement.task, evaluated(&path, name));
        assert_eq!(exact.error, expected.parts[0].mse.mean, "{name}");
        assert_eq!(
            (task[1].kind, task[1].error),
            (ErrorKind::AbsoluteForce, expected.parts[0].mae.mean),
            "{name}"
        );
        assert_eq!([task[0].trials, task[1].trials], [FRAMES * RECORDINGS as u64; 2]);
        let (low, high) = exact.interval_95.expect("three recordings");
        assert!(0.0 <= low && low <= exact.error && exact.error < high, "{name}");
        assert_eq!((exact.measurement.numerical.max, exact.measurement.entered), (0.0, 1.0), "{name}");
        assert!(exact.measurement.rows > 0.0 && exact.measurement.multiply_adds > 0.0, "{name}");
        let timing = &exact.measurement.timing;
        assert!(0.0 < timing.push_us.mean && timing.push_us.mean < timing.push_predict_us.mean, "{name}");
    }
    assert!(report.summary.contains("force-graph has a mean squared error of"), "{}", report.summary);
    assert!(report.summary.contains("within 5 % more nothing is faster"), "{}", report.summary);
}

/// Forces at the end of each frame of every recording, from every second frame that is counted
/// event by event.
fn every_second(path: &Path, network: &str) -> Vec<f32> {
    let description = FrameDescription::shipped(network).expect("a network");
    let parts = description.network_parts(&Weights::shipped(network).expect("weights")).expect("they fit");
    let built = FrameNetwork::new(parts, Convolution::Direct).expect("it is built");
    let streams = Streams::read(path).expect("streams");
    let force_of = |part: &&[meissner_engine::Event]| {
        let mut engine = FrameEngine::new(built.clone()).expect("an engine");
        let mut last = 0.0;
        let force = |frame: i64| {
            if frame % 2 == 0 {
                let mut counts = vec![0.0_f32; 2 * 115 * 115];
                for event in part.iter().filter(|event| event.t_us / PERIOD_US == frame) {
                    let pixel = usize::from(event.y) * 115 + usize::from(event.x);
                    counts[usize::from(event.on) * 115 * 115 + pixel] += 1.0 / 8.0;
                }
                engine.push(&counts).expect("a frame");
                last = engine.predict().expect("a force").values[0];
            }
            last
        };
        (0..FRAMES as i64).map(force).collect::<Vec<f32>>()
    };
    streams.parts().iter().flat_map(force_of).collect()
}

#[test]
fn every_second_frame_is_the_only_one_that_the_network_sees() {
    let (_folder, path) = simulated();
    let streams = Streams::read(&path).expect("streams");
    let truth = streams.truth.as_ref().expect("labels");
    for network in ["force-tdnn", "force-lstm"] {
        let report = studied(&path, &[network], &["every 2nd frame"], 2).expect("it is measured");
        let found = setting(&report, 0, "every 2nd frame");
        let times =
            (0..RECORDINGS).flat_map(|number| (1..=FRAMES as i64).map(move |i| (number, i * PERIOD_US)));
        let errors = every_second(&path, network).into_iter().zip(times).map(|(force, (number, t_us))| {
            f64::from(force) - truth.at("force", number, truth.span_us(number)[0] + t_us).expect("a force")
        });
        let squares: Vec<f64> = errors.map(|error| error * error).collect();
        let expected = MeanStd::of(&squares).expect("frames").mean;
        assert!(
            (found.error - expected).abs() < 1e-6 * expected.max(1.0),
            "{network}: {} {expected}",
            found.error
        );
        // 21 of 41 frames.
        assert!((found.measurement.entered - 21.0 / 41.0).abs() < 1e-12, "{network}");
        let has_note = report.notes.iter().any(|note| note.contains("no pixel that a tolerance could keep"));
        assert_eq!(has_note, network == "force-tdnn", "the other one has a pooling: {:?}", report.notes);
    }
}

#[test]
fn settings_of_both_kinds_change_the_forces_and_threads_change_no_error() {
    let (_folder, path) = simulated();
    let networks = ["force-graph", "force-cnnlstm"];
    let only = ["neighbours 4", "stride 8", "stale 20", "tolerance 0.1", "activity filter", "every"];
    let report = studied(&path, &networks, &only, 1).expect("it is measured");
    for network in &report.networks {
        for setting in &network.settings[1..] {
            assert!(setting.measurement.numerical.max > 0.0, "{}, {}", network.network, setting.setting);
        }
    }
    let exact = &setting(&report, 0, "exact").measurement;
    let stride = &setting(&report, 0, "stride 8").measurement;
    assert!((stride.entered - 0.125).abs() < 0.01 && stride.rows < 0.2 * exact.rows, "{}", stride.entered);
    let few = &setting(&report, 0, "neighbours 4").measurement;
    assert!(few.multiply_adds < exact.multiply_adds && few.rows == exact.rows);
    let stale = &setting(&report, 0, "stale 20 ms").measurement;
    assert!(stale.rows == exact.rows && stale.multiply_adds < exact.multiply_adds);
    let errors = |report: &Report| -> Vec<_> {
        let settings = report.networks.iter().flat_map(|network| &network.settings);
        settings
            .map(|setting| (setting.measurement.task.clone(), setting.measurement.numerical.clone()))
            .collect()
    };
    assert_eq!(errors(&report), errors(&studied(&path, &networks, &only, 3).expect("it is measured")));
}

#[test]
fn silent_recordings_are_measured_and_short_ones_have_no_frames() {
    // Three frames, none, and two.
    let (_folder, path) = silent(&[30_000, 9_999, 20_000]);
    let names = ["force-graph", "force-tdnn"];
    let report = studied(&path, &names, &["exact", "stride 2", "rate limit mean", "every"], 2)
        .expect("it is measured");
    for (network, name) in names.iter().enumerate() {
        for setting in &report.networks[network].settings {
            let task = &setting.measurement.task;
            assert_eq!([task[0].trials, task[1].trials], [5; 2], "{name}, {}", setting.setting);
            assert!(setting.error.is_finite() && setting.us.is_finite(), "{name}, {}", setting.setting);
        }
        assert_eq!(setting(&report, network, "exact").error, evaluated(&path, name).parts[0].mse.mean);
    }
    let graph = &report.networks[0].settings;
    assert!(
        graph.len() > 1 && graph.iter().all(|setting| setting.error == graph[0].error),
        "no event, no filter"
    );

    let (_folder, path) = silent(&[9_999]);
    let error = studied(&path, &["force-tdnn"], &[], 1).expect_err("there is no frame").to_string();
    assert!(error.contains("recordings that last for a frame of 10000 us"), "{error}");
    let (_folder, path) = silent(&[30_000]);
    let report = studied(&path, &["force-tdnn"], &["exact"], 1).expect("it is measured");
    assert_eq!(setting(&report, 0, "exact").interval_95, None, "one recording says nothing about others");
}

#[test]
fn networks_of_other_quantities_are_refused() {
    let (_folder, path) = silent(&[30_000]);
    let error = studied(&path, &["tactigraph-past"], &[], 1).expect_err("it predicts angles").to_string();
    assert!(error.contains("which predicts roll, pitch"), "{error}");
}
