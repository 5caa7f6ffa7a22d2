//! Small data sets of digits, slips and touch, trainings over them, and a network's results for
//! them by engines alone.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use meissner_engine::{Engine, Event, Sensor};
use meissner_models::systems::letters::CLASSES;
use meissner_models::{Description, Weights, draw};
use tempfile::TempDir;

/// Recordings of each class in the split train, and in the split test.
pub(crate) const TRAIN: usize = 2;
pub(crate) const TEST: usize = 1;
/// Number of all recordings.
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

/// [`SMALL`] with this name, with the first text of each pair replaced by the second.
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
        // Natural order differs from the order of the text.
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

    /// Writes weights drawn from `seed` as a whole training, changed by the metadata in `more`.
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

/// A network's predictions for a recording.
pub(crate) struct Said {
    /// Classes at 10, 20, ... ms before the end, then at the end.
    pub(crate) answers: Vec<usize>,
    /// Outputs at the end.
    pub(crate) bits: Vec<u32>,
    /// From the first event to the last.
    pub(crate) end_us: i64,
}

/// The predictions of `description` with `weights` for every `stride`-th of `events`, with a
/// separate engine for every time.
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

/// Its predictions for all recordings, in order.
pub(crate) fn all_said(description: &Description, weights: &Weights, stride: usize) -> Vec<Said> {
    digits().iter().map(|digit| said(description, weights, &digit.events, stride)).collect()
}

fn class(values: &[f32]) -> usize {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter().position(|&value| value == most).expect("one is the largest")
}

/// A folder with containers: for each class, a recording of two spikes for training, and one for
/// the test.
pub(crate) fn touch_folder(classes: usize) -> TempDir {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let mut arrays = Vec::new();
    for (split, first) in [("train", 0), ("test", 3)] {
        for class in 0..classes {
            arrays.push((
                format!("Ev-Containers/{split}/sample_{class}_label_{class}.npy"),
                array(first + class),
            ));
        }
    }
    std::fs::write(folder.path().join("Ev-Containers.zip"), archive(&arrays))
        .expect("a temporary file can be written");
    folder
}

/// An archive with these files.
pub(crate) fn archive(files: &[(impl AsRef<str>, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut bytes);
    for (name, content) in files {
        let (mut entry, config) = archive.new_file(name.as_ref()).start().expect("a vector takes everything");
        let mut writer = config.wrap(&mut entry);
        writer.write_all(content).expect("a vector takes everything");
        let (_, descriptor) = writer.finish().expect("a vector takes everything");
        entry.finish(descriptor).expect("a vector takes everything");
    }
    archive.finish().expect("a vector takes everything");
    bytes
}

/// Writes a small network that predicts letters, with drawn weights, into `folder`. Returns its
/// description and its weights.
pub(crate) fn letters_network(folder: &Path) -> [PathBuf; 2] {
    let [network, weights] = ["own.toml", "own.safetensors"].map(|file| folder.join(file));
    let text = format!(
        "[network]\nname = \"own\"\nspan_us = 1000000\ncapacity = 256\n\n[graph]\nkind = \"knn\"\nk = 4\n\
         candidates = \"past\"\nlifetime = \"window\"\nscale = 0.3\n\n[[layer]]\nname = \"conv1\"\nkind = \"spline\"\n\
         channels = 4\nkernel = 2\nroot = true\n\n[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [10, 8]\n\
         aggregation = \"sum\"\n\n[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 27\n\n[output]\nclasses = {}\n",
        serde_json::json!(CLASSES)
    );
    let description = Description::parse(&text).expect("consistent");
    let trained = [("trained_on".to_owned(), "train".to_owned())].into();
    std::fs::write(&weights, draw(&description, 3).to_safetensors(&trained)).expect("it is written");
    std::fs::write(&network, text).expect("it is written");
    [network, weights]
}

/// Presses of each letter in [`letters_archive`].
pub(crate) const NUMBERS: usize = 4;

/// Presses on letters of braille (`letters.npz`): each letter has its own taxel, on which pressure
/// rises for 0.3 s and falls when the skin is lifted; its last press is for the test.
pub(crate) fn letters_archive() -> Vec<u8> {
    let (mut t_us, mut taxel, mut adc, mut start) = (Vec::new(), Vec::new(), Vec::new(), vec![0_i64]);
    for letter in 0..27 {
        for number in 0..NUMBERS as i64 {
            for step in 0..30_i64 {
                // Batches of three readings, the last ones after the lift.
                t_us.push(990_000 + step / 3 * 15_700 + if step < 24 { 0 } else { 400_000 });
                taxel.push(if step % 3 == 2 { 60 + number } else { letter + 1 } as u8);
                adc.push((if step < 24 { 1000 - 20 * step - number } else { 600 + 10 * step }) as u16);
            }
            start.push(t_us.len() as i64);
        }
    }
    let presses = 27 * NUMBERS;
    let of_letter: Vec<u8> = (0..presses).map(|press| (press / NUMBERS) as u8).collect();
    let number: Vec<u8> = (0..presses).map(|press| (press % NUMBERS) as u8).collect();
    let test: Vec<u8> = number.iter().map(|number| u8::from(usize::from(*number) + 1 == NUMBERS)).collect();
    let stamps: Vec<i64> = (0..presses).flat_map(|_| [1_000_000, 1_200_000, 1_500_000]).collect();
    let place: Vec<i16> = (0..81).flat_map(|taxel| [(taxel + 9) % 10, (taxel + 9) / 10 - 1]).collect();
    let letters: Vec<u32> = std::iter::once(' ').chain('A'..='Z').map(u32::from).collect();
    let list = |count: usize| format!("({count},)");
    let readings = list(t_us.len());
    let bytes = |values: &[i64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>();
    archive(&[
        ("t_us.npy", npy("<i8", &readings, &bytes(&t_us))),
        ("taxel.npy", npy("|u1", &readings, &taxel)),
        (
            "adc.npy",
            npy("<u2", &readings, &adc.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>()),
        ),
        ("start.npy", npy("<i8", &list(presses + 1), &bytes(&start))),
        ("letter.npy", npy("|u1", &list(presses), &of_letter)),
        ("number.npy", npy("|u1", &list(presses), &number)),
        ("stamps_us.npy", npy("<i8", &format!("({presses}, 3)"), &bytes(&stamps))),
        ("test.npy", npy("|b1", &list(presses), &test)),
        (
            "place.npy",
            npy("<i2", "(81, 2)", &place.iter().flat_map(|at| at.to_le_bytes()).collect::<Vec<_>>()),
        ),
        (
            "letters.npy",
            npy("<U1", "(27,)", &letters.iter().flat_map(|code| code.to_le_bytes()).collect::<Vec<_>>()),
        ),
    ])
}

/// An array of four bins with spikes of the taxel in the first and in the last.
fn array(taxel: usize) -> Vec<u8> {
    let mut values = [0.0_f32; 39 * 2 * 4];
    for place in [0, 7] {
        values[taxel * 8 + place] = 1.0;
    }
    npy("<f4", "(39, 2, 4)", &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>())
}

/// An array of this type and shape with these bytes.
fn npy(descr: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), values].concat()
}

pub(crate) mod slip {
    //! A small data set of slips, trainings of networks over it, and a network's results for it by
    //! the engine alone.

    use std::collections::BTreeMap;
    use std::fs;
    use std::path::{Path, PathBuf};

    use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
    use meissner_models::{FrameDescription, Weights, draw};
    use tempfile::TempDir;

    use crate::frames::{engine, predicted};

    pub(crate) const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];
    /// An object of each set, with the number and the rows of its recording in each class; sorted
    /// by name.
    pub(crate) const OBJECTS: [(&str, usize, usize); 4] =
        [("bottle", 2, 12), ("brush", 3, 10), ("case", 1, 16), ("strippes", 10, 5)];
    /// Windows of 5 readings of each of [`OBJECTS`], in each class.
    pub(crate) const WINDOWS: [usize; 4] = [2, 2, 3, 1];

    /// A folder of recordings.
    pub(crate) struct SlipFolder(TempDir);

    impl SlipFolder {
        pub(crate) fn new() -> Self {
            let folder = tempfile::tempdir().expect("there is a place for temporary files");
            for (class, class_name) in CLASSES.iter().enumerate() {
                fs::create_dir(folder.path().join(class_name)).expect("a folder can be made");
                for (object, &(name, number, _)) in OBJECTS.iter().enumerate() {
                    let file = folder.path().join(format!("{class_name}/{name}{number}.csv"));
                    fs::write(file, csv(&readings(class, object))).expect("a temporary file can be written");
                }
            }
            Self(folder)
        }

        pub(crate) fn path(&self) -> &Path {
            self.0.path()
        }
    }

    pub(crate) fn readings(class: usize, object: usize) -> Vec<[f32; 24]> {
        let value = |row: usize, electrode: usize| {
            (2000 + (class * 389 + object * 131 + row * (class + 3) * 41 + electrode * electrode * 17) % 1500)
                as f32
        };
        (0..OBJECTS[object].2).map(|row| std::array::from_fn(|electrode| value(row, electrode))).collect()
    }

    pub(crate) fn csv(readings: &[[f32; 24]]) -> String {
        let header = (1..=24).map(|e| format!("ff_e{e}")).collect::<Vec<_>>().join(",");
        let row = |reading: &[f32; 24]| reading.map(|value| value.to_string()).join(",");
        [header].into_iter().chain(readings.iter().map(row)).collect::<Vec<_>>().join("\n") + "\n"
    }

    /// The weights of a network, drawn from `seed`.
    pub(crate) fn drawn(network: &str, seed: u64) -> Weights {
        draw(&FrameDescription::shipped(network).expect("it is shipped"), seed)
    }

    /// Writes `weights` with `metadata` to `folder`.
    pub(crate) fn training(
        folder: &Path,
        name: &str,
        weights: &Weights,
        metadata: &[(&str, &str)],
    ) -> PathBuf {
        let metadata: BTreeMap<String, String> =
            metadata.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        let path = folder.join(name);
        fs::write(&path, weights.to_safetensors(&metadata)).expect("a temporary file can be written");
        path
    }

    /// Bits of the outputs for each window of each recording, in order, computed one after the
    /// other.
    pub(crate) fn outputs(network: &str, weights: &Weights) -> Vec<Vec<Vec<u32>>> {
        let description = FrameDescription::shipped(network).expect("it is shipped");
        let (scaling, form) = match network {
            "slip-lstm" => (Scaling::PerReading, TactileForm::Reading),
            _ => (Scaling::PerImage, TactileForm::Image),
        };
        let mut engine = engine(&description, weights);
        let mut recordings = Vec::new();
        for class in 0..CLASSES.len() {
            for object in 0..OBJECTS.len() {
                let mut window =
                    TactileWindow::new(5, Sampling::Consecutive, scaling, form).expect("it can be");
                let mut windows = Vec::new();
                for reading in readings(class, object) {
                    let Some(sequence) = window.push(&reading).expect("finite") else { continue };
                    engine.reset();
                    let frames = sequence.values.chunks_exact(sequence.values.len() / 5);
                    frames.for_each(|frame| engine.push(frame).expect("a frame"));
                    windows.push(predicted(&mut engine));
                }
                recordings.push(windows);
            }
        }
        recordings
    }

    /// The class that these bits predict.
    pub(crate) fn class(bits: &[u32]) -> usize {
        let values: Vec<f32> = bits.iter().map(|&bits| f32::from_bits(bits)).collect();
        let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        values.iter().position(|&value| value == most).expect("one is the largest")
    }
}
