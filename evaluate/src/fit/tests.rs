//! Fits to presses of a blob whose place, size or motion is the label.

mod blobs;
mod linear;
mod perceptron;
mod refusals;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::Format;
use meissner_kernels::random::Random;
use meissner_models::{Description, draw};
use rayon::ThreadPoolBuilder;
use tempfile::TempDir;

use super::{Fitted, Options, fit};
use crate::error::Result;
use crate::presses::{Options as ReadOptions, Presses};
use crate::workers::Workers;

const SENSOR: Sensor = Sensor { width: 48, height: 36 };
const PRESS_US: i64 = 60_000;
/// A network whose readout has 96 values: fewer than the instants of 30 presses.
const SMALL: &str = r#"[network]
name = "small"
place = ["1/6", "1/4"]

[graph]
kind = "knn"
k = 4
candidates = "past"
lifetime = "frozen"
scale = 0.1

[[layer]]
name = "conv1"
kind = "spline"
channels = 4
kernel = 2
root = true

[[layer]]
name = "grid"
kind = "readout"
grid = [6, 4]
aggregation = "sum"

[[layer]]
name = "out"
kind = "dense"
outputs = 1

[output]
names = ["roll"]
unit = "rad"
"#;

/// A folder of presses.
struct Folder(TempDir);

impl Folder {
    /// So many presses of a blob that moves from the middle to a place; `label` makes the row of a
    /// press from its index, its place, and a number that does not affect the events.
    fn new(presses: usize, header: &str, label: impl Fn(usize, [f64; 2], f64) -> String) -> Self {
        let folder = Self(tempfile::tempdir().expect("there is a place for temporary files"));
        let mut random = Random::new(7);
        let mut labels = format!("{header}\n");
        for press in 0..presses {
            let to = [6.0 + 36.0 * random.uniform(), 6.0 + 24.0 * random.uniform()];
            let unknown = random.uniform();
            let path = folder.path().join(format!("press{press}.es"));
            let events = blob(to, &mut random);
            meissner_io::write(&path, Format::Es, Some(SENSOR), &events).expect("it can be written");
            writeln!(labels, "{}", label(press, to, unknown)).expect("a text takes everything");
        }
        let description = Description::parse(SMALL).expect("a description");
        let weights = draw(&description, 3).to_safetensors(&BTreeMap::new());
        let files = [
            ("labels.csv", labels.as_bytes()),
            ("small.toml", SMALL.as_bytes()),
            ("small.safetensors", &weights),
        ];
        for (name, content) in files {
            fs::write(folder.path().join(name), content).expect("it can be written");
        }
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Fits [`SMALL`] with weights that were drawn.
    fn options(&self) -> Options {
        let network = self.path().join("small.toml").display().to_string();
        let weights = Some(self.path().join("small.safetensors"));
        Options { weights, ages: 4, folds: 3, ..Options::new(network, "mine") }
    }

    fn fit(&self, options: &Options, threads: usize) -> Result<Fitted> {
        let presses = Presses::read(self.path(), &ReadOptions::default())?;
        fit(&presses, options, &workers(threads))
    }
}

fn workers(threads: usize) -> Workers {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("the system has threads").into()
}

/// Events around a place that moves from the middle of the sensor to `to`.
fn blob(to: [f64; 2], random: &mut Random) -> Vec<Event> {
    let event = |i: i64, random: &mut Random| {
        let share = i as f64 / 199.0;
        let place = |axis: usize, from: f64, random: &mut Random| {
            let centre = from + (to[axis] - from) * share;
            (centre + 3.0 * f64::from(random.symmetric())).max(0.0)
        };
        let (x, y) = (place(0, 24.0, random), place(1, 18.0, random));
        Event::new(PRESS_US * i / 199, (x as u16).min(47), (y as u16).min(35), i % 3 != 0)
    };
    (0..200).map(|i| event(i, random)).collect()
}

/// Places at the end and halfway, an angle, and a number that does not affect the events.
fn places(presses: usize) -> Folder {
    Folder::new(presses, "recording,t_us,x_mm,tilt_deg,unknown", |press, [x, y], unknown| {
        let middle = [f64::midpoint(24.0, x), f64::midpoint(18.0, y)];
        let row = |t_us: i64, [x, y]: [f64; 2]| format!("press{press},{t_us},{x},{y},{unknown}");
        format!("{}\n{}", row(PRESS_US / 2, middle), row(PRESS_US, [x, y]))
    })
}
