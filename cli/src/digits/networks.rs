//! Which networks are judged, with which trainings.

use std::path::Path;
use std::rc::Rc;

use meissner_models::systems::digits::{check, trained_as};
use meissner_models::{Description, Weights};

use super::training::{Training, seed_name};
use crate::error::CliError;
use crate::trainings::{TrainingError, files};
use meissner_pipeline::model::describe;

/// How the shipped networks of this system are called.
const PREFIX: &str = "digits-";

/// What is asked for on the command line.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    /// Names or description files; none for every shipped network of this system.
    pub(crate) networks: &'a [String],
    pub(crate) weights: Option<&'a Path>,
    /// A folder of trainings.
    pub(crate) trainings: Option<&'a Path>,
    /// Every `stride`-th event, whatever the weights say.
    pub(crate) stride: Option<usize>,
}

/// A network, its trainings by seed and file, which take every `stride`-th event.
pub(crate) struct Candidate {
    pub(crate) description: Description,
    pub(crate) trainings: Vec<Rc<Training>>,
    pub(crate) stride: usize,
}

/// The networks that are asked for, in the order in which they are named; and what to say about what is left out.
pub(crate) fn candidates(asked: Asked<'_>) -> Result<(Vec<Candidate>, Vec<String>), CliError> {
    let descriptions = descriptions(asked.networks)?;
    let (trained, notes) = match (asked.trainings, asked.weights) {
        (Some(folder), _) => of_folder(folder, descriptions, !asked.networks.is_empty())?,
        (None, Some(path)) => (vec![given(path, descriptions)?], Vec::new()),
        (None, None) => (descriptions.into_iter().map(of_shipped).collect::<Result<_, _>>()?, Vec::new()),
    };
    let candidates = trained.into_iter().map(|(description, trainings)| {
        let stride = match asked.stride {
            Some(stride) => stride,
            None => common_stride(&trainings)?,
        };
        Ok(Candidate { description, trainings, stride })
    });
    Ok((candidates.collect::<Result<_, CliError>>()?, notes))
}

/// A network with its trainings.
type Trained = (Description, Vec<Rc<Training>>);

/// The descriptions that these names or files have, and whether they are shipped.
fn descriptions(names: &[String]) -> Result<Vec<(Description, bool)>, CliError> {
    let shipped = Description::shipped_names().iter().filter(|name| name.starts_with(PREFIX));
    let names = match names {
        [] => shipped.map(|&name| name.to_owned()).collect(),
        names => names.to_vec(),
    };
    if names.is_empty() {
        let (expected, found) =
            ("a network that tells digits".to_owned(), "none, and none is shipped".to_owned());
        return Err(CliError::Option { option: "--network", expected, found });
    }
    let mut descriptions: Vec<(Description, bool)> = Vec::new();
    for name in &names {
        let (description, shipped) = describe(name)?;
        check(&description)?;
        if descriptions.iter().any(|(other, _)| other.name() == description.name()) {
            let (expected, found) = ("each network once".to_owned(), format!("{name} again"));
            return Err(CliError::Option { option: "--network", expected, found });
        }
        descriptions.push((description, shipped));
    }
    Ok(descriptions)
}

fn of_shipped((description, shipped): (Description, bool)) -> Result<Trained, CliError> {
    let name = description.name();
    let weights = Weights::shipped(name).filter(|_| shipped);
    let weights = weights.ok_or_else(|| CliError::NeedsTrainings(name.to_owned()))?;
    let training = Training::shipped(name, weights)?;
    Ok((description, vec![Rc::new(training)]))
}

/// The one network with the weights in the file at `path`.
fn given(path: &Path, mut descriptions: Vec<(Description, bool)>) -> Result<Trained, CliError> {
    match (descriptions.pop(), descriptions.len()) {
        (Some((description, _)), 0) => {
            let training = Training::given(path, description.name())?;
            Ok((description, vec![Rc::new(training)]))
        }
        (_, others) => {
            let (expected, found) = ("one --network".to_owned(), format!("{} networks", others + 1));
            Err(CliError::Option { option: "--weights", expected, found })
        }
    }
}

/// The networks with their trainings in `folder`. One that was `asked` for must have some.
fn of_folder(
    folder: &Path,
    descriptions: Vec<(Description, bool)>,
    asked: bool,
) -> Result<(Vec<Trained>, Vec<String>), CliError> {
    let mut trainings = Vec::new();
    for path in files(folder)? {
        trainings.push(Rc::new(Training::load(&path)?));
    }
    trainings.sort_by(|a, b| (a.seed, &a.path).cmp(&(b.seed, &b.path)));
    let mut found: Vec<&str> = trainings.iter().map(|training| training.network.as_str()).collect();
    found.sort_unstable();
    found.dedup();
    let none = |expected: String| CliError::NoTrainings {
        folder: folder.to_owned(),
        expected,
        found: if found.is_empty() { "no such file".to_owned() } else { found.join(", ") },
    };
    let names: Vec<String> =
        descriptions.iter().map(|(description, _)| trained_as(description.name()).to_owned()).collect();
    let mut trained = Vec::new();
    let mut notes = Vec::new();
    for ((description, _), name) in descriptions.into_iter().zip(&names) {
        let own: Vec<_> =
            trainings.iter().filter(|training| training.network == *name).map(Rc::clone).collect();
        match twice(&own) {
            Some(error) => return Err(error),
            None if own.is_empty() && asked => return Err(none(name.clone())),
            None if own.is_empty() => {
                notes.push(format!("{}: no training in {}", description.name(), folder.display()));
            }
            None => trained.push((description, own)),
        }
    }
    if trained.is_empty() {
        return Err(none(names.join(", ")));
    }
    for training in trainings.iter().filter(|training| !names.contains(&training.network)) {
        notes.push(format!("{}: network {} is not judged", training.path.display(), training.network));
    }
    Ok((trained, notes))
}

/// The first whole training that has the seed of another.
fn twice(trainings: &[Rc<Training>]) -> Option<CliError> {
    let whole: Vec<_> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
    let pair = whole.windows(2).find(|pair| pair[0].seed == pair[1].seed)?;
    let (network, seed) = (pair[1].network.clone(), seed_name(pair[1].seed));
    let source = TrainingError::Twice { network, seed, other: pair[0].path.clone() };
    Some(CliError::Training { path: pair[1].path.clone(), source })
}

/// The stride that all trainings say.
fn common_stride(trainings: &[Rc<Training>]) -> Result<usize, CliError> {
    let Some(first) = trainings.first() else { return Ok(1) };
    match trainings.iter().find(|training| training.stride != first.stride) {
        None => Ok(first.stride),
        Some(other) => {
            let (expected, found) = (first.stride, other.stride);
            let source = TrainingError::Stride { expected, other: first.path.clone(), found };
            Err(CliError::Training { path: other.path.clone(), source })
        }
    }
}
