//! The commands of the quick start, the tutorials and the pages about sensors, with files instead
//! of a camera, a robot, a driver and a data set.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use meissner_engine::{Event, Sensor};
use meissner_io::Format;
use tempfile::TempDir;

use crate::data::{letters_archive, letters_network, slip};
use crate::eval::tracks;
use crate::support::{default_recording, picture_network};

/// The commands in the blocks of shell code of a page below `docs`, in order, without cargo's.
fn commands(page: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(page);
    let text = fs::read_to_string(path).expect("a page");
    let blocks = text.split("```sh\n").skip(1).filter_map(|rest| rest.split_once("```"));
    let lines = blocks.flat_map(|(block, _)| block.lines());
    lines.filter(|line| !line.is_empty() && !line.starts_with("cargo ")).map(str::to_owned).collect()
}

/// Runs the commands of `page` in `folder`, each with `instead`: something that a reader has, and a
/// file of the folder or an option that replaces it. `before` is called with each command.
fn run(page: &str, folder: &Path, instead: &[(&str, &str)], before: impl Fn(&str)) {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_meissner"));
    let own = program.parent().expect("a folder");
    let path = env::var_os("PATH").unwrap_or_default();
    let paths = env::join_paths([own.to_owned()].into_iter().chain(env::split_paths(&path))).expect("paths");
    let commands = commands(page);
    assert!(commands.len() >= 3, "{page}: {commands:?}");
    for command in commands {
        before(&command);
        let changed = instead.iter().fold(command.clone(), |text, (of, by)| text.replace(of, by));
        let output = Command::new("sh")
            .args(["-e", "-c", &changed])
            .current_dir(folder)
            .env("PATH", &paths)
            .output()
            .expect("a shell");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && !said.contains("error"), "{page}: {command} ({changed}): {said}");
    }
}

/// Twelve presses with a pause of half a second between them: a block of pixels that moves to a
/// position that is the label. `camera.es` and `camera.csv` have them.
fn presses(sensor: Sensor, folder: &Path) -> Vec<f64> {
    let (mut events, mut labels) = (Vec::new(), Vec::new());
    for press in 0..12_i64 {
        let to = f64::from(sensor.width) * (0.3 + 0.05 * press as f64);
        labels.push(to / 10.0);
        events.extend((0..300_i64).map(|k| {
            let x = (to * k as f64 / 300.0) as u16 + (k % 2) as u16;
            let y = (i64::from(sensor.height) / 2 + (k / 2) % 3) as u16;
            Event::new(press * 700_000 + k * 300, x.min(sensor.width - 1), y, (k * press) % 5 != 0)
        }));
    }
    for (name, format) in [("camera.es", Format::Es), ("camera.csv", Format::Csv)] {
        meissner_io::write(&folder.join(name), format, Some(sensor), &events).expect("it is written");
    }
    labels
}

/// Runs a page in `folder` that records twelve presses, labels them with `label` under `heading`,
/// and fits `name`.
fn fits(
    (page, folder): (&str, &TempDir),
    sensor: Sensor,
    instead: &[(&str, &str)],
    (heading, name): (&str, &str),
    label: fn(f64) -> String,
) {
    let mut table = format!("recording,{heading}\n");
    for (press, place) in presses(sensor, folder.path()).into_iter().enumerate() {
        writeln!(table, "press-{:04}.aedat4,{}", press + 1, label(place)).expect("text");
    }
    run(page, folder.path(), instead, |command| {
        if command.starts_with("meissner prepare presses") {
            fs::write(folder.path().join("presses/labels.csv"), &table).expect("it is written");
        }
    });
    let card = fs::read_to_string(folder.path().join(format!("fitted/{name}.md"))).expect("a card");
    assert!(card.contains("12 presses"), "{card}");
}

#[test]
fn a_dome_gets_from_the_box_to_a_controller() {
    let instead = [("dv://127.0.0.1:7777", "camera.es")];
    let folder = TempDir::new().expect("a place");
    fits(("sensors/dome.md", &folder), Sensor::new(120, 90), &instead, ("x_mm", "mine"), |place| {
        place.to_string()
    });
}

#[test]
fn a_skin_of_taxels_gets_to_classes() {
    let class = |place| ["left", "right"][usize::from(place > 0.59)].to_owned();
    let folder = TempDir::new().expect("a place");
    fs::create_dir(folder.path().join("braille")).expect("a folder");
    fs::write(folder.path().join("braille/letters.npz"), letters_archive()).expect("it is written");
    let [network, weights] = letters_network(folder.path());
    let quick = "letters.safetensors --folds 3 --ages 0";
    let small = format!("fit {} {quick} --weights {}", network.display(), weights.display());
    let instead = [("driver", "cat camera.csv"), ("fit touch-objects letters.safetensors", &small)];
    fits(("sensors/skin.md", &folder), Sensor::new(10, 8), &instead, ("class", "letters"), class);
    let curve = fs::read_to_string(folder.path().join("braille.svg")).expect("a picture");
    assert!(curve.contains("time since contact (ms)"), "{curve}");
}

#[test]
fn a_camera_before_a_gel_gets_to_pictures_of_force() {
    let folder = TempDir::new().expect("a place");
    let [network, weights] = picture_network(folder.path());
    let pictures: Vec<u8> = (0..3 * 3 * 32 * 24_u32).map(|i| (i * 7 % 251) as u8).collect();
    fs::write(folder.path().join("camera.rgb"), pictures).expect("it is written");
    let small = format!("--network {} --weights {} --video 32x24", network.display(), weights.display());
    let camera = "ffmpeg -v error -f v4l2 -i /dev/video0 -s 320x240 -f rawvideo -pix_fmt rgb24 -";
    let instead = [(camera, "cat camera.rgb"), ("--network canf --video 320x240", &small)];
    run("sensors/gel.md", folder.path(), &instead, |_| ());
    let lines = fs::read_to_string(folder.path().join("touch.json")).expect("predictions");
    assert_eq!(lines.lines().count(), 5, "header, three pictures, summary: {lines}");
}

#[test]
fn electrodes_get_to_the_direction_of_slip() {
    let folder = TempDir::new().expect("a place");
    fs::write(folder.path().join("readings.csv"), slip::csv(&slip::readings(1, 0))).expect("a file");
    run("sensors/electrodes.md", folder.path(), &[("driver", "cat readings.csv")], |_| ());
}

/// Asserts that the page at `name` in `folder` contains `expected`.
fn says(folder: &TempDir, name: &str, expected: &str) {
    let page = fs::read_to_string(folder.path().join(name)).expect("a page");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains(expected), "{name}: {expected}");
}

/// A folder with the embedded press as RECORDING.
fn with_a_recording() -> TempDir {
    let folder = TempDir::new().expect("a place");
    fs::copy(default_recording(), folder.path().join("RECORDING")).expect("it is copied");
    folder
}

#[test]
fn the_quick_start_leads_to_a_comparison() {
    let folder = with_a_recording();
    // Few events are enough to show that it runs.
    let less = [
        ("bench RECORDING", "bench RECORDING --limit 500 --warmup 0"),
        ("verify tactigraph-past RECORDING --cases 10", "verify tactigraph-past --cases 1"),
        ("play RECORDING", "play RECORDING --limit 2000"),
    ];
    run("quick-start.md", folder.path(), &less, |_| ());
    says(&folder, "run.html", "Rows by layer");
    says(&folder, "compared.html", "2 results compared");
}

#[test]
fn the_page_on_performance_measures() {
    let folder = with_a_recording();
    let less = [
        ("bench RECORDING", "bench RECORDING --limit 500 --warmup 0"),
        ("play RECORDING", "play RECORDING --limit 2000"),
    ];
    run("performance.md", folder.path(), &less, |_| ());
    says(&folder, "bench.html", "Where the time goes");
    says(&folder, "both.html", "2 results compared");
}

#[test]
fn the_tutorial_on_angles_judges_and_chooses() {
    let folder = TempDir::new().expect("a place");
    fs::write(folder.path().join("two.safetensors"), tracks(&["roll", "pitch", "depth"])).expect("a file");
    let less = [
        ("meissner simulate dome --out tracks.safetensors", "mv two.safetensors tracks.safetensors"),
        ("--limit 5000", "--limit 300 --warmup 0"),
    ];
    run("tutorials/angle.md", folder.path(), &less, |_| ());
    says(&folder, "press.html", "roll, true");
    says(&folder, "angle.html", "Mean absolute error against time");
    says(&folder, "choose.html", "sustained events/s");
}

#[test]
fn the_tutorial_on_forces_judges_events_and_frames() {
    let folder = TempDir::new().expect("a place");
    run("tutorials/force.md", folder.path(), &[("--recordings 6", "--recordings 3")], |_| ());
    says(&folder, "force.html", "force-graph, all");
}

#[test]
fn the_tutorial_on_slip_judges_unseen_objects() {
    let folder = TempDir::new().expect("a place");
    fs::write(folder.path().join("readings.csv"), slip::csv(&slip::readings(1, 0))).expect("a file");
    let data = slip::SlipFolder::new();
    let data = data.path().to_str().expect("text").to_owned();
    run("tutorials/slip.md", folder.path(), &[("DATA", &data)], |_| ());
    says(&folder, "slip.html", "Probability of the classes");
    says(&folder, "unseen.html", "slip-best");
}

#[test]
fn the_tutorial_on_areas_judges_pictures_and_takes_a_video() {
    let folder = TempDir::new().expect("a place");
    let [network, weights] = picture_network(folder.path());
    let pictures: Vec<u8> = (0..3 * 3 * 32 * 24_u32).map(|i| (i * 7 % 251) as u8).collect();
    fs::write(folder.path().join("camera.rgb"), pictures).expect("it is written");
    let small = format!("--network {} --weights {}", network.display(), weights.display());
    let instead = [
        ("camera |", "cat camera.rgb |"),
        ("--network canf --video 320x240@25", &format!("{small} --video 32x24")),
        ("--network canf-plain", &small),
        ("simulate gel", "simulate gel --size 32x24"),
    ];
    run("tutorials/area.md", folder.path(), &instead, |_| ());
    says(&folder, "area.html", "Intersection over union");
    says(&folder, "touch.html", "contact area");
}
