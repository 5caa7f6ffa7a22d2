//! What can be wrong with the file of a training.

use std::path::PathBuf;

use meissner_models::systems::slip::ObjectSet;
use thiserror::Error;

/// A file of a training does not fit the evaluation.
#[derive(Debug, Error)]
pub(crate) enum TrainingError {
    /// It does not say what it is, or says it in another way.
    #[error("expected metadata {key:?} {expected}, found {found}")]
    Metadata {
        /// The key.
        key: &'static str,
        /// What should stand there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// It held out a recording that the data does not have.
    #[error("expected held-out recordings of the data set, found {found:?}")]
    Recording {
        /// The recording.
        found: String,
    },
    /// It held out a recording that it would not have been trained on.
    #[error(
        "expected held-out recordings of the set Basic, which it was trained on, found {found:?} of {set}"
    )]
    OtherSet {
        /// The recording.
        found: String,
        /// The set of its object.
        set: ObjectSet,
    },
    /// It held out a window that its recording does not have.
    #[error("expected held-out windows of {recording:?} from 0 to below {windows}, found {found}")]
    Window {
        /// The recording.
        recording: String,
        /// How many windows it has.
        windows: usize,
        /// The window.
        found: usize,
    },
    /// It held out a window twice, or one that another fold held out.
    #[error(
        "expected folds that hold out different windows, found window {window} of {recording:?} again, which {} holds out",
        first.display()
    )]
    Overlap {
        /// The recording.
        recording: String,
        /// The window.
        window: usize,
        /// The fold that held it out before.
        first: PathBuf,
    },
    /// It held out a recording twice, or one that another fold held out.
    #[error(
        "expected folds that hold out different recordings, found {recording:?} again, which {} holds out",
        first.display()
    )]
    Again {
        /// The recording.
        recording: String,
        /// The fold that held it out before.
        first: PathBuf,
    },
    /// The folds of a seed leave out a recording.
    #[error(
        "expected folds of network {network} and seed {seed} that hold out each of {recordings} recordings, found {found} \
         and not {missing:?}"
    )]
    Incomplete {
        /// The network.
        network: String,
        /// The seed.
        seed: String,
        /// How many recordings there are.
        recordings: usize,
        /// How many are held out.
        found: usize,
        /// The first one that is not.
        missing: String,
    },
    /// It held out other recordings than a fold has.
    #[error(
        "expected the {expected} recordings of one fold of {count}, as `prepare digits --folds {count}` writes them, found \
         {found} recordings of {folds} folds"
    )]
    OtherFold {
        /// Number of folds.
        count: usize,
        /// Recordings of the fold that holds the first.
        expected: usize,
        /// Recordings that it held out.
        found: usize,
        /// In how many folds they are.
        folds: usize,
    },
    /// It was trained on another share of the events than the others of its network.
    #[error("expected metadata \"stride\" {expected}, as {} has it, found {found}; or add --stride N", other.display())]
    Stride {
        /// The other's.
        expected: usize,
        /// The other file.
        other: PathBuf,
        /// Its own.
        found: usize,
    },
    /// Another file is the same training.
    #[error("expected one whole training of network {network} with seed {seed}, found {} too", other.display())]
    Twice {
        /// The network.
        network: String,
        /// The seed.
        seed: String,
        /// The other file.
        other: PathBuf,
    },
}
