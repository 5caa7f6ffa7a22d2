//! A small data set of digits, trainings of small networks over it, and what a network makes of it
//! by engines alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use meissner_engine::{Engine, Event, Sensor};
use meissner_models::{Description, Weights, draw};
use tempfile::TempDir;

/// Recordings of each class in the split train, and in the split test.
pub(crate) const TRAIN: usize = 2;
pub(crate) const TEST: usize = 1;
/// All of them.
pub(crate) const RECORDINGS: usize = 10 * (TRAIN + TEST);

/// A network over the past, whose events stay for 30 ms.
const SMALL: &str = r#"[network]
name = "NAME"
span_us = 30000
capacity = 64

[graph]
kind = "knn"
k = 4
candidates = "past"
lifetime = "window"
scale = 0.3

[[layer]]
name = "conv1"
kind = "spline"
channels = 4
kernel = 2

[[layer]]
name = "conv2"
kind = "spline"
channels = 6
kernel = 2

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 10

[output]
names = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"]
unit = "logit"
"#;

/// [`SMALL`] with this name, and the first of each pair replaced by the second.
pub(crate) fn small(name: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(SMALL.replace("NAME", name), |text, (old, new)| {
        assert!(text.contains(old), "{old:?} must be in the description");
        text.replacen(old, new, 1)
    })
}

/// A recording.
pub(crate) struct Digit {
    pub(crate) name: String,
    pub(crate) class: usize,
    pub(crate) events: Vec<Event>,
}

/// The recordings in their order.
pub(crate) fn digits() -> Vec<Digit> {
    let splits = [("train", TRAIN), ("test", TEST)];
    let digit = |split: &str, class: usize, number: usize| Digit {
        // Natural order is not that of the text.
        name: format!("{split}/{class}/{}", 9 + number),
        class,
        events: events(class, split.len() * 7 + number),
    };
    splits
        .into_iter()
        .flat_map(|(split, count)| {
            (0..10).flat_map(move |class| (0..count).map(move |number| digit(split, class, number)))
        })
        .collect()
}

/// Strokes that depend on the class, over 20 to 60 ms.
fn events(class: usize, variant: usize) -> Vec<Event> {
    let count = 30 + 3 * class + variant;
    let event = |i: usize| {
        let t_us = 1_000 + 100 * variant + i * (600 + 37 * class) + i * i % 97;
        let (x, y) = (i * (class + 3) + variant * i * i, i * (2 * class + 5) + i * i / 7);
        Event::new(t_us as i64, (x % 34) as u16, (y % 34) as u16, (i * (class + 1)).is_multiple_of(3))
    };
    (0..count).map(event).collect()
}

/// Five bytes an event.
pub(crate) fn bytes(events: &[Event]) -> Vec<u8> {
    let bytes = events.iter().flat_map(|event| {
        let [_, high, middle, low] = (event.t_us as u32).to_be_bytes();
        [event.x as u8, event.y as u8, high | u8::from(event.on) << 7, middle, low]
    });
    bytes.collect()
}

/// A folder of recordings.
pub(crate) struct DigitsFolder(TempDir);

impl DigitsFolder {
    pub(crate) fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("there is a place for temporary files"));
        digits().iter().for_each(|digit| folder.write(&digit.name, &digit.events));
        folder
    }

    pub(crate) fn write(&self, name: &str, events: &[Event]) {
        let path = self.path().join(format!("{name}.bin"));
        fs::create_dir_all(path.parent().expect("in a folder")).expect("a folder can be made");
        fs::write(path, bytes(events)).expect("a temporary file can be written");
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Descriptions, and trainings of them.
pub(crate) struct Runs(TempDir);

impl Runs {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("there is a place for temporary files"))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a description.
    pub(crate) fn network(&self, text: &str) -> (PathBuf, Description) {
        let description = Description::parse(text).expect("it is consistent");
        let path = self.path().join(format!("{}.toml", description.name()));
        fs::write(&path, text).expect("a temporary file can be written");
        (path, description)
    }

    /// Writes weights drawn from `seed` as a whole training, but for what `more` says of it.
    pub(crate) fn training(
        &self,
        file: &str,
        description: &Description,
        seed: u64,
        more: &[(&str, &str)],
    ) -> Weights {
        let weights = draw(description, seed);
        let seed = seed.to_string();
        let own = [("network", description.name()), ("seed", seed.as_str()), ("trained_on", "train")];
        let metadata: BTreeMap<String, String> =
            own.iter().chain(more).map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        fs::write(self.path().join(file), weights.to_safetensors(&metadata))
            .expect("a temporary file can be written");
        weights
    }
}

/// What a network says of a recording.
pub(crate) struct Said {
    /// Classes at 10, 20, ... ms before the end, then at the end.
    pub(crate) answers: Vec<usize>,
    /// Outputs at the end.
    pub(crate) bits: Vec<u32>,
    /// From the first event to the last.
    pub(crate) end_us: i64,
}

/// What `description` with `weights` says of every `stride`-th of `events`: an engine of its own
/// for every time.
pub(crate) fn said(description: &Description, weights: &Weights, events: &[Event], stride: usize) -> Said {
    let network = std::sync::Arc::new(description.network(weights).expect("they fit"));
    let events: Vec<Event> = events.iter().copied().step_by(stride).collect();
    let (first, last) = (events[0].t_us, events[events.len() - 1].t_us);
    let at = |t_us: i64| {
        let mut engine = Engine::new(network.clone(), Sensor::new(34, 34)).expect("it fits");
        let before: Vec<Event> = events.iter().copied().filter(|event| event.t_us <= t_us).collect();
        engine.push_slice(&before);
        engine.advance(t_us);
        engine.predict().expect("numbers").values.to_vec()
    };
    let before_the_end = (last - first - 1) / 10_000;
    let times = (1..=before_the_end).map(|i| first + 10_000 * i).chain([last]);
    let values: Vec<Vec<f32>> = times.map(at).collect();
    let bits = values[values.len() - 1].iter().map(|value| value.to_bits()).collect();
    Said { answers: values.iter().map(|values| class(values)).collect(), bits, end_us: last - first }
}

/// What it says of all recordings, in order.
pub(crate) fn all_said(description: &Description, weights: &Weights, stride: usize) -> Vec<Said> {
    digits().iter().map(|digit| said(description, weights, &digit.events, stride)).collect()
}

fn class(values: &[f32]) -> usize {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter().position(|&value| value == most).expect("one is the largest")
}
