//! Errors of data sets, trainings and measurements.

use std::io;
use std::path::PathBuf;

use meissner_engine::EngineError;
use meissner_io::datasets::DatasetError;
use meissner_models::ModelError;
use meissner_models::systems::digits::DigitsError;
use meissner_models::systems::slip::{ObjectSet, SlipError};
use meissner_pipeline::PipelineError;
use meissner_simulator::SimulatorError;
use safetensors::SafeTensorError;
use thiserror::Error;

/// A network cannot be judged or measured, or an input for training cannot be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// A network or its weights cannot be read or cannot run.
    #[error(transparent)]
    Pipeline(Box<PipelineError>),
    /// A data set is missing or has another layout; the source names the path.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An image is larger than any sensor.
    #[error("{}: expected at most 65535 x 65535 pixels, found {width} x {height}", path.display())]
    ImageSize {
        /// The image.
        path: PathBuf,
        /// Its columns.
        width: usize,
        /// Its rows.
        height: usize,
    },
    /// The simulator refuses its settings or its input.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// A network or a recording does not belong to direction of slip; the source names it.
    #[error(transparent)]
    Slip(#[from] SlipError),
    /// A network does not predict digits, or a cross-validation cannot have so many folds.
    #[error(transparent)]
    Digits(#[from] DigitsError),
    /// A recording of a slip cannot be cut into windows.
    #[error("recording {recording}")]
    SlipRecording {
        /// Name of the recording.
        recording: String,
        /// The cause.
        source: SlipError,
    },
    /// The data set has no recordings for whole trainings.
    #[error("{}: expected recordings of the split test, which whole trainings are judged on, found none", folder.display())]
    NoTestSplit {
        /// Folder of the data set.
        folder: PathBuf,
    },
    /// All recordings are of objects that the networks were trained on.
    #[error("data set: expected recordings of unseen objects, found Basic alone")]
    NoUnseenObjects,
    /// The recording has no events in the part that is measured.
    #[error("recording: expected events to measure, found none")]
    NoEvents,
    /// A network was named twice.
    #[error("expected each network once, found {0} again")]
    NetworkTwice(String),
    /// Weights were given for several networks.
    #[error("weights: expected one network, found {found} networks")]
    OneNetwork {
        /// Number of networks.
        found: usize,
    },
    /// The given weights are those of a fold.
    #[error("weights {}: expected a whole training, found a fold", .0.display())]
    WeightsOfFold(PathBuf),
    /// The weights were trained on every this many events one; the study pushes all events.
    #[error(
        "network {network}: expected weights that were trained on every event, found \"stride\" {stride}"
    )]
    Stride {
        /// The network.
        network: String,
        /// Its stride.
        stride: usize,
    },
    /// A training does not fit the task, the data set or the other trainings.
    #[error("training {}", path.display())]
    Training {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: TrainingError,
    },
    /// A folder has no training of the networks.
    #[error("{}: expected safetensors files with metadata \"network\" = {expected}, found {found}", folder.display())]
    NoTrainings {
        /// The folder.
        folder: PathBuf,
        /// The networks.
        expected: String,
        /// The networks that it has trainings of.
        found: String,
    },
    /// A network has folds, and no whole training.
    #[error("expected a whole training of {0}, found folds alone")]
    NoWholeTraining(String),
    /// A description file has no shipped weights.
    #[error("network {0}: a description file comes without weights")]
    NeedsTrainings(String),
    /// A file of streams does not fit.
    #[error("{}", path.display())]
    Streams {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: StreamsError,
    },
    /// No setting of any network has one of the names that were asked for.
    #[error(
        "settings: expected a part of \"NETWORK, SETTING\", with a setting such as {settings}, found {found}"
    )]
    NoSetting {
        /// The settings of the first network.
        settings: String,
        /// The names that were asked for.
        found: String,
    },
    /// A line of finished measurements cannot be read.
    #[error("{}: line {line}: expected a finished measurement", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1 on.
        line: usize,
        /// The cause.
        source: serde_json::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

impl From<PipelineError> for EvaluateError {
    fn from(error: PipelineError) -> Self {
        Self::Pipeline(Box::new(error))
    }
}

impl From<EngineError> for EvaluateError {
    fn from(error: EngineError) -> Self {
        PipelineError::Engine(error).into()
    }
}

/// The error of weights that `label` names.
pub(crate) fn weights_error(label: &str) -> impl Fn(ModelError) -> EvaluateError + '_ {
    |source| PipelineError::weights(label.to_owned(), source).into()
}

/// A file of streams of events cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StreamsError {
    /// It is no safetensors file.
    #[error("expected a safetensors file")]
    Format(#[from] SafeTensorError),
    /// A tensor is missing or has another type or shape.
    #[error("tensor {tensor}: expected {expected}, found {found}")]
    Tensor {
        /// Name of the tensor.
        tensor: &'static str,
        /// Type and shape that fit.
        expected: String,
        /// Type and shape of the tensor.
        found: String,
    },
    /// The metadata have no size of the sensor.
    #[error("metadata sensor: expected JSON [width, height] of 1 to 65535 pixels, found {0}")]
    Sensor(String),
    /// A bound of a stream or an event is impossible.
    #[error("{list} {index}: expected {expected}, found {found}")]
    Value {
        /// Name of the list.
        list: &'static str,
        /// Index into the list.
        index: usize,
        /// Values that fit.
        expected: String,
        /// The value.
        found: String,
    },
    /// Tracks of markers do not fit.
    #[error("stream {stream}")]
    Tracks {
        /// Number of the stream, from 0 on.
        stream: usize,
        /// Why.
        source: SimulatorError,
    },
}

/// A training does not fit the task, the data set or the other trainings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainingError {
    /// Its metadata lack a key, or the value has another form.
    #[error("expected metadata {key:?} {expected}, found {found}")]
    Metadata {
        /// The key.
        key: &'static str,
        /// The form of the value.
        expected: &'static str,
        /// The value, or "none".
        found: String,
    },
    /// It held out a recording that is not in the data set.
    #[error("expected held-out recordings of the data set, found {found:?}")]
    Recording {
        /// The recording.
        found: String,
    },
    /// It held out a recording of a set that it was not trained on.
    #[error(
        "expected held-out recordings of the set Basic, which it was trained on, found {found:?} of {set}"
    )]
    OtherSet {
        /// The recording.
        found: String,
        /// The set that holds its object.
        set: ObjectSet,
    },
    /// It held out a window beyond the end of its recording.
    #[error("expected held-out windows of {recording:?} from 0 to below {windows}, found {found}")]
    Window {
        /// The recording.
        recording: String,
        /// Number of windows of the recording.
        windows: usize,
        /// The window.
        found: usize,
    },
    /// A window was held out twice.
    #[error(
        "expected folds that hold out different windows, found window {window} of {recording:?} again, which {} holds out",
        first.display()
    )]
    Overlap {
        /// The recording.
        recording: String,
        /// The window.
        window: usize,
        /// The fold that held it out first.
        first: PathBuf,
    },
    /// A recording was held out twice.
    #[error(
        "expected folds that hold out different recordings, found {recording:?} again, which {} holds out",
        first.display()
    )]
    Again {
        /// The recording.
        recording: String,
        /// The fold that held it out first.
        first: PathBuf,
    },
    /// No fold of a seed held out a recording.
    #[error(
        "expected folds of network {network} and seed {seed} that hold out each of {recordings} recordings, found {found} \
         and not {missing:?}"
    )]
    Incomplete {
        /// The network.
        network: String,
        /// The seed.
        seed: String,
        /// Number of recordings.
        recordings: usize,
        /// Number of recordings that are held out.
        found: usize,
        /// The first recording that is not held out.
        missing: String,
    },
    /// It did not hold out all recordings of one fold, and no others.
    #[error(
        "expected the {expected} recordings of one fold of {count}, as `prepare digits --folds {count}` writes them, found \
         {found} recordings of {folds} folds"
    )]
    OtherFold {
        /// Number of folds.
        count: usize,
        /// Recordings of the fold of the first one.
        expected: usize,
        /// Recordings that it held out.
        found: usize,
        /// Number of folds of these recordings.
        folds: usize,
    },
    /// Trainings of one network have different strides.
    #[error("expected metadata \"stride\" {expected}, as {} has it, found {found}; or add --stride N", other.display())]
    Stride {
        /// Stride of the other training.
        expected: usize,
        /// The other file.
        other: PathBuf,
        /// Its own stride.
        found: usize,
    },
    /// Two files are the same training.
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
