//! Which networks are judged, with which trainings.

use std::path::Path;

use meissner_models::systems::slip::SlipWindows;
use meissner_models::{FrameDescription, Weights};

use super::training::Training;
use crate::error::CliError;
use crate::trainings::{TrainingError, files};
use meissner_pipeline::model::describe_frames;

/// How the shipped networks of this system are called.
const PREFIX: &str = "slip-";

/// A network, and its trainings by seed and file.
pub(crate) struct Candidate {
    pub(crate) description: FrameDescription,
    pub(crate) trainings: Vec<Training>,
}

/// The networks with these names or description files, with their trainings in a folder or what is shipped with them, in the order in which they are named; and what to say about what is left out.
pub(crate) fn candidates(
    networks: &[String],
    trainings: Option<&Path>,
) -> Result<(Vec<Candidate>, Vec<String>), CliError> {
    let shipped = FrameDescription::shipped_names().iter().copied().filter(|name| name.starts_with(PREFIX));
    let names = match networks {
        [] => shipped.map(str::to_owned).collect(),
        names => names.to_vec(),
    };
    let mut descriptions: Vec<(FrameDescription, bool)> = Vec::new();
    for name in &names {
        let (description, shipped) = describe_frames(name)?;
        SlipWindows::new(&description)?;
        if descriptions.iter().any(|(other, _)| other.name() == description.name()) {
            let (expected, found) = ("each network once".to_owned(), format!("{name} again"));
            return Err(CliError::Option { option: "--network", expected, found });
        }
        descriptions.push((description, shipped));
    }
    match trainings {
        None => Ok((descriptions.into_iter().map(of_shipped).collect::<Result<_, _>>()?, Vec::new())),
        Some(folder) => of_folder(folder, descriptions, !networks.is_empty()),
    }
}

fn of_shipped((description, shipped): (FrameDescription, bool)) -> Result<Candidate, CliError> {
    let name = description.name();
    let weights = Weights::shipped(name).filter(|_| shipped);
    let weights = weights.ok_or_else(|| CliError::NeedsTrainings(name.to_owned()))?;
    Ok(Candidate { trainings: vec![Training::shipped(name, weights)], description })
}

/// The networks with their trainings in `folder`. One that was `asked` for must have some.
fn of_folder(
    folder: &Path,
    descriptions: Vec<(FrameDescription, bool)>,
    asked: bool,
) -> Result<(Vec<Candidate>, Vec<String>), CliError> {
    let mut trainings = Vec::new();
    for path in files(folder)? {
        trainings.push(Training::load(&path)?);
    }
    let mut found: Vec<String> = trainings.iter().map(|training| training.network.clone()).collect();
    found.sort_unstable();
    found.dedup();
    let none = |expected: String| CliError::NoTrainings {
        folder: folder.to_owned(),
        expected,
        found: if found.is_empty() { "no such file".to_owned() } else { found.join(", ") },
    };
    let mut candidates = Vec::new();
    let mut notes = Vec::new();
    let names: Vec<String> =
        descriptions.iter().map(|(description, _)| description.name().to_owned()).collect();
    for (description, _) in descriptions {
        let (mut own, others): (Vec<_>, Vec<_>) =
            trainings.into_iter().partition(|training| training.network == description.name());
        trainings = others;
        own.sort_by(|a, b| (a.seed, &a.path).cmp(&(b.seed, &b.path)));
        match twice(&own) {
            Some(error) => return Err(error),
            None if own.is_empty() && asked => return Err(none(description.name().to_owned())),
            None if own.is_empty() => {
                notes.push(format!("{}: no training in {}", description.name(), folder.display()));
            }
            None => candidates.push(Candidate { description, trainings: own }),
        }
    }
    if candidates.is_empty() {
        return Err(none(names.join(", ")));
    }
    for training in trainings {
        notes.push(format!("{}: network {} is not judged", training.path.display(), training.network));
    }
    Ok((candidates, notes))
}

/// The first whole training that has the seed of another.
fn twice(trainings: &[Training]) -> Option<CliError> {
    let whole: Vec<&Training> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
    let pair = whole.windows(2).find(|pair| pair[0].seed == pair[1].seed)?;
    let (network, seed) = (pair[1].network.clone(), pair[1].seed_name());
    let source = TrainingError::Twice { network, seed, other: pair[0].path.clone() };
    Some(CliError::Training { path: pair[1].path.clone(), source })
}
