//! Time against error over a data set of slips.

use serde_json::Value;

use crate::pareto::{errors, is_a_front, number, report, setting, settings};
use crate::slip_data::SlipFolder;
use crate::support::argument;
use crate::{eval_slip, slip_data};

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
        products("steps 2 of 5") < products("steps 4 of 5") && products("steps 4 of 5") < products("exact")
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
        let weights = slip_data::drawn("slip-lstm", seed);
        slip_data::training(runs.path(), &format!("{seed}.safetensors"), &weights, &metadata);
        let fold = [&metadata[..], &[("held_out", "[\"n/case1\"]")]].concat();
        slip_data::training(runs.path(), &format!("fold{seed}.safetensors"), &weights, &fold);
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
