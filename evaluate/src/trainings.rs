//! Networks that are judged, and their trainings.
//!
//! Input: names of networks or description files; weights, a folder of trainings, or the shipped
//! weights. Output: each network with its trainings, and the data that these have not seen.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use meissner_models::{AnyDescription, TensorFile, Weights};
use meissner_run::RunError;
use meissner_run::model::{WeightsFile, labelled, weights};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{EvaluateError, RequestPart, Result, TrainingError, weights_error};

/// The split of a data set for a cross-validation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// All windows of a recording are in one fold.
    Recordings,
    /// Windows of one recording are in different folds.
    Windows,
}

/// The part of a data set that a fold held out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldOut {
    /// The scheme of its cross-validation.
    pub scheme: Scheme,
    /// Names of recordings, each with the index of a window; `None` for all of its windows.
    pub parts: Vec<(String, Option<usize>)>,
}

/// A task that networks are trained for, with a labelled data set.
pub trait Task {
    /// Description of a network of this task.
    type Description;
    /// Beginning of the names of its shipped networks.
    const PREFIX: &'static str;

    /// The description of a shipped network or in a file, and whether it is shipped.
    ///
    /// # Errors
    /// There is no such network, or it is for another task.
    fn describe(network: &str) -> Result<(Self::Description, bool)>;

    /// The name of the network.
    fn name(description: &Self::Description) -> &str;

    /// The network that the weights of `network` were trained as.
    fn trained_as(network: &str) -> &str {
        network
    }

    /// The part that a training held out by its metadata; `None` for a whole training, which every
    /// training is by default: a file of data is then unseen as a whole.
    ///
    /// # Errors
    /// The metadata do not state which part of the data set is unseen.
    fn held_out(_: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        Ok(None)
    }
}

/// The requested networks and trainings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Request<'a> {
    /// Names of shipped networks or description files; none for every shipped network of the task.
    pub networks: &'a [String],
    /// Weights of the only network.
    pub weights: Option<WeightsFile<'a>>,
    /// Folder of trainings, each a safetensors file with metadata.
    pub trainings: Option<&'a Path>,
}

/// Figures of networks, and their outputs.
#[expect(missing_docs, reason = "the names say it")]
pub struct Evaluation<R> {
    pub report: R,
    /// Outputs of the trainings: a tensor for each.
    pub logits: TensorFile,
    pub took: Duration,
}

/// A network with its trainings, at least one, by seed and then by file.
pub(crate) struct EvaluatedNetwork<D> {
    pub(crate) description: D,
    pub(crate) trainings: Vec<Arc<Training>>,
}

/// The networks of a task, and notes about trainings that are left out.
pub(crate) type Candidates<T> = (Vec<EvaluatedNetwork<<T as Task>::Description>>, Vec<String>);

/// Weights with the data that they were trained on.
#[derive(Clone, Debug)]
pub(crate) struct Training {
    /// The file; empty for shipped weights.
    pub(crate) path: PathBuf,
    /// Source of the weights, with their own remark about themselves.
    pub(crate) label: String,
    /// The network that they were trained as.
    pub(crate) network: String,
    /// Seed of the training, where the weights state it.
    pub(crate) seed: Option<i64>,
    /// The part that a fold held out; `None` for a whole training.
    pub(crate) held_out: Option<HeldOut>,
    pub(crate) weights: Weights,
}

/// The networks of `request` by name, and notes about trainings that are left out.
pub(crate) fn candidates<T: Task>(request: Request<'_>) -> Result<Candidates<T>> {
    let descriptions = descriptions::<T>(request.networks)?;
    if let Some(folder) = request.trainings {
        return from_folder::<T>(folder, descriptions, !request.networks.is_empty());
    }
    if let (Some(_), 2..) = (request.weights, descriptions.len()) {
        return Err(EvaluateError::OneNetwork { found: descriptions.len() });
    }
    let candidate = |(description, shipped): (T::Description, bool)| {
        let training = Training::whole(T::name(&description), shipped, request.weights)?;
        Ok(EvaluatedNetwork { description, trainings: vec![Arc::new(training)] })
    };
    Ok((descriptions.into_iter().map(candidate).collect::<Result<_>>()?, Vec::new()))
}

/// The descriptions with these names or in these files, and whether they are shipped.
fn descriptions<T: Task>(names: &[String]) -> Result<Vec<(T::Description, bool)>> {
    let shipped = AnyDescription::shipped_names().filter(|name| name.starts_with(T::PREFIX));
    let names = if names.is_empty() { shipped.map(str::to_owned).collect() } else { names.to_vec() };
    if names.is_empty() {
        let expected = "a description file, as no shipped network is for the task";
        return Err(EvaluateError::request(RequestPart::Networks, expected, "none"));
    }
    let mut descriptions: Vec<(T::Description, bool)> = Vec::new();
    for name in &names {
        let (description, shipped) = T::describe(name)?;
        if descriptions.iter().any(|(other, _)| T::name(other) == T::name(&description)) {
            return Err(EvaluateError::twice(name));
        }
        descriptions.push((description, shipped));
    }
    Ok(descriptions)
}

/// The networks with their trainings in `folder`. A network that was `named` must have one.
fn from_folder<T: Task>(
    folder: &Path,
    descriptions: Vec<(T::Description, bool)>,
    named: bool,
) -> Result<Candidates<T>> {
    let trainings = files(folder)?.into_iter().map(|path| Ok(Arc::new(Training::load::<T>(&path)?)));
    let trainings = trainings.collect::<Result<Vec<Arc<Training>>>>()?;
    let none = |expected: String| {
        let mut found: Vec<&str> = trainings.iter().map(|training| training.network.as_str()).collect();
        found.sort_unstable();
        found.dedup();
        let found = if found.is_empty() { "no such file".to_owned() } else { found.join(", ") };
        EvaluateError::NoTrainings { folder: folder.to_owned(), expected, found }
    };
    let trained_as =
        |(description, _): &(T::Description, bool)| T::trained_as(T::name(description)).to_owned();
    let names: Vec<String> = descriptions.iter().map(trained_as).collect();
    let (mut candidates, mut notes) = (Vec::new(), Vec::new());
    for ((description, _), name) in descriptions.into_iter().zip(&names) {
        let own = trainings.iter().filter(|training| training.network == *name).map(Arc::clone);
        let mut own: Vec<_> = own.collect();
        own.sort_by(|a, b| (a.seed, &a.path).cmp(&(b.seed, &b.path)));
        seeds_differ(&own)?;
        match own.is_empty() {
            true if named => return Err(none(name.clone())),
            true => notes.push(format!("{}: no training in {}", T::name(&description), folder.display())),
            false => candidates.push(EvaluatedNetwork { description, trainings: own }),
        }
    }
    if candidates.is_empty() {
        return Err(none(names.join(", ")));
    }
    for training in trainings.iter().filter(|training| !names.contains(&training.network)) {
        notes.push(format!("{}: network {} is not judged", training.path.display(), training.network));
    }
    Ok((candidates, notes))
}

/// `Ok` where no two whole trainings, in the order of their seeds, have the same seed.
fn seeds_differ(trainings: &[Arc<Training>]) -> Result<()> {
    let whole: Vec<_> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
    let Some(pair) = whole.windows(2).find(|pair| pair[0].seed == pair[1].seed) else { return Ok(()) };
    let (network, seed) = (pair[1].network.clone(), seed_name(pair[1].seed));
    Err(pair[1].refused(TrainingError::Twice { network, seed, other: pair[0].path.clone() }))
}

/// The safetensors files in `folder`, by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let list = || -> std::io::Result<Vec<PathBuf>> {
        std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    let mut files = list().map_err(|source| RunError::file("open", folder, source))?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "safetensors"));
    files.sort();
    Ok(files)
}

/// A seed as text: "shipped" where the weights state none.
pub fn seed_name(seed: Option<i64>) -> String {
    seed.map_or_else(|| "shipped".to_owned(), |seed| seed.to_string())
}

impl<D> EvaluatedNetwork<D> {
    /// Source of the weights, in one line.
    pub(crate) fn weights(&self) -> String {
        let folds = self.trainings.iter().filter(|training| training.held_out.is_some()).count();
        match &self.trainings[..] {
            [training] => training.label.clone(),
            trainings => format!("{} trainings, {folds} folds of cross-validations", trainings.len() - folds),
        }
    }

    /// The common stride of the trainings: each takes one of so many events.
    pub(crate) fn stride(&self) -> Result<usize> {
        let first = &self.trainings[0];
        let expected = first.stride()?;
        for training in &self.trainings[1..] {
            let found = training.stride()?;
            if found != expected {
                let other = first.path.clone();
                return Err(training.refused(TrainingError::Stride { expected, other, found }));
            }
        }
        Ok(expected)
    }
}

impl Training {
    /// The weights in `file`, or those `shipped` with `network`, as a whole training.
    fn whole(network: &str, shipped: bool, file: Option<WeightsFile<'_>>) -> Result<Self> {
        let (weights, label) = weights(network, shipped, file).map_err(|error| match error {
            RunError::NoWeights(network) => EvaluateError::NeedsTrainings(network),
            error => error.into(),
        })?;
        let metadata = Metadata(weights.metadata());
        let path = file.map(|file| file.path.to_owned()).unwrap_or_default();
        if metadata.0.contains_key("held_out") {
            return Err(EvaluateError::WeightsOfFold(path));
        }
        let (network, seed) = (network.to_owned(), metadata.integer("seed").ok().flatten());
        Ok(Self { path, label: labelled(label, &weights), network, seed, held_out: None, weights })
    }

    fn load<T: Task>(path: &Path) -> Result<Self> {
        let label = path.display().to_string();
        let weights = Weights::load(path).map_err(weights_error(&label))?;
        let metadata = Metadata(weights.metadata());
        let read = || {
            let network = metadata.0.get("network").filter(|network| !network.is_empty());
            let network = network.ok_or_else(|| metadata.refused("network", "with a network's name"))?;
            let seed = metadata.integer("seed")?;
            let seed = seed.ok_or_else(|| metadata.refused("seed", "with a whole number"))?;
            metadata.integer("fold")?;
            Ok((network.clone(), seed, T::held_out(metadata)?))
        };
        let (network, seed, held_out) =
            read().map_err(|source| EvaluateError::Training { path: path.to_owned(), source })?;
        let label = labelled(label, &weights);
        Ok(Self { path: path.to_owned(), label, network, seed: Some(seed), held_out, weights })
    }

    /// The path as text; none for shipped weights.
    pub(crate) fn files(&self) -> Vec<String> {
        let path = Some(self.path.display().to_string()).filter(|path| !path.is_empty());
        path.into_iter().collect()
    }

    /// The stride of the training: it took one of so many events.
    pub(crate) fn stride(&self) -> Result<usize> {
        Ok(self.weights.card().map_err(weights_error(&self.label))?.stride)
    }

    pub(crate) fn refused(&self, source: TrainingError) -> EvaluateError {
        EvaluateError::Training { path: self.path.clone(), source }
    }
}

/// The metadata of a file of weights.
#[derive(Clone, Copy, Debug)]
pub struct Metadata<'a>(pub &'a BTreeMap<String, String>);

impl Metadata<'_> {
    /// The value of `key` is not as `expected`.
    pub(crate) fn refused(self, key: &'static str, expected: &'static str) -> TrainingError {
        let found = self.0.get(key).map_or_else(|| "none".to_owned(), |text| format!("{text:?}"));
        TrainingError::Metadata { key, expected, found }
    }

    /// The whole number of `key`, if the key exists.
    pub(crate) fn integer(self, key: &'static str) -> Result<Option<i64>, TrainingError> {
        let number = self.0.get(key).map(|text| text.parse());
        number.transpose().map_err(|_| self.refused(key, "with a whole number"))
    }

    /// The recordings that a fold held out: the JSON list of the key `held_out`.
    pub(crate) fn recordings(self, expected: &'static str) -> Result<HeldOut, TrainingError> {
        let names: Vec<String> = self.list("held_out", expected)?;
        let parts = names.into_iter().map(|name| (name, None)).collect();
        Ok(HeldOut { scheme: Scheme::Recordings, parts })
    }

    /// The JSON list of `key`.
    pub(crate) fn list<T: DeserializeOwned>(
        self,
        key: &'static str,
        expected: &'static str,
    ) -> Result<Vec<T>, TrainingError> {
        let list = self.0.get(key).and_then(|text| serde_json::from_str(text).ok());
        list.ok_or_else(|| self.refused(key, expected))
    }
}

/// A task that networks are judged on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskName {
    /// Digits in front of a moving event camera.
    Digits,
    /// Objects under a tactile skin.
    Objects,
    /// Containers under a tactile skin.
    Containers,
    /// Letters of braille under a tactile skin.
    Letters,
    /// Direction of slip.
    Slip,
    /// Angles of a contact, and other quantities of presses.
    Angle,
    /// Contact area and normal force.
    Area,
    /// Force of a grasp.
    Force,
}

impl TaskName {
    /// All tasks.
    pub const ALL: [Self; 8] = [
        Self::Digits,
        Self::Objects,
        Self::Containers,
        Self::Letters,
        Self::Slip,
        Self::Angle,
        Self::Area,
        Self::Force,
    ];

    /// Its name, one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Digits => "digits",
            Self::Objects => "objects",
            Self::Containers => "containers",
            Self::Letters => "letters",
            Self::Slip => "slip",
            Self::Angle => "angle",
            Self::Area => "area",
            Self::Force => "force",
        }
    }

    /// The task called `name`.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|task| task.name() == name)
    }
}
