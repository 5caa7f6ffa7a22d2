//! Time against error along a recording and over a data set of slips.

use meissner_engine::filters::{EventFilter, Stride};
use meissner_engine::{Engine, Event, Outcome, StaleReadout, Staleness};
use meissner_models::{Description, Weights};
use serde_json::Value;
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, default_recording, meissner, message, object, text, written};

/// Number of timed events.
const TIMED: usize = 600;

/// The JSON object of a successful run.
pub(crate) fn report(arguments: &[&str]) -> Value {
    object(&meissner(&[&["pareto"], arguments, &["--json"]].concat()))
}

/// Settings of the network at `place`.
pub(crate) fn settings(report: &Value, place: usize) -> &[Value] {
    report["networks"][place]["settings"].as_array().expect("a list of settings")
}

/// The setting with this name.
pub(crate) fn setting<'a>(report: &'a Value, place: usize, name: &str) -> &'a Value {
    let found = settings(report, place).iter().find(|setting| setting["setting"] == name);
    found.unwrap_or_else(|| panic!("{name}: {report}"))
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, found {value}"))
}

/// The parts that do not depend on a clock.
pub(crate) fn errors(report: &Value) -> Vec<Value> {
    let of = |setting: &Value| {
        ["setting", "numerical", "task", "error", "interval_95", "rows", "multiply_adds", "entered"]
            .map(|key| setting[key].clone())
    };
    let networks = report["networks"].as_array().expect("a list of networks");
    let settings = networks.iter().flat_map(|network| network["settings"].as_array().expect("a list"));
    settings.map(|setting| Value::from(of(setting).to_vec())).collect()
}

/// Asserts that the front contains exactly the settings that no other of `group` beats.
pub(crate) fn is_a_front(group: &[&Value]) {
    let point = |setting: &Value| (number(&setting["us"]), number(&setting["error"]));
    for setting in group {
        let (time, error) = point(setting);
        let beaten = group.iter().map(|other| point(other)).any(|(other_time, other_error)| {
            other_time <= time && other_error <= error && (other_time < time || other_error < error)
        });
        assert_eq!(setting["on_front"], !beaten, "{setting}");
    }
    assert!(group.iter().any(|setting| setting["on_front"] == true));
}

/// Arguments of a short run over the embedded recording, for the settings with these names.
fn angle(only: &[&str], more: &[&str]) -> Vec<String> {
    let recording = default_recording();
    let mut arguments = vec!["angle", argument(&recording)];
    let timed = TIMED.to_string();
    for few in [["--timed-events", &timed], ["--repeat", "1"]] {
        if !more.contains(&few[0]) {
            arguments.extend(few);
        }
    }
    only.iter().for_each(|name| arguments.extend(["--only", name]));
    arguments.iter().chain(more).map(|&argument| argument.to_owned()).collect()
}

fn run(only: &[&str], more: &[&str]) -> Value {
    let arguments = angle(only, more);
    report(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

fn engine(network: &str) -> (Engine, Vec<Event>) {
    let recording = meissner_io::read(&default_recording()).expect("it is in the repository");
    let weights = Weights::shipped(network).expect("shipped");
    let description = Description::shipped(network).expect("shipped");
    let engine =
        Engine::new(description.network(&weights).expect("they fit"), recording.sensor.expect("named"));
    (engine.expect("it fits"), recording.events[..TIMED].to_vec())
}

/// Largest and root mean square difference of two lists of predictions.
fn differences(exact: &[Vec<f32>], found: &[Vec<f32>]) -> (f64, f64) {
    let all: Vec<f64> = exact
        .iter()
        .flatten()
        .zip(found.iter().flatten())
        .map(|(&exact, &found)| (f64::from(found) - f64::from(exact)).abs())
        .collect();
    let squares: f64 = all.iter().map(|difference| difference * difference).sum();
    (all.iter().copied().fold(0.0, f64::max), (squares / all.len() as f64).sqrt())
}

#[test]
fn the_exact_setting_has_no_error_and_others_are_compared_with_it_at_every_event() {
    let names = ["exact", "stride 4", "stale 5 ms", "tolerance 0.01"];
    let report = run(&names, &["--network", "graphres"]);
    assert_eq!((&report["system"], &report["compared"]), (&"angle".into(), &"relative_rms".into()));
    let exact = setting(&report, 0, "exact");
    assert_eq!((number(&exact["numerical"]["max"]), number(&exact["error"])), (0.0, 0.0));
    assert_eq!(number(&exact["speed_up"]), 1.0);
    assert!(number(&setting(&report, 0, "tolerance 0.01")["error"]) > 0.0);

    // Each setting again, by engines alone.
    let (engine, events) = engine("graphres");
    let mut exact = engine.clone();
    let mut filter = Stride::new(4).expect("above 0");
    let mut thinned = engine.clone();
    let bound = Staleness::new().with_us(5000);
    let mut stale = StaleReadout::new(engine, bound).expect("in range");
    let mut said = [vec![], vec![], vec![]];
    let mut last = thinned.predict().expect("numbers").values.to_vec();
    for &event in &events {
        assert_eq!(exact.push(event), Outcome::Accepted);
        said[0].push(exact.predict().expect("numbers").values.to_vec());
        if filter.admit(event) {
            thinned.push(event);
            last = thinned.predict().expect("numbers").values.to_vec();
        }
        said[1].push(last.clone());
        stale.push(event);
        said[2].push(stale.predict().expect("numbers").values.to_vec());
    }
    for (name, found) in [("stride 4", &said[1]), ("stale 5 ms", &said[2])] {
        let numerical = &setting(&report, 0, name)["numerical"];
        let (max, rms) = differences(&said[0], found);
        assert!(max > 0.0 && (number(&numerical["max"]) / max - 1.0).abs() < 1e-9, "{name}: {numerical}");
        assert!((number(&numerical["rms"]) / rms - 1.0).abs() < 1e-9, "{name}: {numerical}");
        for tenth in 0..10 {
            let part = tenth * TIMED / 10..(tenth + 1) * TIMED / 10;
            let (max, rms) = differences(&said[0][part.clone()], &found[part]);
            assert!((number(&numerical["max_by_tenth"][tenth]) - max).abs() <= 1e-9 * max, "{name} {tenth}");
            assert!((number(&numerical["rms_by_tenth"][tenth]) - rms).abs() <= 1e-9 * rms, "{name} {tenth}");
        }
    }
    assert_eq!(number(&setting(&report, 0, "stride 4")["entered"]), 0.25);
}

#[test]
fn every_setting_of_a_network_is_measured_and_the_front_is_what_nothing_beats() {
    let report = run(
        &[],
        &["--network", "tactigraph-past", "--network", "tactigraph-frozen", "--timed-events", "300"],
    );
    for place in 0..2 {
        let settings = settings(&report, place);
        assert!(settings.len() > 20 && settings[0]["setting"] == "exact");
        is_a_front(&settings.iter().collect::<Vec<_>>());
        for setting in settings {
            assert!(number(&setting["push_us"]["mean"]) <= number(&setting["push_predict_us"]["mean"]));
            assert_eq!((&setting["timed"], &setting["task"]), (&300.into(), &Value::Array(vec![])));
        }
    }
    let words = report["words"].as_str().expect("a paragraph");
    assert!(
        words.contains("tactigraph-past against its exact outputs: within 0.001 of their RMS"),
        "{words}"
    );
    for fastest in report["fastest_within"].as_array().expect("a list") {
        assert!(number(&fastest["error"]) <= number(&fastest["within"]) + 1e-9, "{fastest}");
    }
    assert_eq!(report["fastest_within"].as_array().map(Vec::len), Some(6), "three for each network");
}

/// A folder, and `--state` with a file in it.
fn state() -> (TempDir, String) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = argument(&folder.path().join("state.jsonl")).to_owned();
    (folder, path)
}

fn lines(path: &str) -> Vec<String> {
    let text = std::fs::read_to_string(path).expect("it was written");
    assert!(text.is_empty() || text.ends_with('\n'), "every line is whole");
    text.lines().map(str::to_owned).collect()
}

#[test]
fn a_setting_that_was_measured_is_not_measured_again() {
    let (_folder, path) = state();
    let past = ["--network", "tactigraph-past", "--state", &path];
    let first = run(&["stride 2"], &past);
    let kept = lines(&path);
    // exact, stride 2, and the settings that contain stride 2.
    assert_eq!(kept.len(), settings(&first, 0).len());
    // Times could not be equal if anything were measured again.
    assert_eq!(run(&["stride 2"], &past), first);
    assert_eq!(lines(&path), kept);
    let more = run(&["stride 2", "stride 4"], &past);
    assert_eq!(setting(&more, 0, "stride 2")["push_us"], setting(&first, 0, "stride 2")["push_us"]);
    assert_eq!(lines(&path)[..kept.len()], kept);
    assert!(lines(&path).len() > kept.len(), "stride 4 was not there");
}

#[test]
fn what_is_another_measurement_is_measured() {
    let (_folder, path) = state();
    let measurements = [
        &["--network", "tactigraph-past"][..],
        &["--network", "tactigraph-past", "--repeat", "2"],
        &["--network", "tactigraph-past", "--timed-events", "1000"],
        &["--network", "tactigraph-past", "--from", "50ms"],
        &["--network", "tactigraph-frozen"],
    ];
    for (count, more) in (1..).zip(measurements) {
        run(&["exact"], &[more, &["--state", &path]].concat());
        assert_eq!(lines(&path).len(), count, "{more:?}");
    }
}

#[test]
fn a_last_line_that_was_not_finished_is_measured_again_and_no_other() {
    let (_folder, path) = state();
    let past = ["--network", "tactigraph-past", "--state", &path];
    let first = run(&["stride 8"], &past);
    let whole = std::fs::read_to_string(&path).expect("it was written");
    std::fs::write(&path, &whole[..whole.len() - 20]).expect("it can be written");
    let second = run(&["stride 8"], &past);
    assert_eq!(errors(&second), errors(&first));
    assert_eq!(setting(&second, 0, "exact")["push_us"], setting(&first, 0, "exact")["push_us"]);
    assert_eq!(lines(&path).len(), whole.lines().count());
}

#[test]
fn a_line_that_cannot_be_read_is_named_with_its_number() {
    let (_folder, path) = state();
    let past = ["--network", "tactigraph-past", "--state", &path];
    run(&["exact"], &past);
    let whole = std::fs::read_to_string(&path).expect("it was written");
    let broken = whole + "{\"key\": 1}\n";
    std::fs::write(&path, &broken).expect("it can be written");
    let arguments = angle(&["exact"], &past);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    fails(
        &meissner(&[&["pareto"], &arguments[..]].concat()),
        1,
        &["state.jsonl", "line 2", "a finished measurement"],
    );
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), broken, "it stays as it was");
}

#[test]
fn the_drawing_names_the_front_and_the_table_has_every_setting() {
    let (folder, _) = state();
    let [svg, csv, json] = ["a.svg", "a.csv", "a.json"].map(|name| folder.path().join(name));
    let files = ["--svg", argument(&svg), "--csv", argument(&csv), "--out", argument(&json)];
    let arguments = angle(&["stride", "stale"], &[&["--network", "tactigraph-past"], &files[..]].concat());
    let output =
        meissner(&[&["pareto"], &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let report = written(&json);
    let svg = std::fs::read_to_string(svg).expect("it was written");
    let document = roxmltree::Document::parse(&svg).expect("it is well-formed XML");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for expected in
        ["Run time against error: angle", "time per event (us)", "relative RMS error", "tactigraph-past"]
    {
        assert!(texts.contains(&expected), "{expected}: {texts:?}");
    }
    let text = text(&output);
    let csv = std::fs::read_to_string(csv).expect("it was written");
    for setting in settings(&report, 0) {
        let name = setting["setting"].as_str().expect("a name");
        assert!(text.contains(&format!("  {name} ")), "{name}: {text}");
        assert!(
            csv.contains(&format!("angle,tactigraph-past,{name},{},", setting["on_front"])),
            "{name}: {csv}"
        );
        assert_eq!(texts.contains(&name), setting["on_front"] == true, "{name}: {texts:?}");
        let title = format!("tactigraph-past, {name}: ");
        assert!(texts.iter().any(|text| text.starts_with(&title)), "{name}: {texts:?}");
    }
    let columns = csv.lines().next().expect("a heading").split(',').count();
    assert!(csv.lines().all(|line| line.split(',').count() == columns), "{csv}");
    let words = crate::support::words(&output);
    assert!(words.contains("* on the front"), "{text}");
    assert!(words.contains(report["words"].as_str().expect("words")), "{text}");
}

#[test]
fn what_cannot_be_measured_is_bad_input_or_bad_usage() {
    let pareto = |only: &[&str], more: &[&str]| {
        let arguments = angle(only, more);
        meissner(&[&["pareto"], &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..]].concat())
    };
    fails(&pareto(&["stride 3"], &[]), 2, &["--only", "stride 2", "stride 3"]);
    fails(&pareto(&[], &["--network", "slip-lstm"]), 1, &["slip-lstm", "a network over events"]);
    fails(&pareto(&[], &["--network", "graphres-published"]), 1, &["graphres-published"]);
    fails(&pareto(&[], &["--network", "graphres", "--network", "graphres"]), 2, &["each network once"]);
    let two = ["--network", "graphres", "--network", "tactigraph", "--weights", "w"];
    fails(&pareto(&[], &two), 2, &["--weights", "one --network"]);
    fails(&pareto(&[], &["--from", "100000s"]), 2, &["events to measure", "none"]);
    fails(&pareto(&[], &["--csv", "no/such/a.csv"]), 1, &["no/such/a.csv"]);
    fails(&pareto(&[], &["--state", "no/such/state"]), 1, &["no/such/state"]);
}

mod slip {
    //! Time against error over a data set of slips.

    use serde_json::Value;

    use super::{errors, is_a_front, number, report, setting, settings};
    use crate::data::slip;
    use crate::data::slip::SlipFolder;
    use crate::eval_slip;
    use crate::support::argument;

    fn run(data: &SlipFolder, more: &[&str]) -> Value {
        let few = ["--timed-events", "4", "--repeat", "1"];
        report(&[&["slip", argument(data.path())], &few[..], more].concat())
    }

    #[test]
    fn the_exact_setting_is_wrong_where_the_evaluation_says_so_on_objects_that_are_unseen() {
        let data = SlipFolder::new();
        for network in ["slip-lstm", "slip-regularised"] {
            let report = run(&data, &["--network", network]);
            let judged = eval_slip::report(&[argument(data.path()), "--network", network]);
            let exact = setting(&report, 0, "exact");
            assert_eq!((number(&exact["numerical"]["max"]), &report["unit"]), (0.0, &"window".into()));
            let (mut wrong, mut all) = (0.0, 0.0);
            for (i, set) in ["Solids", "Small", "Textures"].iter().enumerate() {
                let (task, judged) = (&exact["task"][i + 1], &judged["networks"][0]["sets"][i + 1]);
                assert_eq!((&task["of"], &judged["set"]), (&(*set).into(), &(*set).into()));
                let accuracy = number(&judged["accuracy"]["mean"]);
                assert!((number(&task["error"]) - (1.0 - accuracy)).abs() < 1e-12, "{task} {judged}");
                assert_eq!(task["trials"], judged["windows"]);
                wrong += number(&task["error"]) * number(&task["trials"]);
                all += number(&task["trials"]);
            }
            let unseen = &exact["task"][0];
            assert_eq!((&unseen["of"], number(&unseen["trials"])), (&"unseen".into(), all));
            assert!((number(&unseen["error"]) - wrong / all).abs() < 1e-12);
            assert_eq!(exact["error"], unseen["error"]);
            is_a_front(&settings(&report, 0).iter().collect::<Vec<_>>());
        }
    }

    #[test]
    fn approximations_of_frame_networks_are_measured_and_what_cannot_be_is_said() {
        let data = SlipFolder::new();
        let report = run(&data, &["--network", "slip-regularised"]);
        for name in ["steps 4 of 5", "steps 3 of 5", "steps 2 of 5"] {
            let setting = setting(&report, 0, name);
            assert!(number(&setting["numerical"]["rms"]) > 0.0, "{setting}");
        }
        let products = |name: &str| number(&setting(&report, 0, name)["multiply_adds"]);
        assert!(
            products("steps 2 of 5") < products("steps 4 of 5")
                && products("steps 4 of 5") < products("exact")
        );
        let notes = report["notes"].to_string();
        assert!(notes.contains("slip-regularised: no 3 x 3 convolution outside recurrent layers"), "{notes}");
        assert!(notes.contains("slip-regularised: no pixel that a tolerance could keep"), "{notes}");
    }

    #[test]
    fn errors_are_equal_at_any_number_of_threads() {
        let data = SlipFolder::new();
        let run = |threads: &str| {
            errors(&run(&data, &["--network", "slip-lstm", "--network", "slip-best", "--threads", threads]))
        };
        let one = run("1");
        assert!(one.len() == 2 * 4 && one == run("2") && one == run("3"));
    }

    #[test]
    fn several_trainings_count_alike_and_folds_are_passed_over() {
        let data = SlipFolder::new();
        let runs = tempfile::tempdir().expect("there is a place for temporary files");
        for seed in [1_u64, 2] {
            let number = seed.to_string();
            let metadata = [("network", "slip-lstm"), ("seed", number.as_str()), ("trained_on", "Basic")];
            let weights = slip::drawn("slip-lstm", seed);
            slip::training(runs.path(), &format!("{seed}.safetensors"), &weights, &metadata);
            let fold = [&metadata[..], &[("held_out", "[\"n/case1\"]")]].concat();
            slip::training(runs.path(), &format!("fold{seed}.safetensors"), &weights, &fold);
        }
        let trainings = ["--network", "slip-lstm", "--trainings", argument(runs.path())];
        let report = run(&data, &[&trainings[..], &["--only", "exact"]].concat());
        let judged = eval_slip::report(&[&[argument(data.path())], &trainings[..]].concat());
        let task = &setting(&report, 0, "exact")["task"][1];
        let accuracy = number(&judged["networks"][0]["sets"][1]["accuracy"]["mean"]);
        assert!((number(&task["error"]) - (1.0 - accuracy)).abs() < 1e-12, "{task}");
        assert_eq!(task["trainings"], 2);
        assert!(report["notes"].to_string().contains("2 folds are passed over"), "{}", report["notes"]);
    }
}
