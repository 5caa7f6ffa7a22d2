//! Networks judged on a data set of digits, with one training.

use meissner_engine::Event;
use meissner_evaluate::metrics::wilson_95;
use meissner_models::{Description, Weights};
use serde_json::Value;

use crate::data::{DigitsFolder, RECORDINGS, Runs, Said, TEST, TRAIN, all_said, digits, small};
use crate::exit_status::fails;
use crate::shared_files::shared;
use crate::support::{argument, meissner, message, object, text, written};

/// The JSON object of a successful evaluation.
pub(crate) fn report(arguments: &[&str]) -> Value {
    object(&meissner(&[&["eval", "digits"][..], arguments, &["--json"]].concat()))
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is a number"))
}

/// Indices of the split test among all recordings.
pub(crate) const TESTED: std::ops::Range<usize> = 10 * TRAIN..RECORDINGS;

/// Times at which predictions are read.
pub(crate) fn times() -> usize {
    let length = |events: &[Event]| events[events.len() - 1].t_us - events[0].t_us;
    let longest = digits().iter().map(|digit| length(&digit.events)).max().expect("there are some");
    (longest as usize).div_ceil(10_000)
}

/// Whether the answer for each of the recordings `chosen` is right at the `time`th time; after its
/// end the last answer stands.
pub(crate) fn right(said: &[Said], chosen: &[usize], time: usize) -> Vec<bool> {
    let digits = digits();
    let answer = |i: usize| *said[i].answers.get(time).unwrap_or(&said[i].answers[said[i].answers.len() - 1]);
    chosen.iter().map(|&i| answer(i) == digits[i].class).collect()
}

/// Asserts that figures of one training over `chosen` equal those of the predictions `said`.
pub(crate) fn are_those(one: &Value, said: &[Said], chosen: &[usize]) {
    let count = |time| right(said, chosen, time).iter().filter(|&&right| right).count();
    let n = chosen.len();
    assert_eq!(one["accuracy_at"].as_array().map(Vec::len), Some(times()));
    for time in 0..times() {
        let hits = count(time);
        let (low, high) = wilson_95(hits as u64, n as u64).expect("there are some");
        let found =
            [&one["accuracy_at"][time], &one["interval_95_at"][time][0], &one["interval_95_at"][time][1]];
        for (found, expected) in found.into_iter().zip([hits as f64 / n as f64, low, high]) {
            assert!((number(found) - expected).abs() < 1e-12, "{time}: {found} {expected}");
        }
    }
    assert_eq!(one["accuracy"], one["accuracy_at"][times() - 1]);
    assert_eq!(one["interval_95"], one["interval_95_at"][times() - 1]);
    let digits = digits();
    let mut confusion = vec![vec![0; 10]; 10];
    chosen.iter().for_each(|&i| confusion[digits[i].class][said[i].answers[said[i].answers.len() - 1]] += 1);
    assert_eq!(one["confusion"], serde_json::json!(confusion));
    let mut settled: Vec<i64> = chosen.iter().map(|&i| settled_us(&said[i], digits[i].class)).collect();
    settled.sort_unstable();
    let half = settled[settled.len().div_ceil(2) - 1];
    assert_eq!(one["settled_us"], serde_json::json!((half < i64::MAX).then_some(half)));
}

fn settled_us(said: &Said, truth: usize) -> i64 {
    let times: Vec<i64> = (1..said.answers.len() as i64).map(|i| i * 10_000).chain([said.end_us]).collect();
    let good = |i: &usize| said.answers[*i..].iter().all(|&answer| answer == truth);
    (0..said.answers.len()).find(good).map_or(i64::MAX, |i| times[i])
}

/// A data set, a small network, its weights.
fn judged(changes: &[(&str, &str)], metadata: &[(&str, &str)]) -> (DigitsFolder, Runs, Description, Weights) {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (_, description) = runs.network(&small("own", changes));
    let weights = runs.training("own.safetensors", &description, 5, metadata);
    (data, runs, description, weights)
}

/// Arguments that judge the network of [`judged`].
fn arguments<'a>(data: &'a DigitsFolder, paths: &'a [std::path::PathBuf; 2]) -> Vec<&'a str> {
    vec![argument(data.path()), "--network", argument(&paths[0]), "--weights", argument(&paths[1])]
}

fn paths(runs: &Runs) -> [std::path::PathBuf; 2] {
    ["own.toml", "own.safetensors"].map(|file| runs.path().join(file))
}

#[test]
fn figures_are_those_of_an_engine_for_each_recording_and_time() {
    let frozen = ("lifetime = \"window\"", "lifetime = \"frozen\"");
    let all = ("candidates = \"past\"\nlifetime = \"window\"", "candidates = \"all\"");
    for changes in [&[][..], &[frozen], &[all]] {
        let (data, runs, description, weights) = judged(changes, &[]);
        let report = report(&arguments(&data, &paths(&runs)));
        let network = &report["networks"][0];
        assert_eq!((&network["network"]["name"], &network["stride"]), (&"own".into(), &1.into()));
        assert_eq!(network["cross_validation"], Value::Null);
        let said = all_said(&description, &weights, 1);
        assert!(said.iter().any(|said| said.answers.iter().any(|&answer| answer != said.answers[0])));
        let judged = &network["test"];
        are_those(&judged["each"][0], &said, &TESTED.collect::<Vec<_>>());
        assert_eq!((&judged["recordings"], &judged["trainings"]), (&(10 * TEST).into(), &1.into()));
        assert_eq!(judged["accuracy"]["std"], Value::Null);
        assert_eq!(judged["accuracy"]["mean"], judged["each"][0]["accuracy"]);
        assert_eq!(judged["interval_95"], judged["each"][0]["interval_95"]);
        assert_eq!(judged["settled_us"], judged["each"][0]["settled_us"]);
        let expected: Vec<_> = (1..=times()).map(|i| 10_000 * i).collect();
        assert_eq!(report["times_us"], serde_json::json!(expected));
        assert_eq!((&report["data"]["train"], &report["data"]["test"]), (&20.into(), &10.into()));
    }
}

#[test]
fn a_batch_gives_what_the_engine_gives() {
    for changes in [&[][..], &[("lifetime = \"window\"", "lifetime = \"frozen\"")]] {
        let (data, runs, ..) = judged(changes, &[]);
        let paths = paths(&runs);
        let run = |mode: &str| {
            let logits = runs.path().join(mode);
            let more = ["--mode", mode, "--every", "7ms", "--logits", argument(&logits)];
            let report = report(&[&arguments(&data, &paths)[..], &more].concat());
            assert_eq!(report["mode"], mode);
            (report["networks"].clone(), std::fs::read(&logits).expect("it was written"))
        };
        assert!(run("incremental") == run("batch"));
    }
}

#[test]
fn the_number_of_threads_reaches_no_bit() {
    let (data, runs, ..) = judged(&[], &[]);
    let paths = paths(&runs);
    let run = |threads: &str| {
        let (logits, svg) = (runs.path().join("logits"), runs.path().join("svg"));
        let more = ["--threads", threads, "--logits", argument(&logits), "--svg", argument(&svg), "--json"];
        let output = meissner(&[&["eval", "digits"], &arguments(&data, &paths)[..], &more].concat());
        let mut report = object(&output);
        // The command line contains the number of threads.
        report["header"]["made"]["arguments"] = Value::Null;
        (report, std::fs::read(logits).expect("written"), std::fs::read(svg).expect("written"))
    };
    let one = run("1");
    assert!(one == run("2") && one == run("7"));
}

#[test]
fn logits_are_the_engines_at_the_end_of_the_recordings() {
    let (data, runs, description, weights) = judged(&[], &[]);
    let (paths, logits) = (paths(&runs), runs.path().join("logits"));
    report(&[&arguments(&data, &paths)[..], &["--logits", argument(&logits)]].concat());
    let file = Weights::load(&logits).expect("a valid file");
    let tensor = file.get("own.5").expect("named by network and seed");
    let expected: Vec<u32> = all_said(&description, &weights, 1)
        .into_iter()
        .skip(TESTED.start)
        .flat_map(|said| said.bits)
        .collect();
    let found: Vec<u32> = tensor.values().expect("floats").iter().map(|value| value.to_bits()).collect();
    assert_eq!((tensor.shape(), found), (&[10 * TEST, 10][..], expected));
    let names = |key: &str| serde_json::from_str::<Vec<String>>(&file.metadata()[key]).expect("a list");
    let all: Vec<String> = digits().into_iter().map(|digit| digit.name).collect();
    assert_eq!((names("recordings"), names("test")), (all.clone(), all[TESTED].to_vec()));
}

#[test]
fn the_weights_say_which_events_are_taken_unless_the_command_line_does() {
    let (data, runs, description, weights) = judged(&[], &[("stride", "3")]);
    let paths = paths(&runs);
    for (more, stride) in [(&[][..], 3), (&["--stride", "2"], 2)] {
        let report = report(&[&arguments(&data, &paths)[..], more].concat());
        let network = &report["networks"][0];
        assert_eq!(network["stride"], stride);
        let said = all_said(&description, &weights, stride);
        are_those(&network["test"]["each"][0], &said, &TESTED.collect::<Vec<_>>());
    }
    let output = meissner(&[&["eval", "digits"], &arguments(&data, &paths)[..]].concat());
    assert!(text(&output).contains("one event of 3"), "{}", text(&output));
}

#[test]
fn the_text_shows_figures_at_the_end_and_before() {
    let (data, runs, ..) = judged(&[], &[]);
    let paths = paths(&runs);
    data.write("test/3/10", &[Event::new(9, 1, 1, true), Event::new(5, 2, 2, true)]);
    std::fs::write(data.path().join("README"), "about").expect("written");
    let output = meissner(&[&["eval", "digits"], &arguments(&data, &paths)[..]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let text = text(&output);
    for expected in [
        "31 recordings (20 train, 11 test)",
        "incremental, every 10 ms since the first event, and at the end",
        "1 events are earlier than one before them",
        "1 files are no recordings",
        "own, test split",
        "95 % interval",
        "median settling time (ms)",
        "accuracy (%) after (ms)",
        "\n  20 ",
        "own, test split: true class by row",
        "judged in",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(!text.contains("each seed"), "there is one: {text}");
}

#[test]
fn the_drawing_has_a_line_and_a_matrix_for_each_network() {
    let (data, runs, description, _) = judged(&[], &[]);
    let (other, _) = runs.network(&small("other<", &[]));
    runs.training("other.safetensors", &description, 6, &[("network", "other<")]);
    let (own, svg, json) = (runs.path().join("own.toml"), runs.path().join("svg"), runs.path().join("json"));
    let output = meissner(&[
        "eval",
        "digits",
        argument(data.path()),
        "--network",
        argument(&own),
        "--network",
        argument(&other),
        "--trainings",
        argument(runs.path()),
        "--svg",
        argument(&svg),
        "--out",
        argument(&json),
    ]);
    assert!(output.status.success() && text(&output).contains("other<, test split"), "{}", message(&output));
    let report = written(&json);
    let svg = std::fs::read_to_string(svg).expect("it was written");
    let document = roxmltree::Document::parse(&svg).expect("it is well-formed XML");
    let count = |tag: &str| document.descendants().filter(|node| node.has_tag_name(tag)).count();
    assert_eq!((count("polyline"), count("polygon")), (2, 2));
    assert!(count("rect") > 2 * 100, "two matrices of 100 cells");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for expected in [
        "Accuracy against time, test split",
        "time since the first event (ms)",
        "accuracy (%)",
        "chance",
        "own, test split",
        "other<, test split",
        "predicted",
    ] {
        assert!(texts.contains(&expected), "{expected}: {texts:?}");
    }
    for network in report["networks"].as_array().expect("a list") {
        let accuracy = 100.0 * number(&network["test"]["accuracy"]["mean"]);
        let name = network["network"]["name"].as_str().expect("a name");
        assert!(texts.contains(&format!("{name}, {accuracy:.1} %").as_str()), "{name}: {texts:?}");
    }
    // Every line has a point for each time, inside the field.
    for line in document.descendants().filter(|node| node.has_tag_name("polyline")) {
        let points: Vec<Vec<f64>> = line
            .attribute("points")
            .expect("points")
            .split(' ')
            .map(|point| point.split(',').map(|number| number.parse().expect("a number")).collect())
            .collect();
        assert_eq!(points.len(), times());
        assert!(points.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{points:?}");
        assert!(points.iter().all(|point| (66.0..=396.0).contains(&point[1])), "{points:?}");
    }
}

#[test]
fn what_cannot_be_judged_is_bad_input_or_bad_usage() {
    let (data, runs, description, _) = judged(&[], &[]);
    let paths = paths(&runs);
    let path = argument(data.path());
    let own = arguments(&data, &paths);
    let eval = |arguments: &[&str]| meissner(&[&["eval", "digits"], arguments].concat());
    let network = ["--network", own[2]];
    let other = [&["no/such/folder"], &own[1..]].concat();
    fails(&eval(&other), 1, &["no/such/folder: expected a folder", "train, test"]);
    fails(&eval(&[path, "--network", "tactigraph"]), 1, &["tactigraph", "roll, pitch"]);
    fails(&eval(&[path, "--network", "slip-lstm"]), 1, &["slip-lstm", "a network over events"]);
    fails(&eval(&[path, "--network", "digitless"]), 1, &["digitless", "`meissner networks`"]);
    fails(&eval(&[&[path], &network[..]].concat()), 2, &["own", "--trainings DIR"]);
    fails(&eval(&[&own[..], &network].concat()), 2, &["--network", "each network once"]);
    let (second, _) = runs.network(&small("second", &[]));
    fails(
        &eval(&[&own[..], &["--network", argument(&second)]].concat()),
        2,
        &["one --network", "2 networks"],
    );
    fails(&eval(&[&own[..], &["--svg", "no/such/digits.svg"]].concat()), 1, &["no/such/digits.svg"]);
    runs.training("own.safetensors", &description, 5, &[("held_out", "[\"train/0/9\"]")]);
    fails(&eval(&own), 2, &["--weights", "a whole training", "a fold"]);
    runs.training("own.safetensors", &description, 5, &[("stride", "0")]);
    fails(&eval(&own), 1, &["own.safetensors", "\"stride\" with a whole number from 1"]);
    runs.training("own.safetensors", &description, 5, &[]);
    std::fs::remove_dir_all(data.path().join("test")).expect("it is there");
    fails(&eval(&own), 1, &["recordings of the split test", "found none"]);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shared_digits_are_judged_on_the_split_test() {
    let data = shared("data/nmnist");
    let runs = Runs::new();
    let (_, description) = runs.network(&small("own", &[("span_us = 30000", "span_us = 100000")]));
    runs.training("own.safetensors", &description, 5, &[]);
    let [network, weights] = paths(&runs);
    let arguments =
        [argument(&data), "--network", argument(&network), "--weights", argument(&weights), "--stride", "8"];
    let report = report(&arguments);
    assert_eq!((&report["data"]["train"], &report["data"]["test"]), (&1_000.into(), &100.into()));
    let judged = &report["networks"][0]["test"];
    assert_eq!(judged["recordings"], 100);
    let times = report["times_us"].as_array().map(Vec::len).expect("a list");
    assert!((30..40).contains(&times), "recordings take about 0.3 s: {times}");
    assert_eq!(judged["accuracy_at"][times - 1], judged["accuracy"]);
}
