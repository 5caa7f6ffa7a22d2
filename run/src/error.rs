//! Errors of sources, of networks by name, and of runs.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use meissner_engine::EngineError;
use meissner_engine::representations::RepresentationError;
use meissner_io::{Format, IoError};
use meissner_live::LiveError;
use meissner_models::systems::contact_area::ContactError;
use meissner_models::{ModelError, in_part};

use crate::losses::Salvaged;
use crate::schedule::Every;
use crate::text::grouped;

/// The result of a run, or its error.
pub type Result<T, E = RunError> = std::result::Result<T, E>;

/// A source cannot be read, or a network cannot run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum RunError {
    /// The size of the sensor is unknown.
    #[error("{recording}: this {format} recording does not name its geometry")]
    NoGeometry { recording: String, format: String },
    /// A recording cannot be read.
    #[error("{recording}")]
    Recording {
        recording: Box<str>,
        source: Box<IoError>,
        /// The part that can be read, if the recording is truncated.
        salvaged: Option<Box<Salvaged>>,
    },
    /// One of several inputs is a stream, whose first event the others would wait for.
    #[error("{0}: expected recordings, where there are several inputs; found a stream")]
    SeveralStreams(String),
    /// A line of a text is malformed, and the source is strict.
    #[error("{recording}: {problem}")]
    Line { recording: String, problem: String },
    /// Most lines of a text are malformed.
    #[error("{recording}: {problem}")]
    Lines { recording: String, problem: String },
    /// A file cannot be read or written; the source names it.
    #[error(transparent)]
    File(IoError),
    /// A name that is neither a shipped network nor a file.
    #[error("network {name}: found no shipped network and no file of this name{}",
        nearest.map(|nearest| format!("; did you mean {nearest}?")).unwrap_or_default())]
    UnknownNetwork { name: String, nearest: Option<&'static str> },
    /// A description file has no shipped weights.
    #[error("network {0}: a description file comes without weights")]
    NoWeights(String),
    /// A network of another kind was expected.
    #[error("network {network}: expected {expected}, found {found}")]
    OtherNetwork { network: String, expected: String, found: String },
    /// A recording was given; a network was expected.
    #[error("network {network}: expected a description file, found a recording ({format})")]
    IsRecording { network: String, format: Format },
    /// A description cannot be read.
    #[error("network {network}")]
    Description { network: Box<str>, source: Box<ModelError> },
    /// A description or weights cannot be read; the source names the file.
    #[error(transparent)]
    ModelFile(ModelError),
    /// Weights cannot be read, or do not fit.
    #[error("weights {weights}")]
    Weights { weights: Box<str>, source: Box<ModelError> },
    /// Frames cannot be made from the input.
    #[error("network {network}")]
    Frames { network: String, source: RepresentationError },
    /// Predictions would be due between frames, or frames would have no or another period.
    #[error("expected {expected}, found {found}")]
    FramePeriod { expected: String, found: Every },
    /// There would be too many frames.
    #[error("expected at most {} frames, found {found} frames, one every {period_us} us", grouped(*.most))]
    ManyFrames { most: u64, found: u64, period_us: i64 },
    /// The size of a picture differs from the input of the network.
    #[error(
        "{}: expected {}x{} pixels, as network {network} reads them, found {}x{}",
        path.display(), expected.0, expected.1, found.0, found.1
    )]
    PictureSize {
        path: PathBuf,
        network: String,
        /// Width and height of the input of the network.
        expected: (usize, usize),
        /// Width and height of the picture.
        found: (usize, usize),
    },
    /// A video does not fit the network, or its input cannot hold one.
    #[error("expected {expected}, found {found}")]
    Video { expected: String, found: String },
    /// Two overlays would have the same path, or an overlay would replace a picture.
    #[error("{} would replace {other}; choose another folder or other names", path.display())]
    OverlayTaken { path: PathBuf, other: String },
    /// An image cannot be read or written; the source names it.
    #[error(transparent)]
    Image(#[from] IoError),
    /// A setting of the contact measurement is refused.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A state cannot be resumed from.
    #[error("the state to resume from")]
    Resume(#[source] EngineError),
    /// The thread of the engine cannot start, or has ended.
    #[error(transparent)]
    Live(LiveError),
    /// A line of finished measurements, counted from 1, cannot be read.
    #[error("{}: line {line}: expected a finished measurement", path.display())]
    Finished { path: PathBuf, line: usize, source: serde_json::Error },
    /// The observer of a run cannot show a result.
    #[error("output")]
    Output(#[source] io::Error),
    /// The engine refuses its input, or a result is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl From<LiveError> for RunError {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Engine(error) => Self::Engine(error),
            error => Self::Live(error),
        }
    }
}

/// Whether an error of a model names its file.
fn names_file(error: &ModelError) -> bool {
    matches!(error, ModelError::Read { .. } | ModelError::Large { .. })
}

/// An error and its sources in one line, the outermost first; long ones are shortened.
pub fn chain(error: &dyn Error) -> String {
    let mut text = in_part(&error.to_string()).into_owned();
    let mut inner = error.source();
    while let Some(source) = inner {
        text = format!("{text}: {}", in_part(&source.to_string()));
        inner = source.source();
    }
    text
}

impl RunError {
    /// The error `source` of reading `recording`.
    pub fn recording(recording: &str, source: IoError) -> Self {
        match source {
            // The error names the file itself.
            IoError::File { .. } => Self::File(source),
            _ => Self::Recording { recording: recording.into(), source: Box::new(source), salvaged: None },
        }
    }

    /// The operating system refused to `action` the file at `path`: to open, read or write it.
    pub fn file(action: &'static str, path: impl Into<PathBuf>, source: io::Error) -> Self {
        Self::File(IoError::File { action, path: path.into(), source })
    }

    pub(crate) fn other_network(
        network: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::OtherNetwork { network: network.to_owned(), expected: expected.into(), found: found.into() }
    }

    /// `network` is a frame network; a network over events was expected.
    pub fn is_frame_network(network: &str) -> Self {
        Self::other_network(network, "a network over events", "a frame network")
    }

    /// The error `source` of the description of `network`.
    pub fn description(network: String, source: ModelError) -> Self {
        if names_file(&source) {
            Self::ModelFile(source)
        } else {
            Self::Description { network: network.into(), source: Box::new(source) }
        }
    }

    /// The error `source` of `weights`.
    pub fn weights(weights: String, source: ModelError) -> Self {
        if names_file(&source) {
            Self::ModelFile(source)
        } else {
            Self::Weights { weights: weights.into(), source: Box::new(source) }
        }
    }
}
