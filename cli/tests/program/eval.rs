//! Networks judged on presses, on forces and on touch.

use meissner_models::{AnyDescription, Description, TensorFile, Weights, draw};
use safetensors::SafeTensors;

use crate::data::touch_folder;
use crate::exit_status::fails;
use crate::support::{argument, file, meissner, message, object, text, words, written};

/// Two presses of a few markers that move outwards from 10 ms on.
pub(crate) fn tracks(labels: &[&str]) -> Vec<u8> {
    let mut file = TensorFile::new([].into());
    let t_us = [0, 10_000, 40_000];
    file.i64("t_us", &[6], &[t_us, t_us].concat());
    file.i64("start", &[3], &[0, 3, 6]);
    let mut positions = Vec::new();
    for press in 0..2 {
        for moved in [0.0, 0.0, 6.0 + press as f32] {
            positions.extend([[100.0 - moved, 80.0], [200.0 + moved, 150.0], [150.0, 200.0 + moved]]);
        }
    }
    file.f32("position", &[6, 3, 2], &positions.concat());
    for &label in labels {
        let values = if label == "depth" { [0.0, 0.0, 3.0] } else { [0.02; 3] };
        file.f32(label, &[6], &[values, values].concat());
    }
    file.into_bytes()
}

#[test]
fn weights_are_told_what_the_windows_of_their_training_were_like() {
    let (folder, tracks) = file("tracks.safetensors", tracks(&["roll", "pitch", "depth"]));
    let [events, known] = ["events.safetensors", "known.safetensors"].map(|name| folder.path().join(name));
    let simulate =
        ["simulate", "markers", argument(&tracks), "--sensor", "346x260", "--out", argument(&events)];
    assert!(meissner(&simulate).status.success());
    let prepare = ["prepare", "windows", argument(&events), "--network", "tactigraph-past", "--out"];
    let few = meissner(&[&prepare[..], &[argument(&known), "--ages", "3"]].concat());
    fails(&few, 2, &["EVENTS: expected streams of at least 20 windows with events, found 8"]);
    let output = meissner(&[&prepare[..], &[argument(&known), "--ages", "20", "--youngest", "0.5"]].concat());
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("what 42 windows were like"), "{}", text(&output));
    let doubts = |weights: &[&str]| {
        let json = folder.path().join("report.json");
        let eval =
            ["eval", "angle", argument(&events), "--network", "tactigraph-past", "--out", argument(&json)];
        let output = meissner(&[&eval[..], weights].concat());
        assert!(output.status.success(), "{}", message(&output));
        assert!(text(&output).contains("windows unlike the training"), "{}", text(&output));
        written(&json)["networks"][0]["figures"]["doubts"].clone()
    };
    let [own, shipped] = [&["--weights", argument(&known)][..], &[]].map(doubts);
    assert_eq!((&own["ends"], &own["ends_unlike"]), (&2.into(), &0.into()), "{own}");
    assert_eq!((&shipped["ends"], &shipped["ends_unlike"]), (&2.into(), &2.into()), "{shipped}");

    // The values stay the same; the shipped weights were trained on a dome, and three markers are
    // not a dome.
    let line = |weights: &[&str]| {
        let run = ["run", "--limit", "500", "--every", "end", "--json"];
        let output = meissner(&[&run[..], weights].concat());
        let lines: Vec<serde_json::Value> =
            text(&output).lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
        (lines[1].clone(), lines[2].clone())
    };
    let ((of_own, summary), (of_shipped, _)) = (line(&["--weights", argument(&known)]), line(&[]));
    assert_eq!(of_own["value"], of_shipped["value"]);
    assert!(of_own["unlike"].as_f64().is_some_and(|unlike| unlike > 1.0), "{of_own}");
    assert_ne!(of_own["unlike"], of_shipped["unlike"]);
    assert_eq!(summary["summary"]["unlike_training"], 1, "{summary}");
}

#[test]
fn presses_are_simulated_and_judged_with_errors_over_time_as_text_json_and_picture() {
    let (folder, tracks) = file("tracks.safetensors", tracks(&["roll", "pitch", "depth"]));
    let [events, svg, json] =
        ["events.safetensors", "angle.svg", "angle.json"].map(|name| folder.path().join(name));
    let simulate =
        ["simulate", "markers", argument(&tracks), "--sensor", "346x260", "--out", argument(&events)];
    assert!(meissner(&simulate).status.success());
    let arguments = ["eval", "angle", argument(&events), "--every", "5ms", "--svg", argument(&svg)];
    let output = meissner(&[&arguments[..], &["--out", argument(&json)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let said = words(&output);
    for expected in
        ["2 presses", "tactigraph-past, roll deg", "tactigraph-past, all angles deg", "ms since contact"]
    {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(text(&output).lines().all(|line| line.chars().count() <= 80), "{}", text(&output));
    let picture = std::fs::read_to_string(&svg).expect("it was written");
    assert!(
        roxmltree::Document::parse(&picture).is_ok() && picture.contains("Mean absolute error against time")
    );

    let report = written(&json);
    assert_eq!(report["header"]["command"], "eval angle");
    assert_eq!(report["data"]["labels"], serde_json::json!(["depth", "pitch", "roll"]));
    assert_eq!(report["times_us"], serde_json::json!([0, 5_000, 10_000, 15_000, 20_000, 25_000, 30_000]));
    let network = &report["networks"][0];
    let figures = &network["figures"];
    assert_eq!((&network["network"]["name"], &figures["presses"]), (&"tactigraph-past".into(), &2.into()));
    for output in figures["outputs"].as_array().expect("a list") {
        assert_eq!(
            (&output["unit"], output["mean_absolute_at"].as_array().map(Vec::len)),
            (&"deg".into(), Some(7))
        );
        assert_eq!(output["mean_absolute_at"][6], output["mean_absolute"]);
    }
    assert!(figures["work"]["multiply_adds"].as_u64() > Some(0));
    let pairs = network["pairs"].as_array().expect("a list of each output");
    assert!(pairs.len() == 2 && pairs.iter().all(|of| of.as_array().map(Vec::len) == Some(2)), "{pairs:?}");
}

#[test]
fn presses_that_do_not_fit_are_refused_by_name() {
    let (folder, tracks) = file("tracks.safetensors", tracks(&["depth"]));
    let events = folder.path().join("events.safetensors");
    let simulate =
        ["simulate", "markers", argument(&tracks), "--sensor", "346x260", "--out", argument(&events)];
    assert!(meissner(&simulate).status.success());
    let judge = |more: &[&str]| meissner(&[&["eval", "angle", argument(&events)], more].concat());
    fails(&judge(&[]), 2, &["labels of the file: depth", "found tactigraph-past, which predicts roll"]);
    fails(&judge(&["--network", "slip-lstm"]), 2, &["slip-lstm, which predicts classes"]);
    fails(&judge(&["--every", "1us"]), 2, &["expected a time from 100us to 10s"]);
    let output = meissner(&["eval", "angle", argument(&tracks)]);
    fails(&output, 1, &["tracks.safetensors", "metadata sensor"]);
}

const NETWORK: &str = "force-tdnn";

#[test]
fn grasps_are_simulated_and_judged_by_phase_and_size_as_text_json_and_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let [events, svg, json] =
        ["grasps.safetensors", "force.svg", "force.json"].map(|name| folder.path().join(name));
    let simulate = ["simulate", "grasp", "--recordings", "3", "--seed", "6", "--out", argument(&events)];
    let output = meissner(&simulate);
    assert!(output.status.success() && text(&output).contains("events of 3 streams"), "{}", message(&output));
    let arguments = ["eval", "force", argument(&events), "--network", NETWORK, "--svg", argument(&svg)];
    let output = meissner(&[&arguments[..], &["--out", argument(&json)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let said = words(&output);
    for expected in [
        "3 recordings",
        "force-tdnn, all 123",
        "force-tdnn, holding",
        "force-tdnn, 16 mm 41",
        "DTW",
        "contact",
        "the paper",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(text(&output).lines().all(|line| line.chars().count() <= 80), "{}", text(&output));
    let picture = std::fs::read_to_string(&svg).expect("it was written");
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("force-tdnn, recording 2"));
    let report = written(&json);
    assert_eq!(report["header"]["command"], "eval force");
    let figures = &report["networks"][0]["figures"];
    assert_eq!(figures["parts"].as_array().map(Vec::len), Some(7));
    assert!(figures["parts"][0]["mse"]["mean"].as_f64() > Some(0.0));
    // A pair for each frame, in the order of the truth.
    let pairs = report["networks"][0]["pairs"].as_array().expect("a list");
    assert!(pairs.len() == 123 && pairs.is_sorted_by_key(|pair| pair[0].as_f64()), "{pairs:?}");
    let page = folder.path().join("force.html");
    assert!(meissner(&["report", argument(&json), "--out", argument(&page)]).status.success());
    let page = std::fs::read_to_string(&page).expect("it was written");
    for expected in
        ["always to say the mean force has", "force-tdnn, holding", "predicted (N)", "Bhattacharyya"]
    {
        assert!(page.contains(expected), "{expected}: {page}");
    }

    // Leave-one-out: each training has not seen the recordings that it names, and together they
    // name each one once.
    let trainings = folder.path().join("trainings");
    std::fs::create_dir(&trainings).expect("a folder");
    let description = AnyDescription::shipped(NETWORK).expect("shipped");
    let train = |file: &str, held_out: &str| {
        let remarks = [("network", NETWORK), ("seed", "0"), ("trained", "true"), ("held_out", held_out)];
        let remarks = remarks.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let weights: Weights = draw(&description, 3);
        std::fs::write(trainings.join(file), weights.to_safetensors(&remarks)).expect("it is written");
    };
    train("a.safetensors", "[\"0\", \"2\"]");
    train("b.safetensors", "[\"1\"]");
    let arguments = ["eval", "force", argument(&events), "--trainings", argument(&trainings)];
    let output = meissner(&arguments);
    assert!(output.status.success(), "{}", message(&output));
    assert!(words(&output).contains("2 folds of cross-validations"), "{}", text(&output));
    train("b.safetensors", "[\"2\"]");
    fails(&meissner(&arguments), 1, &["hold out different recordings", "b.safetensors"]);
}

#[test]
fn a_time_between_predictions_that_does_not_divide_a_frame_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let events = folder.path().join("grasps.safetensors");
    let output = meissner(&["eval", "force", argument(&events), "--every", "3ms"]);
    fails(&output, 2, &["divides 10000 us", "3000 us"]);
}

const CLASSES: usize = 20;

#[test]
fn each_set_is_prepared_with_its_own_sensor_and_classes() {
    let data = touch_folder(CLASSES);
    let out = data.path().join("out.safetensors");
    let of = |set: &str, folds: &str| {
        let more = ["--folds", folds, "--out", argument(&out), "--force"];
        meissner(&[&["prepare", "touch", set, argument(data.path())], &more[..]].concat())
    };
    let output = of("containers", "2");
    assert!(output.status.success(), "{}", message(&output));
    let bytes = std::fs::read(&out).expect("it was written");
    let (_, header) = SafeTensors::read_metadata(&bytes).expect("a valid file");
    let metadata = header.metadata().as_ref().expect("metadata");
    assert_eq!(metadata["sensor"], "[241,357]");
    let classes: Vec<String> = serde_json::from_str(&metadata["classes"]).expect("a list");
    assert_eq!((classes.len(), classes[19].as_str()), (CLASSES, "19"));
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    // A spike of a training recording and one of a test recording for each class.
    assert_eq!(file.tensor("t_us").expect("times").shape(), [4 * CLASSES]);
    assert_eq!(file.tensor("label").expect("labels").shape(), [2 * CLASSES]);

    let output = of("objects", "2");
    assert!(!output.status.success() && message(&output).contains("Ev-Objects.zip"), "{}", message(&output));
    assert_eq!(of("fruits", "2").status.code(), Some(2));
    assert_eq!(of("containers", "41").status.code(), Some(2), "more folds than recordings");
}

#[test]
fn a_network_is_judged_on_the_set_whose_classes_it_predicts() {
    let data = touch_folder(CLASSES);
    let names: Vec<String> = (0..CLASSES).map(|class| format!("\"{class}\"")).collect();
    let text_of = format!(
        "[network]\nname = \"own\"\nspan_us = 1000000\ncapacity = 64\n\n[graph]\nkind = \"knn\"\nk = 2\n\
         candidates = \"past\"\nlifetime = \"window\"\nscale = 0.3\n\n[[layer]]\nname = \"conv1\"\nkind = \"spline\"\n\
         channels = 4\nkernel = 2\nroot = true\n\n[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [8, 9]\n\n\
         [[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = {CLASSES}\n\n[output]\nclasses = [{}]\n",
        names.join(", ")
    );
    let description = Description::parse(&text_of).expect("consistent");
    let [network, weights] = ["own.toml", "own.safetensors"].map(|file| data.path().join(file));
    std::fs::write(&network, text_of).expect("a temporary file can be written");
    let drawn = draw(&description, 3).to_safetensors(&[].into());
    std::fs::write(&weights, drawn).expect("a temporary file can be written");
    let of = |command: &str, set: &str, more: &[&str]| {
        let own =
            [command, "touch", set, argument(data.path()), "--network", argument(&network), "--weights"];
        meissner(&[&own[..], &[argument(&weights)], more].concat())
    };
    let eval = |set: &str, more: &[&str]| of("eval", set, more);
    let output = eval("containers", &["--every", "20ms", "--json"]);
    let report = object(&output);
    assert_eq!((&report["data"]["train"], &report["data"]["test"]), (&20.into(), &20.into()));
    assert_eq!(report["classes"].as_array().map(Vec::len), Some(CLASSES));
    assert_eq!(report["header"]["command"], "eval touch containers");
    assert_eq!(report["networks"][0]["test"]["recordings"], 20);
    assert!(report["data"]["warnings"].as_array().is_some_and(Vec::is_empty), "every taxel is on the sensor");
    let accuracy = report["networks"][0]["test"]["accuracy"]["mean"].as_f64().expect("a share");
    let output = of("pareto", "containers", &["--only", "exact", "--repeat", "1", "--json"]);
    let report = object(&output);
    assert_eq!(
        (&report["header"]["command"], &report["system"]),
        (&"pareto".into(), &"touch containers".into())
    );
    let wrong = report["networks"][0]["settings"][0]["task"][0]["error"].as_f64().expect("a share");
    assert!((wrong + accuracy - 1.0).abs() < 1e-12, "{report}");

    let table = eval("containers", &[]);
    assert!(text(&table).contains("own, test split"), "{}", text(&table));
    let other = eval("objects", &[]);
    assert!(!other.status.success() && message(&other).contains("network own"), "{}", message(&other));
}
