use std::path::{Path, PathBuf};

use meissner_engine::frames::FrameOptions;
use meissner_models::systems::contact_area::ContactMeter;
use rayon::ThreadPoolBuilder;

use super::{Options, Report, Source, evaluate};
use crate::prepare::{GelPlan, Shapes, gel_presses};
use crate::trainings::Request;
use crate::workers::Workers;

fn workers(threads: usize) -> Workers {
    Workers::from(ThreadPoolBuilder::new().num_threads(threads).build().unwrap())
}

/// The folder with a network, its weights and a file of presses of several pictures.
fn folder() -> (tempfile::TempDir, Vec<String>, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    // A hundredth of the change of red, in N.
    let (networks, weights) = red(folder.path(), [0.01, 0.001]);
    let data = folder.path().join("gel.safetensors");
    let plan = GelPlan {
        sensor: None,
        optics: None,
        width_mm: None,
        force_n: [0.2, 20.0],
        saw_teeth: 0,
        shapes: Shapes::Unseen,
        presses: 4,
        pictures: 3,
        size: [32, 24],
        coarseness: 1,
        seed: 5,
    };
    let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    std::fs::write(&data, gel_presses(&plan, &pool).unwrap().file.into_bytes()).unwrap();
    (folder, networks, weights, data)
}

fn judged(networks: &[String], weights: &Path, data: &[PathBuf], threads: usize) -> (Report, Vec<u8>) {
    let request = Request { networks, weights: Some(weights.into()), trainings: None };
    let options = Options { request, data, frames: FrameOptions::new() };
    let evaluation = evaluate(&options, &workers(threads), |_, _| ()).unwrap();
    (evaluation.report, evaluation.logits.into_bytes())
}

#[test]
fn figures_are_those_of_the_maps_computed_the_slow_way() {
    let (_folder, networks, weights, data) = folder();
    let (report, maps) = judged(&networks, &weights, std::slice::from_ref(&data), 2);
    assert_eq!((report.data[0].source, report.data[0].pictures), (Source::Simulated, 12));
    let figures = &report.networks[0].result.trainings[0].sets[0];
    let file = safetensors::SafeTensors::deserialize(&maps).unwrap();
    let floats = |view: &safetensors::tensor::TensorView<'_>| -> Vec<f32> {
        view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
    };
    let maps = file.tensor("red.3.0").unwrap();
    assert_eq!(maps.shape(), [12, 24, 32]);
    let maps = floats(&maps);
    let bytes = std::fs::read(&data).unwrap();
    let truth = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let (force, pixel) =
        (floats(&truth.tensor("force").unwrap()), floats(&truth.tensor("pixel_mm").unwrap()));
    let rgb = [truth.tensor("picture").unwrap(), truth.tensor("reference").unwrap()];
    let pixels = 24 * 32;
    let (mut ious, mut evens, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for picture in 0..12 {
        let side = f64::from(pixel[picture / 3]);
        let scale = side * side / 0.36;
        let (mut both, mut either, mut found, mut expected) = (0, 0, 0.0, 0.0);
        for i in 0..pixels {
            let [now, rest] = [(0, picture), (1, picture / 3)]
                .map(|(which, index)| f32::from(rgb[which].data()[3 * (index * pixels + i)]));
            let own = f64::from((now - rest) / 255.0 * 0.01);
            assert!((f64::from(maps[picture * pixels + i]) - own * scale).abs() < 1e-7);
            let true_n = f64::from(force[picture * pixels + i]);
            let (touches, is_true) = (own > 0.001, true_n > 1e-4 / 0.0036 * side * side);
            both += usize::from(touches && is_true);
            either += usize::from(touches || is_true);
            found += if touches { own * scale } else { 0.0 };
            expected += true_n;
        }
        ious.push(if either == 0 { 1.0 } else { both as f64 / either as f64 });
        // Equal shares for all pressed pixels.
        let own = picture * pixels..(picture + 1) * pixels;
        let greatest = force[own.clone()].iter().copied().fold(0.0, f32::max);
        let pressed: Vec<bool> = force[own.clone()].iter().map(|&n| n > 0.01 * greatest).collect();
        let share = expected / pressed.iter().filter(|&&is_pressed| is_pressed).count() as f64;
        let is_contact = |is_pressed: bool| is_pressed && share > 1e-4 / 0.0036 * side * side;
        let touches = maps[own].iter().map(|&n| f64::from(n) > 0.001 * scale);
        let pairs: Vec<_> =
            touches.zip(pressed).map(|(touches, is_pressed)| (touches, is_contact(is_pressed))).collect();
        let both = pairs.iter().filter(|&&pair| pair == (true, true)).count();
        let either = pairs.iter().filter(|&&pair| pair != (false, false)).count();
        evens.push(if either == 0 { 1.0 } else { both as f64 / either as f64 });
        errors.push((found - expected).abs());
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    assert!((figures.iou.mean - mean(&ious)).abs() < 1e-9, "{} {}", figures.iou.mean, mean(&ious));
    assert!((figures.iou_even.unwrap().mean - mean(&evens)).abs() < 1e-9);
    assert_ne!(figures.iou.mean.to_bits(), figures.iou_even.unwrap().mean.to_bits());
    assert!((figures.force_n.unwrap().mean - mean(&errors)).abs() < 1e-5);
    assert_eq!(figures.kinds.values().map(|kind| kind.pictures).sum::<usize>(), 12);
    let data = &report.data[0];
    assert!(data.difference.iou.mean > 0.0 && data.difference.force_n.is_none());
    assert!(data.stereo.iou.mean > 0.0 && data.stereo.force_n.is_some());
    assert!(figures.multiply_adds > 0);
}

#[test]
fn threads_change_no_bit_and_the_second_of_equal_pictures_costs_nothing() {
    let (folder, networks, weights, data) = folder();
    let [(one, maps), (two, maps_of_two)] =
        [1, 2].map(|threads| judged(&networks, &weights, std::slice::from_ref(&data), threads));
    assert_eq!(maps, maps_of_two);
    let iou = |report: &Report| report.networks[0].result.trainings[0].sets[0].iou.mean.to_bits();
    assert_eq!(iou(&one), iou(&two));

    // Two presses of one picture, and one of the same picture twice.
    let still = |name: &str, start: &[i64]| {
        let (pixels, presses) = (24 * 32, start.len() - 1);
        let mut file = meissner_models::TensorFile::new(std::collections::BTreeMap::new());
        file.u8("picture", &[2, 24, 32, 3], &vec![90; 6 * pixels]);
        file.u8("reference", &[presses, 24, 32, 3], &vec![80; 3 * presses * pixels]);
        file.f32("force", &[2, 24, 32], &vec![0.0; 2 * pixels]);
        file.f32("pixel_mm", &[presses], &vec![0.6; presses]);
        file.i64("start", &[start.len()], start);
        let path = folder.path().join(name);
        std::fs::write(&path, file.into_bytes()).unwrap();
        let (report, _) = judged(&networks, &weights, &[path], 1);
        report.networks[0].result.trainings[0].sets[0].multiply_adds
    };
    assert_eq!(still("two.safetensors", &[0, 1, 2]), 2 * still("one.safetensors", &[0, 2]));
}

#[test]
fn a_real_ball_is_turned_and_enlarged_with_its_circle() {
    use super::pictures::{Set, Truth};
    use meissner_io::datasets::{Ball, BallPictures};

    // 6 x 8 pixels; red encodes the column, green the row.
    let rgb: Vec<u8> = (0..48).flat_map(|i| [10 * (i % 6) as u8, 10 * (i / 6) as u8, 7]).collect();
    let ball = Ball { picture: rgb.clone(), circle: [1.0, 5.0, 1.2] };
    let set =
        Set::of_balls("balls", &BallPictures { width: 6, height: 8, background: rgb, balls: vec![ball] });
    assert_eq!((set.size.width, set.size.height), (16, 12));
    let picture = &set.presses[0].pictures[0];
    // The pixel of column 1 and row 5 is on the right and below the middle: rows become columns,
    // columns rows from below.
    let at = (2 * (5 - 1) + 1) * 16 + 2 * 5 + 1;
    let pixel = &picture.rgb[3 * at..3 * at + 3];
    assert!(pixel[0].abs_diff(10) <= 3 && pixel[1].abs_diff(50) <= 3 && pixel[2] == 7, "{pixel:?}");
    let Truth::Contact(mask) = &picture.truth else { panic!("a circle") };
    let area = mask.iter().filter(|&&inside| inside).count() as f64 / 4.0;
    assert!((area - std::f64::consts::PI * 1.44).abs() < 0.6 && mask[at], "{area}");
}

#[test]
fn pictures_of_another_size_and_files_that_do_not_fit_are_refused() {
    let (folder, _, _, data) = folder();
    let request = Request { networks: &["canf-plain".to_owned()], weights: None, trainings: None };
    let refused = |data: PathBuf| {
        let options = Options { request, data: &[data], frames: FrameOptions::new() };
        let error = evaluate(&options, &workers(1), |_, _| ()).err().expect("it does not fit");
        format!("{error}: {}", std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default())
    };
    let found = refused(data);
    assert!(
        found.contains("pictures of 320 x 240 pixels, for canf-plain") && found.contains("32 x 24 pixels"),
        "{found}"
    );
    let path = folder.path().join("bad.safetensors");
    let mut file = meissner_models::TensorFile::new(std::collections::BTreeMap::new());
    file.u8("picture", &[1, 2, 2, 3], &[0; 12]);
    file.i64("start", &[2], &[0, 1]);
    file.f32("force", &[1, 2, 1], &[0.0; 2]);
    std::fs::write(&path, file.into_bytes()).unwrap();
    let found = refused(path.clone());
    assert!(found.contains("tensor force: expected F32 [1, 2, 2], found F32 [1, 2, 1]"), "{found}");
    let mut file = meissner_models::TensorFile::new(std::collections::BTreeMap::new());
    file.u8("picture", &[0, 240, 320, 3], &[]);
    file.u8("reference", &[0, 240, 320, 3], &[]);
    file.f32("force", &[0, 240, 320], &[]);
    file.f32("pixel_mm", &[0], &[]);
    file.i64("start", &[1], &[0]);
    std::fs::write(&path, file.into_bytes()).unwrap();
    let found = refused(path.clone());
    assert!(found.contains("expected pictures, found") && found.contains("none"), "{found}");
    std::fs::write(&path, b"no tensors").unwrap();
    assert!(refused(path).contains("expected a safetensors file"));
}

#[test]
fn a_gel_plan_gives_equal_bytes_on_any_threads_and_forces_in_range() {
    let plan = GelPlan {
        sensor: Some(meissner_simulator::gel::GelSensor::second()),
        optics: None,
        width_mm: None,
        force_n: [0.2, 20.0],
        saw_teeth: 0,
        shapes: Shapes::Seen,
        presses: 5,
        pictures: 2,
        size: [64, 48],
        coarseness: 2,
        seed: 9,
    };
    let bytes = |plan: &GelPlan, threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        gel_presses(plan, &pool).unwrap().file.into_bytes()
    };
    let first = bytes(&plan, 1);
    assert_eq!(first, bytes(&plan, 2));
    assert_ne!(first, bytes(&GelPlan { seed: 10, ..plan }, 2));
    let set = super::pictures::Set::read_bytes("gel", &first).unwrap();
    let settings = meissner_models::systems::contact_area::ContactSettings::new(
        set.size,
        meissner_models::systems::contact_area::PixelSize::new(0.3, 0.3).unwrap(),
    );
    for press in &set.presses {
        // The width of the second sensor over 64 pixels.
        assert!((press.pixel_mm.unwrap() - 19.2 * 0.93 / 64.0).abs() < 1e-6);
        for picture in &press.pictures {
            let super::pictures::Truth::Force(force) = &picture.truth else { panic!("a force") };
            let mut meter = ContactMeter::new(settings).unwrap();
            let report = meter.measure(force).unwrap();
            assert!(report.pixels > 0 && (0.0..20.1).contains(&report.force_n), "{} N", report.force_n);
            assert_ne!(picture.rgb, press.reference);
        }
    }
}

/// The description of a network `name` over differences of pictures of 32 x 24 pixels, divided by
/// `std`. An output of 1 is a force of `force_n` on a pixel, and a pixel is in contact above
/// `threshold_n`.
pub(crate) fn description(name: &str, std: f32, [force_n, threshold_n]: [f32; 2], layers: &str) -> String {
    format!(
        r#"
[network]
name = "{name}"
[input]
kind = "image"
channels = 3
height = 24
width = 32
frames = "picture"
difference = true
mean = [0.0, 0.0, 0.0]
std = [{std:?}, {std:?}, {std:?}]
force_mean = 0.0
force_std = {force_n:?}
pixel_mm = [0.6, 0.6]
threshold_n = {threshold_n:?}
{layers}
[output]
names = ["force"]
unit = "N per pixel"
"#
    )
}

/// Writes a network whose force on a pixel is `force_n` times the change of its red, as a share of
/// 255 levels. Returns its name for a request, and its weights.
pub(crate) fn red(folder: &Path, forces_n: [f32; 2]) -> (Vec<String>, PathBuf) {
    let head = "[[layer]]\nname = \"head\"\nkind = \"conv\"\nchannels = 1\nkernel = 1";
    let [network, weights] = ["red.toml", "red.safetensors"].map(|name| folder.join(name));
    std::fs::write(&network, description("red", 1.0, forces_n, head)).expect("it can be written");
    let mut file = meissner_models::TensorFile::new([("seed".to_owned(), "3".to_owned())].into());
    file.f32("head.weight", &[1, 3, 1, 1], &[1.0, 0.0, 0.0]);
    file.f32("head.bias", &[1], &[0.0]);
    std::fs::write(&weights, file.into_bytes()).expect("it can be written");
    (vec![network.display().to_string()], weights)
}
