//! Errors of sources, of networks by name, and of runs.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use meissner_engine::EngineError;
use meissner_engine::representations::RepresentationError;
use meissner_io::{Format, ImageError, IoError};
use meissner_live::LiveError;
use meissner_models::ModelError;
use meissner_models::systems::contact_area::ContactError;

use crate::losses::Salvaged;
use crate::schedule::Every;
use crate::text::{display_us, grouped};

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
        /// The reason.
        source: Box<IoError>,
    },
    /// A line of a text is malformed, and the source is strict.
    #[error("{recording}: {problem}")]
    Line {
        /// The text.
        recording: String,
        /// The line, and the reason.
        problem: String,
    },
    /// Most lines of a text are malformed.
    #[error("{recording}: {problem}")]
    Lines {
        /// The text.
        recording: String,
        /// The number of malformed lines and of all lines, the first malformed line, and the reason.
        problem: String,
    },
    /// A recording is truncated.
    #[error("{recording}")]
    Cut {
        /// The recording.
        recording: Box<str>,
        /// The place where it ends.
        source: Box<IoError>,
        /// The part that can still be read.
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
        /// The reason.
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
        /// The reason.
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
        /// The reason.
        source: Box<ModelError>,
    },
    /// Frames cannot be made from the input.
    #[error("network {network}")]
    Frames {
        /// The network.
        network: String,
        /// The reason.
        source: RepresentationError,
    },
    /// A frame network over another input was given; one over frames of events was expected.
    #[error(
        "network {network}: expected a frame network whose frames are made of events (event-counts, signed), found frames \
         = {found:?}"
    )]
    FramesOfOther {
        /// The network.
        network: String,
        /// The name of its kind of frames.
        found: &'static str,
    },
    /// Predictions would be due between two frames.
    #[error(
        "expected `end` or a multiple of {every}, since network {network} reads a frame every {every}, found {found}",
        every = display_us(*.period_us)
    )]
    BetweenFrames {
        /// The network.
        network: String,
        /// Length of a frame.
        period_us: i64,
        /// The requested times of predictions.
        found: Every,
    },
    /// The period of frames differs from the windows of the network, or there is no period.
    #[error("expected {expected}, found {found}")]
    FramePeriod {
        /// The accepted periods.
        expected: String,
        /// The requested times of predictions.
        found: Every,
    },
    /// There would be too many frames.
    #[error("expected at most {} frames, found {found} frames, one every {period_us} us", grouped(*.most))]
    ManyFrames {
        /// The limit.
        most: u64,
        /// The number of frames.
        found: u64,
        /// Time from frame to frame.
        period_us: i64,
    },
    /// A network over pictures that does not predict a map of forces.
    #[error("network {network}: expected a prediction of {expected}, a force for each pixel, found {found}")]
    NoForceMap {
        /// The network.
        network: String,
        /// The expected shape.
        expected: String,
        /// The actual shape.
        found: String,
    },
    /// The size of a picture differs from the input of the network.
    #[error(
        "{}: expected {}x{} pixels, as network {network} reads them, found {}x{}",
        path.display(), expected.0, expected.1, found.0, found.1
    )]
    PictureSize {
        /// The file.
        path: PathBuf,
        /// The network.
        network: String,
        /// Width and height of the input of the network.
        expected: (usize, usize),
        /// Width and height of the picture.
        found: (usize, usize),
    },
    /// Two overlays would have the same path, or an overlay would replace a picture.
    #[error("{} would replace {other}; choose another folder or other names", path.display())]
    OverlayTaken {
        /// The overlay.
        path: PathBuf,
        /// The file that it would replace.
        other: String,
    },
    /// An image cannot be read or written; the source names it.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A setting of the contact measurement is refused.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A folder or a file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The folder or the file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// A state cannot be resumed from.
    #[error("the state to resume from")]
    Resume(#[source] EngineError),
    /// The thread of the engine cannot start, or has ended.
    #[error(transparent)]
    Live(LiveError),
    /// The observer of a run cannot show a result.
    #[error("output")]
    Output(#[source] io::Error),
    /// The engine refuses its input, or a result is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl From<LiveError> for PipelineError {
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
            // The error names the file itself.
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
