//! The camera model behind `meissner simulate`.

use std::path::Path;

use meissner_models::TensorFile;
use safetensors::SafeTensors;

use crate::exit_status::fails;
use crate::support::{argument, file, meissner, message, object, picture_network, text, written};

/// Two streams: a marker that rests, and one that moves 8 pixels to the right.
fn tracks() -> Vec<u8> {
    let mut file = TensorFile::new([].into());
    file.i64("t_us", &[4], &[0, 50_000, 100, 60_100]);
    file.i64("start", &[3], &[0, 2, 4]);
    file.f32("position", &[4, 1, 2], &[10.0, 8.0, 10.0, 8.0, 6.0, 8.0, 14.0, 8.0]);
    file.into_bytes()
}

fn simulate(tracks: &Path, out: &Path, more: &[&str]) -> std::process::Output {
    let arguments = ["simulate", "markers", argument(tracks), "--sensor", "24x16", "--out", argument(out)];
    meissner(&[&arguments[..], &["--force"], more].concat())
}

fn integers(bytes: &[u8], name: &str) -> Vec<i64> {
    let file = SafeTensors::deserialize(bytes).expect("a valid file");
    let tensor = file.tensor(name).expect("it is there");
    let number = |bytes: &[u8]| i64::from_le_bytes(bytes.try_into().expect("8 bytes"));
    tensor.data().chunks_exact(8).map(number).collect()
}

#[test]
fn markers_become_streams_of_events_that_prepare_graphs_reads() {
    let (folder, tracks) = file("tracks.safetensors", tracks());
    let (out, graphs) = (folder.path().join("events.safetensors"), folder.path().join("graphs.safetensors"));
    let output = simulate(&tracks, &out, &["--ideal"]);
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("events of 2 streams"), "{}", text(&output));
    let bytes = std::fs::read(&out).expect("it was written");
    let (start, t_us) = (integers(&bytes, "start"), integers(&bytes, "t_us"));
    // The marker that rests causes nothing, and without noise there is nothing else.
    assert_eq!((start[0], start[1], start[2] as usize), (0, 0, t_us.len()));
    assert!(t_us.len() > 50 && t_us.windows(2).all(|pair| pair[0] <= pair[1]));
    assert!(t_us.iter().all(|t_us| (100..=60_101).contains(t_us)));
    assert!(integers(&bytes, "cause").iter().all(|&cause| cause == 0));
    let arguments =
        ["prepare", "graphs", argument(&out), "--network", "digits-past", "--out", argument(&graphs)];
    assert!(meissner(&arguments).status.success());
}

#[test]
fn labels_along_time_travel_with_the_events() {
    let mut tracks = TensorFile::new([].into());
    tracks.i64("t_us", &[4], &[0, 50_000, 100, 60_100]);
    tracks.i64("start", &[3], &[0, 2, 4]);
    tracks.f32("position", &[4, 1, 2], &[10.0, 8.0, 10.0, 8.0, 6.0, 8.0, 14.0, 8.0]);
    tracks.f32("depth", &[4], &[0.0, 0.0, 0.0, 2.5]);
    // It has another shape: it is not a label along time.
    tracks.f32("pose", &[2], &[7.0; 2]);
    let (folder, tracks) = file("tracks.safetensors", tracks.into_bytes());
    let out = folder.path().join("events.safetensors");
    assert!(simulate(&tracks, &out, &["--ideal"]).status.success());
    let bytes = std::fs::read(&out).expect("it was written");
    assert_eq!(integers(&bytes, "truth.t_us"), [0, 50_000, 100, 60_100]);
    assert_eq!(integers(&bytes, "truth.start"), [0, 2, 4]);
    let written = SafeTensors::deserialize(&bytes).expect("a valid file");
    let depth = written.tensor("truth.depth").expect("it is there");
    assert_eq!(depth.data(), [0.0_f32, 0.0, 0.0, 2.5].map(f32::to_le_bytes).concat());
    assert!(written.tensor("truth.pose").is_err());
    let mut wrong = TensorFile::new([].into());
    wrong.i64("t_us", &[2], &[0, 5]);
    wrong.i64("start", &[2], &[0, 2]);
    wrong.f32("position", &[2, 1, 2], &[0.0; 4]);
    wrong.f32("depth", &[2], &[0.0, f32::NAN]);
    std::fs::write(&tracks, wrong.into_bytes()).expect("it can be written");
    fails(&simulate(&tracks, &out, &[]), 1, &["depth 1: expected a finite number, found NaN"]);
}

#[test]
fn equal_seeds_give_equal_bytes_and_other_seeds_other_noise() {
    let (folder, tracks) = file("tracks.safetensors", tracks());
    let out = folder.path().join("events.safetensors");
    let run = |seed: &str| {
        let output = simulate(&tracks, &out, &["--seed", seed, "--lux", "1", "--shot-hz", "200"]);
        assert!(output.status.success(), "{}", message(&output));
        std::fs::read(&out).expect("it was written")
    };
    let first = run("5");
    assert!(first == run("5") && first != run("6"));
    assert!(integers(&first, "cause").contains(&2), "shot noise is marked");
}

#[test]
fn images_become_a_recording() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    for (i, value) in [40_u8, 80, 160].into_iter().enumerate() {
        let image = [b"P5\n4 3\n255\n".as_slice(), &[value; 12]].concat();
        std::fs::write(folder.path().join(format!("img{i}.pgm")), image).expect("it can be written");
    }
    let out = folder.path().join("out.csv");
    let arguments = ["simulate", "images", argument(folder.path()), "--interval", "10ms", "--ideal"];
    let output = meissner(&[&arguments[..], &["--out", argument(&out)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("events of 3 images, 4x3"), "{}", text(&output));
    // Each pixel becomes four times as bright: ln 4 / 0.2 is 6.9, from a random phase.
    let events = std::fs::read_to_string(&out).expect("it was written");
    let events = events.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).count();
    assert!((12 * 5..=12 * 8).contains(&events), "{events}");
    // The same with their causes.
    let out = folder.path().join("out.safetensors");
    let output = meissner(&[&arguments[..], &["--out", argument(&out)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let bytes = std::fs::read(&out).expect("it was written");
    assert_eq!(integers(&bytes, "cause"), vec![0; events]);
    assert_eq!(integers(&bytes, "start"), [0, events as i64]);
}

#[test]
fn filters_are_judged_by_the_causes_of_events() {
    let mut made = TensorFile::new([("sensor".to_owned(), "[8, 6]".to_owned())].into());
    // A pixel with a recent neighbour, one without; the second stream knows nothing of the first.
    let columns = [
        ("t_us", [0, 100, 200, 300, 310]),
        ("x", [1, 2, 6, 2, 3]),
        ("y", [1, 1, 4, 1, 1]),
        ("on", [1, 1, 0, 1, 0]),
        ("cause", [0, 0, 2, 0, 0]),
    ];
    columns.iter().for_each(|(name, values)| made.i64(name, &[5], values));
    made.i64("start", &[3], &[0, 3, 5]);
    let (_folder, events) = file("events.safetensors", made.into_bytes());
    let judge = |arguments: &[&str]| meissner(&[&["eval", "filters", argument(&events)], arguments].concat());
    let output = judge(&["--activity-filter", "1ms", "--json"]);
    assert!(output.status.success(), "{}", message(&output));
    let report = object(&output);
    assert_eq!(report["header"]["command"], "eval filters");
    assert_eq!((&report["streams"], &report["filters"][0]), (&2.into(), &"activity_filter".into()));
    let counts =
        |i: usize| ["events", "passed"].map(|key| report["causes"][i][key].as_u64().expect("a count"));
    assert_eq!([counts(0), counts(1), counts(2), counts(3)], [[4, 2], [0, 0], [1, 0], [0, 0]]);
    let output = judge(&["--stride", "2"]);
    assert!(
        text(&output).contains("shot noise       1       1    100.00              20.00      33.33"),
        "{}",
        text(&output)
    );
    fails(&judge(&[]), 2, &["expected at least one filter"]);
    let mut bare = TensorFile::new([("sensor".to_owned(), "[8, 6]".to_owned())].into());
    columns[..4].iter().for_each(|(name, values)| bare.i64(name, &[5], values));
    bare.i64("start", &[2], &[0, 5]);
    std::fs::write(&events, bare.into_bytes()).expect("it can be written");
    fails(&judge(&["--stride", "2"]), 1, &["events.safetensors", "cause: expected I64 (5), found nothing"]);
}

#[test]
fn tracks_and_settings_that_do_not_fit_are_refused_by_name() {
    let (folder, tracks) = file("tracks.safetensors", tracks());
    let out = folder.path().join("events.safetensors");
    fails(&simulate(&tracks, &out, &["--lux", "0"]), 1, &["lux is 0, expected a finite number above 0"]);
    fails(&simulate(&out, &out, &[]), 1, &["events.safetensors"]);
    let other = meissner(&["simulate", "images", argument(folder.path()), "--out", "a.aedat"]);
    fails(&other, 2, &["--out: expected a file that ends in .aedat4", "found a.aedat"]);
    let mut wrong = TensorFile::new([].into());
    wrong.i64("t_us", &[2], &[5, 5]);
    wrong.i64("start", &[2], &[0, 2]);
    wrong.f32("position", &[2, 1, 2], &[0.0; 4]);
    std::fs::write(&tracks, wrong.into_bytes()).expect("it can be written");
    fails(&simulate(&tracks, &out, &[]), 1, &["tracks.safetensors", "stream 0", "times must ascend"]);
    assert!(!out.exists());
}

#[test]
fn a_loop_has_a_row_for_each_variation_of_each_network() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let [network, weights] = picture_network(folder.path());
    let [json, svg] = ["loop.json", "loop.svg"].map(|name| folder.path().join(name));
    let common = ["simulate", "loop", "--goal", "marble", "--seconds", "1", "--network", argument(&network)];
    let weights = ["--weights", argument(&weights)];
    let files = ["--out", argument(&json), "--svg", argument(&svg)];
    let varied = ["--tolerance", "0.05", "--slower", "2,1e6", "--stale", "80ms", "--drop", "1"];
    let output = meissner(&[&common[..], &weights, &varied, &files].concat());
    assert!(output.status.success(), "{}", message(&output));
    let shown = text(&output);
    for row in ["as it is", "tolerance 0.05", "2 times slower", "80 ms later", "100 % lost", "the truth"] {
        assert!(shown.contains(row), "{row}: {shown}");
    }
    let report = written(&json);
    let rows = report["networks"][0]["rows"].as_array().expect("a list");
    assert_eq!(
        (report["goal"].as_str(), rows.len(), rows[0]["pictures"].as_u64()),
        (Some("marble"), 6, Some(25))
    );
    assert_eq!(rows[2]["name"], "2 times slower");
    assert_eq!(rows[0]["trace"].as_array().map(Vec::len), Some(25));
    // A controller that loses all pictures leaves the marble where it is.
    assert_eq!((rows[5]["read"].as_u64(), rows[5]["error"].as_f64()), (Some(0), Some(4.0)));
    assert!(rows[5]["run_us"].is_null() && report["truth"]["error"].as_f64() < Some(4.0));
    let drawn = std::fs::read_to_string(&svg).expect("it was written");
    assert!(drawn.contains("mean tracking error (mm)") && drawn.contains("distance from the middle (mm)"));

    let lost = meissner(&[&common[..], &weights, &["--drop", "1.5"]].concat());
    fails(&lost, 2, &["--drop", "expected a share from 0 to 1", "1.5"]);
    fails(
        &meissner(&["simulate", "loop", "--network", "slip-tuned"]),
        2,
        &["--network", "networks over pictures"],
    );
}

#[test]
fn a_gel_is_pressed_as_told_and_what_cannot_be_pressed_is_refused_by_its_option() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("gel.safetensors");
    let gel = |more: &[&str]| {
        let common = ["simulate", "gel", "--presses", "1", "--size", "32x24", "--out", argument(&out)];
        meissner(&[&common[..], more].concat())
    };
    let teeth = [
        "--indenters",
        "larger",
        "--newtons",
        "3..3",
        "--saw-teeth",
        "1",
        "--pictures",
        "3",
        "--width",
        "16",
    ];
    let output = gel(&teeth);
    assert!(output.status.success(), "{}", message(&output));
    let bytes = std::fs::read(&out).expect("it was written");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let floats = |name: &str| -> Vec<f32> {
        let data = file.tensor(name).expect("it is there").data();
        data.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
    };
    assert_eq!(floats("pixel_mm"), [0.5]);
    let forces: Vec<f32> = floats("force").chunks_exact(32 * 24).map(|map| map.iter().sum()).collect();
    let expected = [1.5, 3.0, 1.5];
    assert!(forces.iter().zip(expected).all(|(found, newtons)| (found - newtons).abs() < 0.03), "{forces:?}");

    for (option, wrong) in [
        ("--newtons", "5..1"),
        ("--newtons", "0..2"),
        ("--newtons", "1..inf"),
        ("--width", "0"),
        ("--width", "nan"),
        ("--optics", "sensor"),
    ] {
        fails(&gel(&["--force", option, wrong]), 2, &[option, wrong]);
    }
    let missing = folder.path().join("optics.npz");
    fails(&gel(&["--force", "--optics", &format!("{}:a", argument(&missing))]), 1, &["optics.npz"]);
}
