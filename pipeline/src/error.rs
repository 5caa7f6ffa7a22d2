//! Errors of sources, networks by name, and what runs them.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use meissner_engine::EngineError;
use meissner_engine::representations::RepresentationError;
use meissner_io::{Format, IoError};
use meissner_models::ModelError;

use crate::salvage::Salvaged;

/// A source cannot be read, or a network cannot run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The size of the sensor is unknown.
    #[error("{recording}: this {format} recording does not name its geometry")]
    NoGeometry {
        /// The recording.
        recording: String,
        /// Its format.
        format: Format,
    },
    /// A recording cannot be read.
    #[error("{recording}")]
    Recording {
        /// The recording.
        recording: Box<str>,
        /// Why.
        source: Box<IoError>,
    },
    /// A line of a text is malformed, and the source is strict.
    #[error("{recording}: {problem}")]
    Line {
        /// The text.
        recording: String,
        /// Which line, and why.
        problem: String,
    },
    /// Most lines of a text are malformed.
    #[error("{recording}: {problem}")]
    Lines {
        /// The text.
        recording: String,
        /// How many of how many, which line is the first, and why.
        problem: String,
    },
    /// A recording was cut short.
    #[error("{recording}")]
    Cut {
        /// The recording.
        recording: Box<str>,
        /// Where it ends.
        source: Box<IoError>,
        /// The part that can be read all the same.
        salvaged: Box<Salvaged>,
    },
    /// A file cannot be read or written; the source names it.
    #[error(transparent)]
    File(IoError),
    /// A file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A name that is neither a shipped network nor a file.
    #[error("network {name}: found no shipped network and no file of this name{}",
        nearest.map(|nearest| format!("; did you mean {nearest}?")).unwrap_or_default())]
    UnknownNetwork {
        /// The name.
        name: String,
        /// The shipped network with the most similar name, if one is similar.
        nearest: Option<&'static str>,
    },
    /// A description file has no shipped weights.
    #[error("network {0}: a description file comes without weights")]
    NoWeights(String),
    /// A frame network was given; a network over events was expected.
    #[error("network {0}: expected a network over events, found a frame network")]
    IsFrameNetwork(String),
    /// A network over events was given; a frame network was expected.
    #[error("network {0}: expected a frame network, found a network over events")]
    IsEventNetwork(String),
    /// A recording was given; a network was expected.
    #[error("network {network}: expected a description file, found a recording ({format})")]
    IsRecording {
        /// The file.
        network: String,
        /// The recording's format.
        format: Format,
    },
    /// A description cannot be read.
    #[error("network {network}")]
    Description {
        /// The name or the file.
        network: Box<str>,
        /// Why.
        source: Box<ModelError>,
    },
    /// A description or weights cannot be read; the source names the file.
    #[error(transparent)]
    ModelFile(ModelError),
    /// Weights cannot be read, or do not fit.
    #[error("weights {weights}")]
    Weights {
        /// The file.
        weights: Box<str>,
        /// Why.
        source: Box<ModelError>,
    },
    /// Frames cannot be made of the input.
    #[error("network {network}")]
    Frames {
        /// The network.
        network: String,
        /// Why.
        source: RepresentationError,
    },
    /// The engine refuses its input, or a result is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Whether an error of a model names the file that it is about.
fn names_file(error: &ModelError) -> bool {
    matches!(error, ModelError::Read { .. } | ModelError::Large { .. })
}

/// An error and its sources in one line, from the outermost to the first cause.
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut inner = error.source();
    while let Some(source) = inner {
        text = format!("{text}: {source}");
        inner = source.source();
    }
    text
}

impl PipelineError {
    /// The error `source` of reading `recording`.
    pub fn recording(recording: &str, source: IoError) -> Self {
        match source {
            // It names the file itself.
            IoError::File { .. } => Self::File(source),
            _ => Self::Recording { recording: recording.into(), source: Box::new(source) },
        }
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

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io;
    use std::path::PathBuf;

    use meissner_engine::{EngineError, Sensor};
    use meissner_io::IoError;
    use meissner_models::ModelError;

    use super::{PipelineError, chain};

    fn denied() -> io::Error {
        io::Error::new(io::ErrorKind::PermissionDenied, "denied")
    }

    #[test]
    fn an_error_does_not_repeat_its_source() {
        let path = PathBuf::from("some.file");
        let format = IoError::UnknownFormat { length: 3, start: "abc".to_owned() };
        let engine = || EngineError::Sensor(Sensor::new(0, 1));
        for error in [
            PipelineError::Recording { recording: "some.file".into(), source: Box::new(format) },
            PipelineError::File(IoError::File { action: "open", path: path.clone(), source: denied() }),
            PipelineError::description("some".to_owned(), ModelError::Engine(engine())),
            PipelineError::weights(
                "some".to_owned(),
                ModelError::Read { path: path.clone(), source: denied() },
            ),
            PipelineError::Engine(engine()),
            PipelineError::Open { path, source: denied() },
        ] {
            let mut outer: &dyn Error = &error;
            while let Some(source) = outer.source() {
                assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
                outer = source;
            }
        }
    }

    #[test]
    fn a_chain_has_all_sources_once() {
        let path = PathBuf::from("some.pth");
        let error =
            PipelineError::weights("some.pth".to_owned(), ModelError::Read { path, source: denied() });
        assert_eq!(chain(&error), "cannot read some.pth: denied");
    }
}
