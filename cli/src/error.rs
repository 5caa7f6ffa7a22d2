//! What can go wrong, in one message, and the exit status that says whose fault it is.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use meissner_engine::EngineError;
use meissner_io::{Format, IoError};
use meissner_models::{AnyDescription, ModelError};
use thiserror::Error;

/// A subcommand gives up.
#[derive(Debug, Error)]
pub(crate) enum CliError {
    /// Nobody said how large the sensor is.
    #[error(
        "{recording}: this {format} recording does not name its geometry; add --sensor WxH, such as --sensor 346x260"
    )]
    NoGeometry {
        /// The recording.
        recording: String,
        /// Its format.
        format: Format,
    },
    /// A description file has no shipped weights.
    #[error("network {0}: a description file comes without weights; add --weights FILE")]
    NoWeights(String),
    /// A format that cannot be written was asked for, by name or by extension.
    #[error("{0}; choose one with --to csv|npy|dat|evt3")]
    NotWritable(String),
    /// A recording cannot be read.
    #[error("{recording}: {source}")]
    Recording {
        /// The recording.
        recording: String,
        /// Why.
        source: IoError,
    },
    /// A file cannot be read or written; the reason names it.
    #[error(transparent)]
    File(IoError),
    /// A name that is neither a shipped network nor a file.
    #[error("network {0}: expected {names} or a description file, found neither", names = shipped_names())]
    UnknownNetwork(String),
    /// A frame network stands where a network over events should.
    #[error(
        "network {0}: expected a network over events, found a frame network: `meissner inspect` shows it"
    )]
    IsFrameNetwork(String),
    /// A recording stands where a network should.
    #[error(
        "network {network}: expected a description file, found a recording ({format}): `meissner info` shows it"
    )]
    IsRecording {
        /// The file.
        network: String,
        /// The recording's format.
        format: Format,
    },
    /// A description cannot be read.
    #[error("network {network}: {source}")]
    Description {
        /// The name or the file.
        network: String,
        /// Why.
        source: ModelError,
    },
    /// Weights cannot be read, or do not fit.
    #[error("weights {weights}: {source}")]
    Weights {
        /// The file.
        weights: String,
        /// Why.
        source: ModelError,
    },
    /// The engine refuses, or found that a result is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

/// The shipped networks in one line.
fn shipped_names() -> String {
    AnyDescription::shipped_names().collect::<Vec<_>>().join(", ")
}

impl CliError {
    /// The error `source` of reading `recording`.
    pub(crate) fn recording(recording: &str, source: IoError) -> Self {
        match source {
            // It names the file itself.
            IoError::File { .. } => Self::File(source),
            _ => Self::Recording { recording: recording.to_owned(), source },
        }
    }

    /// Whether the reader of standard output went away.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// 2 where other arguments would help, else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::NoGeometry { .. } | Self::NoWeights(_) | Self::NotWritable(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }
}
