//! Events of a tactile skin: prepared for training, and judged.

use meissner_models::{Description, draw};
use safetensors::SafeTensors;

use crate::support::{argument, meissner, message, object, text};
use crate::touch_data::touch_folder;

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
