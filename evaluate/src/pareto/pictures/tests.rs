//! The study on small simulated presses: the exact setting against `eval area`, and what each
//! setting changes.

use std::path::{Path, PathBuf};

use meissner_engine::frames::FrameOptions;
use meissner_models::{FrameDescription, TensorFile, draw};
use rayon::ThreadPoolBuilder;

use super::area;
use crate::area::{self as judged, Figures, tests::description};
use crate::pareto::{Compared, ErrorKind, Options, Report, SettingReport, State};
use crate::prepare::{GelPlan, Shapes, gel_presses};
use crate::trainings::Request;
use crate::workers::Workers;

const PIXELS: usize = 24 * 32;

/// Two convolutions of 3 x 3 over differences of pictures; weights are drawn.
const LAYERS: &str = r#"
[[layer]]
name = "first"
kind = "conv"
channels = 8
kernel = 3
activation = "relu"
[[layer]]
name = "head"
kind = "conv"
channels = 1
kernel = 3
"#;

struct Folder {
    path: tempfile::TempDir,
    networks: Vec<String>,
    weights: PathBuf,
}

impl Folder {
    fn new() -> Self {
        let path = tempfile::tempdir().unwrap();
        let [network, weights] = ["two.toml", "two.safetensors"].map(|name| path.path().join(name));
        std::fs::write(&network, description("two", 0.1, [0.01, 0.001], LAYERS)).unwrap();
        let description = FrameDescription::load(&network).unwrap();
        let drawn = draw(&meissner_models::AnyDescription::Frames(description), 5);
        std::fs::write(&weights, drawn.to_safetensors(&[("seed".to_owned(), "5".to_owned())].into()))
            .unwrap();
        Self { networks: vec![network.display().to_string()], path, weights }
    }

    /// A file of simulated presses.
    fn presses(&self, name: &str, presses: usize, pictures: usize) -> PathBuf {
        let plan = GelPlan {
            sensor: None,
            optics: None,
            width_mm: None,
            force_n: [0.2, 20.0],
            saw_teeth: 0,
            shapes: Shapes::Unseen,
            presses,
            pictures,
            size: [32, 24],
            coarseness: 1,
            seed: 5,
        };
        let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        self.written(name, gel_presses(&plan, &pool).unwrap().file)
    }

    fn written(&self, name: &str, file: TensorFile) -> PathBuf {
        let path = self.path.path().join(name);
        std::fs::write(&path, file.into_bytes()).unwrap();
        path
    }

    /// Presses of `pictures` equal grey pictures without any contact.
    fn silent(&self, pictures: &[usize]) -> PathBuf {
        let mut file = TensorFile::new([].into());
        let (count, presses) = (pictures.iter().sum::<usize>(), pictures.len());
        file.u8("picture", &[count, 24, 32, 3], &vec![80; 3 * count * PIXELS]);
        file.u8("reference", &[presses, 24, 32, 3], &vec![80; 3 * presses * PIXELS]);
        file.f32("force", &[count, 24, 32], &vec![0.0; count * PIXELS]);
        file.f32("pixel_mm", &[presses], &vec![0.6; presses]);
        let ends = pictures.iter().scan(0, |end, &count| {
            *end += count as i64;
            Some(*end)
        });
        let start: Vec<i64> = std::iter::once(0).chain(ends).collect();
        file.i64("start", &[start.len()], &start);
        self.written("silent.safetensors", file)
    }

    fn request(&self) -> Request<'_> {
        Request { networks: &self.networks, weights: Some((&*self.weights).into()), trainings: None }
    }

    fn measured(&self, files: &[PathBuf], only: &[&str], threads: usize) -> Report {
        let only = only.iter().map(|&name| name.to_owned()).collect();
        let options = Options { timed: Some(4), repeats: 1, only };
        let workers = workers(threads);
        let study = area(files, self.request(), &options, &workers).unwrap();
        study.run(&options, &mut State::open(None).unwrap(), |_| Ok(())).unwrap()
    }

    fn judged(&self, file: &Path) -> Figures {
        let options = judged::Options {
            request: self.request(),
            data: &[file.to_owned()],
            frames: FrameOptions::new(),
        };
        let mut report = judged::evaluate(&options, &workers(2), |_, _| ()).unwrap().report;
        report.networks[0].result.trainings[0].sets.remove(0)
    }
}

fn workers(threads: usize) -> Workers {
    ThreadPoolBuilder::new().num_threads(threads).build().unwrap().into()
}

fn setting<'a>(report: &'a Report, name: &str) -> &'a SettingReport {
    let found = report.networks[0].settings.iter().find(|setting| setting.setting == name);
    found.unwrap_or_else(|| panic!("{name}"))
}

#[test]
fn the_exact_setting_has_the_errors_of_eval_area_on_each_file_and_on_all() {
    let folder = Folder::new();
    let files = [folder.presses("a.safetensors", 3, 3), folder.presses("b.safetensors", 2, 1)];
    let report = folder.measured(&files, &["exact"], 2);
    assert_eq!((report.unit, report.compared), ("picture", Compared::Task(ErrorKind::OneMinusIou)));
    assert_eq!((report.data.recordings, report.data.size), (5, 11));
    let exact = setting(&report, "exact");
    assert_eq!((exact.measurement.numerical.max, exact.speed_up), (0.0, 1.0));
    let task = &exact.measurement.task;
    let kinds: Vec<_> = task.iter().map(|task| (task.of.as_str(), task.kind, task.trials)).collect();
    let [a, b] = [&files[0], &files[1]].map(|file| file.display().to_string());
    let (iou, force) = (ErrorKind::OneMinusIou, ErrorKind::AbsoluteForce);
    let expected = ["all files", &a, &b].into_iter().zip([11, 9, 2]);
    let expected: Vec<_> = expected.flat_map(|(of, n)| [(of, iou, n), (of, force, n)]).collect();
    assert_eq!(kinds, expected);
    let each = [folder.judged(&files[0]), folder.judged(&files[1])];
    for (i, figures) in each.iter().enumerate() {
        assert_eq!(task[2 + 2 * i].error, 1.0 - figures.iou.mean);
        assert_eq!(Some(task[3 + 2 * i].error), figures.force_n.map(|force| force.mean));
    }
    let mean = (9.0 * each[0].iou.mean + 2.0 * each[1].iou.mean) / 11.0;
    assert!((exact.error - (1.0 - mean)).abs() < 1e-12 && 0.0 < mean && mean < 1.0, "{mean}");
    assert!(exact.interval_95.is_some_and(|(low, high)| low < exact.error && exact.error < high));

    let one = folder.measured(&files[..1], &["exact"], 1);
    let exact = setting(&one, "exact");
    assert_eq!((exact.error, exact.measurement.task[0].of.as_str()), (1.0 - each[0].iou.mean, "pictures"));
    assert!(one.summary.contains("to an IoU of 1 when it is exact"), "{}", one.summary);
}

#[test]
fn every_setting_changes_the_maps_and_threads_change_no_error() {
    let folder = Folder::new();
    let files = [folder.presses("a.safetensors", 3, 4)];
    let report = folder.measured(&files, &[], 1);
    let settings = &report.networks[0].settings;
    let names: Vec<&str> = settings.iter().map(|setting| setting.setting.as_str()).collect();
    for expected in ["winograd 2x2", "tolerance 0.2", "every 2nd frame", "winograd 4x4 + tolerance 0.1"] {
        assert!(names.contains(&expected), "{expected}: {names:?}");
    }
    for setting in &settings[1..] {
        assert!(setting.measurement.numerical.max > 0.0, "{}", setting.setting);
    }
    let seldom = setting(&report, "every 2nd frame");
    assert_eq!(seldom.measurement.entered, 0.5);
    assert!(seldom.measurement.multiply_adds < setting(&report, "exact").measurement.multiply_adds);
    let kept = setting(&report, "tolerance 0.2").measurement.rows;
    assert!(kept <= setting(&report, "tolerance 0.02").measurement.rows);
    let errors = |report: &Report| -> Vec<_> {
        let settings = report.networks[0].settings.iter();
        settings
            .map(|setting| (setting.measurement.task.clone(), setting.measurement.numerical.clone()))
            .collect()
    };
    assert_eq!(errors(&report), errors(&folder.measured(&files, &[], 3)));
}

#[test]
fn an_answer_stands_for_the_picture_after_it() {
    let folder = Folder::new();
    let file = folder.presses("a.safetensors", 2, 4);
    let report = folder.measured(std::slice::from_ref(&file), &["every 2nd frame"], 2);
    // The same presses, but pictures 1 and 3 equal the pictures before them.
    let bytes = std::fs::read(&file).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let mut pictures = tensors.tensor("picture").unwrap().data().to_vec();
    for press in pictures.chunks_exact_mut(4 * 3 * PIXELS) {
        for pair in press.chunks_exact_mut(2 * 3 * PIXELS) {
            let (first, second) = pair.split_at_mut(3 * PIXELS);
            second.copy_from_slice(first);
        }
    }
    let floats = |name: &str| -> Vec<f32> {
        let view = tensors.tensor(name).unwrap();
        view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
    };
    let mut same = TensorFile::new([].into());
    same.u8("picture", &[8, 24, 32, 3], &pictures);
    same.u8("reference", &[2, 24, 32, 3], tensors.tensor("reference").unwrap().data());
    same.f32("force", &[8, 24, 32], &floats("force"));
    same.f32("pixel_mm", &[2], &floats("pixel_mm"));
    same.i64("start", &[3], &[0, 4, 8]);
    let expected = folder.judged(&folder.written("same.safetensors", same));
    assert_eq!(setting(&report, "every 2nd frame").error, 1.0 - expected.iou.mean);
}

#[test]
fn presses_of_one_picture_leave_nothing_out_and_presses_without_contact_have_an_error() {
    let folder = Folder::new();
    let single = folder.measured(&[folder.presses("single.safetensors", 2, 1)], &[], 1);
    let names: Vec<&str> =
        single.networks[0].settings.iter().map(|setting| setting.setting.as_str()).collect();
    assert_eq!(names, ["exact", "winograd 2x2", "winograd 4x4"]);
    assert!(single.notes.iter().any(|note| note.contains("no press has a second picture")));

    // Presses of different length, one of them without a picture.
    let file = folder.silent(&[3, 0, 1]);
    let silent = folder.measured(std::slice::from_ref(&file), &["tolerance", "every"], 2);
    let exact = setting(&silent, "exact");
    assert_eq!(exact.error, 1.0 - folder.judged(&file).iou.mean);
    for setting in &silent.networks[0].settings {
        let task = &setting.measurement.task;
        // All pictures are equal, so their error is known exactly, independent of the omitted ones.
        assert_eq!(
            (setting.error, task[0].trials, task[1].trials),
            (exact.error, 4, 4),
            "{}",
            setting.setting
        );
        assert_eq!(task[0].interval_95, Some((exact.error, exact.error)), "{}", setting.setting);
    }
}

#[test]
fn no_pictures_and_pictures_of_another_size_are_refused_before_anything_is_measured() {
    let folder = Folder::new();
    let refused = |files: &[PathBuf], networks: &[String]| {
        let workers = workers(1);
        let request = Request { networks, weights: None, trainings: None };
        let request = if networks == folder.networks { folder.request() } else { request };
        let options = Options { timed: None, repeats: 1, only: Vec::new() };
        area(files, request, &options, &workers).err().expect("it is refused").to_string()
    };
    let error = refused(&[folder.silent(&[0, 0])], &folder.networks);
    assert!(error.contains("expected pictures, found"), "{error}");
    let error = refused(&[folder.silent(&[1])], &["canf-plain".to_owned()]);
    assert!(error.contains("pictures of 320 x 240 pixels, for canf-plain"), "{error}");
}
