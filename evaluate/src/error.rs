//! Errors of data sets, trainings and measurements. The messages explain the fields of the errors.

use std::path::PathBuf;

use meissner_engine::EngineError;
use meissner_io::IoError;
use meissner_models::ModelError;
use meissner_models::systems::OutputsError;
use meissner_models::systems::slip::SlipError;
use meissner_run::RunError;
use meissner_simulator::SimulatorError;
use safetensors::SafeTensorError;
use thiserror::Error;

/// The result of an evaluation, or its error.
pub type Result<T, E = EvaluateError> = std::result::Result<T, E>;

/// A network cannot be judged or measured, or an input for training cannot be made.
#[derive(Debug, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum EvaluateError {
    /// A network or its weights cannot be read or cannot run.
    #[error(transparent)]
    Run(Box<RunError>),
    /// A data set is missing or has another layout; the source names the path.
    #[error(transparent)]
    Dataset(#[from] IoError),
    /// The evaluation was stopped.
    #[error("it was stopped")]
    Stopped,
    /// An image is larger than any sensor.
    #[error("{}: expected at most 65535 x 65535 pixels, found {width} x {height}", path.display())]
    ImageSize { path: PathBuf, width: usize, height: usize },
    /// The simulator refuses its settings or its input.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// A network or a recording does not belong to the task direction of slip; the source names it.
    #[error(transparent)]
    Slip(#[from] SlipError),
    /// A network does not predict the classes of a task; the source names it.
    #[error(transparent)]
    Outputs(#[from] OutputsError),
    /// A cross-validation cannot have so many folds.
    #[error("folds: expected 2 to {recordings}, the number of recordings, found {found}")]
    Folds { recordings: usize, found: usize },
    /// A recording of a slip cannot be cut into windows.
    #[error("recording {recording}")]
    SlipRecording { recording: String, source: SlipError },
    /// The data set has no recordings for whole trainings.
    #[error("{}: expected recordings of the split test, which whole trainings are judged on, found none", folder.display())]
    NoTestSplit { folder: PathBuf },
    /// A part of the request does not fit the other parts or the data.
    #[error("expected {expected}, found {found}")]
    Request { part: RequestPart, expected: String, found: String },
    /// Weights were given for several networks.
    #[error("weights: expected one network, found {found} networks")]
    OneNetwork { found: usize },
    /// The given weights are those of a fold.
    #[error("weights {}: expected a whole training, found a fold", .0.display())]
    WeightsOfFold(PathBuf),
    /// A training does not fit the task, the data set or the other trainings.
    #[error("training {}", path.display())]
    Training { path: PathBuf, source: TrainingError },
    /// A folder has no training of the networks.
    #[error("{}: expected safetensors files with metadata \"network\" = {expected}, found {found}", folder.display())]
    NoTrainings { folder: PathBuf, expected: String, found: String },
    /// A description file has no shipped weights.
    #[error("network {0}: a description file comes without weights")]
    NeedsTrainings(String),
    /// A file of streams does not fit.
    #[error("{}", path.display())]
    Streams { path: PathBuf, source: StreamsError },
}

/// A part of a request for an evaluation or a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the parts have the names of their options")]
pub enum RequestPart {
    Data,
    Events,
    Folder,
    Pictures,
    Recording,
    Networks,
    Trainings,
    Settings,
    Every,
    Seconds,
    Rate,
    Slower,
    Lost,
    Labels,
    Offset,
    Outputs,
}

impl EvaluateError {
    pub(crate) fn request(part: RequestPart, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Request { part, expected: expected.into(), found: found.into() }
    }

    pub(crate) fn twice(name: &str) -> Self {
        Self::request(RequestPart::Networks, "each network once", format!("{name} again"))
    }
}

impl From<RunError> for EvaluateError {
    fn from(error: RunError) -> Self {
        Self::Run(Box::new(error))
    }
}

impl From<EngineError> for EvaluateError {
    fn from(error: EngineError) -> Self {
        RunError::Engine(error).into()
    }
}

pub(crate) fn weights_error(label: &str) -> impl Fn(ModelError) -> EvaluateError + '_ {
    |source| RunError::weights(label.to_owned(), source).into()
}

/// A file of streams of events cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum StreamsError {
    /// It is no safetensors file.
    #[error("expected a safetensors file")]
    Format(#[from] SafeTensorError),
    /// A tensor is missing or has another type or shape.
    #[error("tensor {tensor}: expected {expected}, found {found}")]
    Tensor { tensor: String, expected: String, found: String },
    /// The metadata have no size of the sensor.
    #[error("metadata sensor: expected JSON [width, height] of 1 to 65535 pixels, found {0}")]
    Sensor(String),
    /// The metadata have units in another form.
    #[error("metadata units: expected JSON {{NAME: unit}}, found {0}")]
    Units(String),
    /// The metadata have no list of names, or one of another length.
    #[error("metadata {key}: expected a JSON list of {expected}, found {found}")]
    Names { key: String, expected: String, found: String },
    /// A bound of a stream or an event is impossible.
    #[error("{list} {index}: expected {expected}, found {found}")]
    Value { list: String, index: usize, expected: String, found: String },
    /// Tracks of markers do not fit.
    #[error("stream {stream}")]
    Tracks { stream: usize, source: SimulatorError },
}

/// A training does not fit the task, the data set or the other trainings.
#[derive(Debug, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum TrainingError {
    /// Its metadata lack a key, or the value has another form.
    #[error("expected metadata {key:?} {expected}, found {found}")]
    Metadata { key: &'static str, expected: &'static str, found: String },
    /// It held out something that is no case of the data set, or that it was trained on.
    #[error("expected held-out {expected}, found {found}")]
    HeldOut { expected: String, found: String },
    /// A recording or a window was held out twice.
    #[error(
        "expected folds that hold out different {parts}, found {again} again, which {} holds out",
        first.display()
    )]
    Overlap { parts: &'static str, again: String, first: PathBuf },
    /// No fold of a seed held out a recording.
    #[error(
        "expected folds of network {network} and seed {seed} that hold out each of {recordings} recordings, found {found} \
         and not {missing:?}"
    )]
    Incomplete { network: String, seed: String, recordings: usize, found: usize, missing: String },
    /// It did not hold out all recordings of one fold, and no others.
    #[error(
        "expected the {expected} recordings of one fold of {count}, as `meissner prepare` writes them with --folds {count}, found \
         {found} recordings of {folds} folds"
    )]
    OtherFold { count: usize, expected: usize, found: usize, folds: usize },
    /// Trainings of one network have different strides.
    #[error("expected metadata \"stride\" {expected}, as {} has it, found {found}; or add --stride N", other.display())]
    Stride { expected: usize, other: PathBuf, found: usize },
    /// Two files are the same training.
    #[error("expected one whole training of network {network} with seed {seed}, found {} too", other.display())]
    Twice { network: String, seed: String, other: PathBuf },
}
