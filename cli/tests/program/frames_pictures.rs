//! Networks over pictures.

use std::path::{Path, PathBuf};

use meissner_io::read_image;
use meissner_models::systems::contact_area::{
    ContactMeter, ContactSettings, ImageNormalisation, ImageSize, PixelSize,
};
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::OwnNetwork;
use crate::support::{argument, lines, meissner, message, text, words};

pub(crate) const WIDTH: usize = 8;
pub(crate) const HEIGHT: usize = 6;

/// A PPM file of `width` columns, with a bright square that begins at `place`.
fn picture(folder: &Path, name: &str, width: usize, place: usize) -> PathBuf {
    let mut bytes = format!("P6\n{width} {HEIGHT}\n255\n").into_bytes();
    for y in 0..HEIGHT {
        for x in 0..width {
            let inside = (place..place + 3).contains(&x) && (place..place + 3).contains(&y);
            let level = if inside { 250 } else { 40 + (x * 7 + y * 5) as u8 };
            bytes.extend([level, level / 2, 200 - level / 2]);
        }
    }
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("it can be written");
    path
}

fn pictures(network: &OwnNetwork) -> PathBuf {
    let folder = network.path("pictures");
    std::fs::create_dir(&folder).expect("it is not there");
    for (i, place) in [0, 1, 2, 3].into_iter().enumerate() {
        picture(&folder, &format!("img{}.ppm", i * 4), WIDTH, place);
    }
    folder
}

fn run(network: &OwnNetwork, input: &Path, more: &[&str]) -> (Vec<Value>, Value) {
    lines(&meissner(&network.arguments(input, &[&["--json"], more].concat())))
}

#[test]
fn pictures_give_the_reports_of_the_engines_maps_of_forces() {
    let network = OwnNetwork::new(FORCES);
    let folder = pictures(&network);
    let (size, pixel) = (ImageSize { width: WIDTH, height: HEIGHT }, PixelSize::new(0.5, 0.25));
    let settings =
        ContactSettings { threshold_n: 0.01, ..ContactSettings::new(size, pixel.expect("positive")) };
    let mut meter = ContactMeter::new(settings).expect("settings that mean something");
    let normalisation = ImageNormalisation::new([0.5; 3], [0.25; 3]).expect("it can be");
    let mut engine = network.engine();
    let mut planes = vec![0.0; 3 * WIDTH * HEIGHT];
    for more in [&[][..], &["--threads", "2"], &["--no-skip"]] {
        meter.reset();
        let (predictions, summary) = run(&network, &folder, more);
        assert_eq!((predictions.len(), &summary["pictures"]), (4, &4.into()));
        for (line, name) in predictions.iter().zip(["img0", "img4", "img8", "img12"]) {
            let path = folder.join(format!("{name}.ppm"));
            assert_eq!(line["image"], argument(&path), "natural order");
            normalisation
                .apply(&read_image(&path).expect("an image").data, None, &mut planes)
                .expect("it fits");
            engine.push(&planes).expect("it fits");
            let forces: Vec<f32> =
                engine.predict().expect("finite").values.iter().map(|y| y * 0.5 + 0.125).collect();
            let report = meter.measure(&forces).expect("finite");
            assert_eq!(line["area_mm2"], report.area_mm2);
            assert_eq!(line["force_n"], report.force_n);
            assert_eq!(line["median_force_n"], report.median_force_n);
            assert_eq!(line["centroid"]["x_px"].as_f64(), report.centroid.map(|c| c.x_px));
            assert_eq!(line["centroid"]["y_mm"].as_f64(), report.centroid.map(|c| c.y_mm));
            assert!(line["baseline"].is_null() && line["overlay"].is_null());
        }
        assert!(predictions.iter().any(|line| line["area_mm2"].as_f64() > Some(0.0)));
    }
}

#[test]
fn winograds_ways_come_close_and_what_is_skipped_or_tolerated_is_counted() {
    let network = OwnNetwork::new(FORCES);
    let folder = pictures(&network);
    let (direct, exact) = run(&network, &folder, &[]);
    let forces =
        |lines: &[Value]| lines.iter().filter_map(|line| line["force_n"].as_f64()).collect::<Vec<_>>();
    for way in ["winograd2", "winograd4"] {
        let (predictions, _) = run(&network, &folder, &["--convolution", way]);
        let (found, expected) = (forces(&predictions), forces(&direct));
        assert_eq!(found.len(), 4);
        assert_ne!(found, expected, "it is another rounding");
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
    }
    let count = |summary: &Value, what: &str| summary["pixels"][what].as_u64().expect("a count");
    let (_, all) = run(&network, &folder, &["--no-skip"]);
    let (_, tolerant) = run(&network, &folder, &["--tolerance", "100"]);
    assert_eq!(count(&all, "computed"), 4 * 2 * (WIDTH * HEIGHT) as u64);
    assert_eq!(count(&all, "skipped"), 0);
    assert!(count(&exact, "skipped") > 0, "{exact}");
    assert!(count(&tolerant, "computed") < count(&exact, "computed"), "{tolerant}");
    assert!(count(&tolerant, "skipped") > count(&exact, "skipped"), "{tolerant}");
}

#[test]
fn overlays_keep_their_names_and_can_be_read_again() {
    let network = OwnNetwork::new(FORCES);
    let (folder, maps) = (pictures(&network), network.path("maps"));
    let (predictions, _) = run(&network, &folder, &["--overlay", argument(&maps), "--full-scale", "0.5"]);
    let mut changed = 0;
    for (line, name) in predictions.iter().zip(["img0", "img4", "img8", "img12"]) {
        let target = maps.join(format!("{name}.png"));
        assert_eq!(line["overlay"], argument(&target));
        let (drawn, image) = (read_image(&target), read_image(&folder.join(format!("{name}.ppm"))));
        let (drawn, image) = (drawn.expect("a PNG"), image.expect("an image"));
        assert_eq!(drawn.size(), (WIDTH, HEIGHT));
        let is_contact = line["area_mm2"].as_f64() > Some(0.0);
        assert_eq!(drawn.data != image.data, is_contact, "{name}");
        changed += usize::from(is_contact);
    }
    assert!(changed > 0);
}

#[test]
fn an_overlay_replaces_neither_a_picture_nor_another_overlay() {
    let network = OwnNetwork::new(FORCES);
    let folder = pictures(&network);
    let arguments = network.arguments(&folder, &["--overlay", argument(&folder)]);
    assert!(meissner(&arguments).status.success(), "the pictures are no PNG");
    // Now there are PNG pictures beside PPM pictures of the same names.
    fails(&meissner(&arguments), 2, &["--overlay", "would replace"]);
    let maps = network.path("maps");
    let arguments = network.arguments(&folder, &["--overlay", argument(&maps)]);
    fails(&meissner(&arguments), 2, &["--overlay", "img0", "would replace the overlay of"]);
}

#[test]
fn a_run_that_fails_before_its_first_picture_makes_no_folder_for_overlays() {
    let network = OwnNetwork::new(FORCES);
    let wide = picture(&network.path("."), "wide.ppm", WIDTH + 1, 0);
    let maps = network.path("maps");
    let output = meissner(&network.arguments(&wide, &["--overlay", argument(&maps)]));
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    assert!(!maps.exists());
}

#[test]
fn a_picture_that_breaks_off_leaves_the_overlays_before_it_whole_and_others_as_they_were() {
    let network = OwnNetwork::new(FORCES);
    let (folder, maps) = (pictures(&network), network.path("maps"));
    run(&network, &folder, &["--overlay", argument(&maps), "--full-scale", "0.5"]);
    let overlay = |name: &str| std::fs::read(maps.join(name)).expect("it was written");
    let names = ["img0.png", "img4.png", "img8.png", "img12.png"];
    let before = names.map(overlay);
    let whole = std::fs::read(folder.join("img8.ppm")).expect("it is there");
    std::fs::write(folder.join("img8.ppm"), &whole[..whole.len() / 2]).expect("it can be written");
    let arguments = network.arguments(&folder, &["--overlay", argument(&maps), "--full-scale", "0.5"]);
    let output = meissner(&arguments);
    assert_eq!(output.status.code(), Some(1));
    let said = message(&output);
    assert!(said.contains("img8.ppm") && said.contains("cut short: expected 144 bytes"), "{said}");
    assert_eq!(names.map(overlay), before);
    assert_eq!(std::fs::read_dir(&maps).expect("it is there").count(), 4);
}

#[test]
fn a_reference_adds_where_pictures_differ_from_it() {
    let network = OwnNetwork::new(FORCES);
    let folder = pictures(&network);
    let reference = folder.join("img0.ppm");
    let (predictions, _) = run(&network, &folder, &["--reference", argument(&reference)]);
    assert_eq!(predictions[0]["baseline"]["area_mm2"], 0.0);
    assert!(predictions[0]["baseline"]["centroid"].is_null());
    for line in &predictions[1..] {
        assert!(line["baseline"]["area_mm2"].as_f64() > Some(0.0), "{line}");
        assert!(line["baseline"]["centroid"]["x_mm"].is_f64(), "{line}");
    }
    let arguments = network.arguments(&folder, &["--reference", argument(&reference)]);
    let people = words(&meissner(&arguments));
    for expected in ["area (mm2)", "baseline area (mm2)", "img12.ppm", "pictures 4"] {
        assert!(people.contains(expected), "{expected}: {people}");
    }
}

#[test]
fn of_differences_the_first_picture_is_the_reference_unless_there_is_another() {
    let network =
        OwnNetwork::new(&FORCES.replace("frames = \"picture\"", "frames = \"picture\"\ndifference = true"));
    let folder = pictures(&network);
    let forces = |more: &[&str]| {
        let (predictions, _) = run(&network, &folder, more);
        predictions.iter().map(|line| line["force_n"].as_f64().expect("a force")).collect::<Vec<_>>()
    };
    let (first, third) = (folder.join("img0.ppm"), folder.join("img8.ppm"));
    let of_first = forces(&[]);
    assert_eq!(of_first, forces(&["--reference", argument(&first)]));
    let of_third = forces(&["--reference", argument(&third)]);
    assert_ne!(of_first, of_third);
    // Any picture minus itself is an empty picture.
    assert_eq!(of_first[0].to_bits(), of_third[2].to_bits());
    assert_ne!(of_first[0].to_bits(), of_first[2].to_bits());
}

#[test]
fn a_picture_of_another_size_is_an_error_with_both_sizes() {
    let network = OwnNetwork::new(FORCES);
    let folder = pictures(&network);
    let small = picture(&network.path("."), "small.ppm", 5, 0);
    fails(&meissner(&network.arguments(&small, &[])), 1, &["small.ppm", "8x6", "5x6"]);
    let arguments = network.arguments(&folder, &["--reference", argument(&small)]);
    fails(&meissner(&arguments), 1, &["small.ppm", "8x6", "5x6"]);
    picture(&folder, "img99.ppm", 5, 0);
    let output = meissner(&network.arguments(&folder, &["--json"]));
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output).lines().count(), 6, "the header, those before it and a summary");
    let message = crate::support::message(&output);
    assert!(["img99.ppm", "8x6", "5x6"].iter().all(|part| message.contains(part)), "{message}");
}

#[test]
fn a_file_that_is_no_picture_is_bad_input() {
    let network = OwnNetwork::new(FORCES);
    let path = network.path("noise.png");
    std::fs::write(&path, b"\x89PNG\r\n\x1a\nand then nothing").expect("it can be written");
    fails(&meissner(&network.arguments(&path, &[])), 1, &["noise.png"]);
    fails(&meissner(&["run", "no/such/folder", "--network", "canf"]), 1, &["no/such/folder"]);
}

/// A map of forces for pictures of 8 x 6 pixels.
pub(crate) const FORCES: &str = r#"
[network]
name = "own"

[input]
kind = "image"
channels = 3
height = 6
width = 8
frames = "picture"
mean = [0.5, 0.5, 0.5]
std = [0.25, 0.25, 0.25]
force_mean = 0.125
force_std = 0.5
pixel_mm = [0.5, 0.25]
threshold_n = 0.01

[[layer]]
name = "conv"
kind = "conv"
channels = 8
kernel = 3
activation = "relu"

[[layer]]
name = "out"
kind = "conv"
channels = 1
kernel = 1

[output]
names = ["normal force"]
unit = "N/pixel"
"#;
