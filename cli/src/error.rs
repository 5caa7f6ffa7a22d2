//! What can go wrong, in one message, and the exit status that says whose fault it is.

use std::error::Error;
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use meissner_engine::EngineError;
use meissner_engine::representations::RepresentationError;
use meissner_io::datasets::DatasetError;
use meissner_io::{Format, ImageError, IoError, Kind};
use meissner_live::LiveError;
use meissner_models::ModelError;
use meissner_models::systems::contact_area::ContactError;
use meissner_models::systems::digits::DigitsError;
use meissner_models::systems::slip::{DecisionError, SlipError};

use crate::args::time;
use crate::networks;
use crate::prepare::StreamsError;
use crate::run;
use crate::source::{STDIN_NAME, Salvaged};
use crate::trainings::TrainingError;

/// A subcommand gives up.
#[derive(Debug, thiserror::Error)]
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
    #[error(
        "network {0}: a description file comes without weights; add --weights FILE (`meissner draw` writes untrained ones)"
    )]
    NoWeights(String),
    /// A format that cannot be written was asked for, by name or by extension.
    #[error("{0}; choose one with --to csv|npy|dat|evt3")]
    NotWritable(String),
    /// A recording cannot be read.
    #[error("{recording}")]
    Recording {
        /// The recording.
        recording: String,
        /// Why.
        source: IoError,
    },
    /// A line of a text is not what it should be, and is not to be passed over.
    #[error("{recording}: {problem}")]
    Line {
        /// The text.
        recording: String,
        /// Which line, and why.
        problem: String,
    },
    /// Most lines of a text are not what they should be.
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
        source: IoError,
        /// What could be read all the same.
        salvaged: Box<Salvaged>,
    },
    /// An output is there already.
    #[error("{}: expected no such file, found one: --force replaces it", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be read or written; the reason names it.
    #[error(transparent)]
    File(IoError),
    /// A name that is neither a shipped network nor a file.
    #[error("network {name}: found no shipped network and no file of this name{hint}", name = .0, hint = networks::hint(.0))]
    UnknownNetwork(String),
    /// A frame network stands where a network over events should.
    #[error(
        "network {0}: expected a network over events, found a frame network: `meissner inspect` shows it"
    )]
    IsFrameNetwork(String),
    /// An option that means nothing to the kind of network.
    #[error("{option} is for {fits}: network {network} is {kind}")]
    Misfit {
        /// The option.
        option: &'static str,
        /// What it is for.
        fits: String,
        /// The network.
        network: String,
        /// What the network is.
        kind: &'static str,
    },
    /// Predictions were asked for between two frames.
    #[error(
        "--every: expected `end` or a multiple of {every}, since network {network} reads a frame every {every}, \
         found {found}", every = time::display(*.period_us)
    )]
    BetweenFrames {
        /// The network.
        network: String,
        /// Length of a frame.
        period_us: i64,
        /// What was asked for.
        found: String,
    },
    /// The network needs an input that the program does not hold.
    #[error("network {network}: expected {expected} as INPUT, found {found}")]
    NoInput {
        /// The network.
        network: String,
        /// What it reads.
        expected: &'static str,
        /// What there is.
        found: &'static str,
    },
    /// A picture of another size than the network's.
    #[error(
        "{}: expected {}x{} pixels, as network {network} reads them, found {}x{}",
        path.display(), expected.0, expected.1, found.0, found.1
    )]
    PictureSize {
        /// The file.
        path: PathBuf,
        /// The network.
        network: String,
        /// Width and height that it reads.
        expected: (usize, usize),
        /// Width and height of the picture.
        found: (usize, usize),
    },
    /// A network over pictures that predicts no map of forces.
    #[error("network {network}: expected a prediction of {expected}, a force for each pixel, found {found}")]
    NoForceMap {
        /// The network.
        network: String,
        /// The shape that fits.
        expected: String,
        /// The shape that it has.
        found: String,
    },
    /// Overlays of two pictures would be one file, or an overlay the picture itself.
    #[error("--overlay: {} would replace {other}; choose another folder or other names", path.display())]
    OverlayTaken {
        /// The overlay.
        path: PathBuf,
        /// What it would replace.
        other: String,
    },
    /// A network over events stands where a frame network should.
    #[error("network {0}: expected a frame network, found a network over events")]
    IsEventNetwork(String),
    /// A frame network whose frames are not made of events.
    #[error(
        "network {network}: bench expects a frame network whose frames are made of events (event-counts, signed), \
         found frames = {found:?}: `meissner inspect` shows it"
    )]
    FramesOfOther {
        /// Its name or its file.
        network: String,
        /// The word for its frames.
        found: &'static str,
    },
    /// An option that does not go with the others.
    #[error("{option}: expected {expected}, found {found}")]
    Option {
        /// The option.
        option: &'static str,
        /// What would do.
        expected: String,
        /// What was given.
        found: String,
    },
    /// Frames cannot be made of the input; the reason names both.
    #[error("network {network}")]
    Frames {
        /// The network.
        network: String,
        /// Why.
        source: RepresentationError,
    },
    /// An image cannot be read or written; the reason names it.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A setting of what stands around the network is refused.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// How a decision is to be held makes no sense.
    #[error(transparent)]
    Decision(#[from] DecisionError),
    /// A data set is not there or is laid out in another way; the reason names the path.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A network or a recording has nothing to do with direction of slip; the reason names it.
    #[error(transparent)]
    Slip(#[from] SlipError),
    /// A network tells no digits, or folds cannot be made; the reason names it.
    #[error(transparent)]
    Digits(#[from] DigitsError),
    /// A data set has nothing to judge whole trainings on.
    #[error("{}: expected recordings of the split test, which whole trainings are judged on, found none", folder.display())]
    NoTestSplit {
        /// The data set.
        folder: PathBuf,
    },
    /// A file of a training does not fit the evaluation.
    #[error("training {}", path.display())]
    Training {
        /// The file.
        path: PathBuf,
        /// Why.
        source: TrainingError,
    },
    /// A folder holds no training of a network.
    #[error("--trainings {}: expected safetensors files with metadata \"network\" = {expected}, found {found}", folder.display())]
    NoTrainings {
        /// The folder.
        folder: PathBuf,
        /// The networks.
        expected: String,
        /// What there is.
        found: String,
    },
    /// A description file has no shipped weights, and no folder has others.
    #[error("network {0}: a description file comes without weights; add --trainings DIR")]
    NeedsTrainings(String),
    /// A file of streams cannot be made graphs of.
    #[error("{}", path.display())]
    Streams {
        /// The file.
        path: PathBuf,
        /// Why.
        source: StreamsError,
    },
    /// A line of finished measurements cannot be read.
    #[error("--state {}: line {line}: expected a finished measurement", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// Its line, from 1 on.
        line: usize,
        /// Why.
        source: serde_json::Error,
    },
    /// Threads cannot be started.
    #[error("--threads {threads}")]
    Threads {
        /// How many.
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// A recording of a slip cannot be cut into windows.
    #[error("recording {recording}")]
    SlipRecording {
        /// The recording.
        recording: String,
        /// Why.
        source: SlipError,
    },
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
    #[error("network {network}")]
    Description {
        /// The name or the file.
        network: String,
        /// Why.
        source: ModelError,
    },
    /// A description or weights cannot be read; the reason names the file.
    #[error(transparent)]
    ModelFile(ModelError),
    /// Weights cannot be read, or do not fit.
    #[error("weights {weights}")]
    Weights {
        /// The file.
        weights: String,
        /// Why.
        source: ModelError,
    },
    /// The engine refuses, or found that a result is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The engine's thread cannot start, or has ended.
    #[error(transparent)]
    Live(LiveError),
    /// A prediction has other bits than the batch's.
    #[error("--verify: expected the prediction of the batch over the accepted events, found other bits")]
    NotEqual,
    /// A state cannot be gone on from.
    #[error("--resume {}", path.display())]
    Resume {
        /// The file.
        path: PathBuf,
        /// Why.
        source: EngineError,
    },
    /// A network has no form in f64.
    #[error(transparent)]
    Reference(meissner_reference::ReferenceError),
    /// Results are not what is promised; they say how.
    #[error("promises that are broken: expected none, found {0}")]
    Broken(usize),
    /// A file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Standard output cannot be written.
    #[error("standard output")]
    Output(#[from] io::Error),
}

/// Whether an error of a model names the file that it is about.
fn names_file(error: &ModelError) -> bool {
    matches!(error, ModelError::Read { .. } | ModelError::Large { .. })
}

/// An error and its sources in one line, from what failed to the first cause.
pub(crate) fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut inner = error.source();
    while let Some(source) = inner {
        text = format!("{text}: {source}");
        inner = source.source();
    }
    text
}

impl From<LiveError> for CliError {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Engine(error) => Self::Engine(error),
            error => Self::Live(error),
        }
    }
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

    /// What to do about it, where that is more than the message says.
    pub(crate) fn hint(&self) -> Option<String> {
        match self {
            Self::Cut { salvaged, .. } => Some(format!("with --salvage it is read as far as it is whole: {}", salvaged.words())),
            Self::Recording { source: IoError::Undecided { .. }, .. } => Some(
                "say the order of the columns with --columns, such as --columns xytp (_ for any other column), and the unit \
                 of time with --time-unit s, ms, us or ns"
                    .to_owned(),
            ),
            Self::Recording { source: IoError::UnknownFormat { start, length }, .. }
                if *length > 0 && !start.contains("\\x") =>
            {
                Some("if it is a text of events, say the order of its columns, such as --columns xytp".to_owned())
            }
            Self::Recording { source: IoError::Malformed { format: Format::Csv, what, .. }, .. }
                if !matches!(*what, "header" | "row" | "field") =>
            {
                Some(
                    "if the columns stand in another order or the times have another unit, say so: --columns, such as \
                     --columns xytp, and --time-unit s, ms, us or ns"
                        .to_owned(),
                )
            }
            Self::Recording { recording, source: IoError::OtherKind { found: Kind::Events(format), expected } }
                if recording == STDIN_NAME && *expected != "readings of electrodes" =>
            {
                Some(format!("{format} is read from a file: give its path in place of -"))
            }
            Self::Weights { source: ModelError::Preparation { published, .. }, .. } => {
                let instead = published.map_or_else(String::new, |name| format!("--network {name} --mode batch, or "));
                Some(format!(
                    "use {instead}weights of this network; --ignore-preparation gives predictions that the weights were not \
                     trained for"
                ))
            }
            Self::Recording { source: IoError::OtherKind { found, .. }, .. }
            | Self::Image(ImageError::OtherKind { found, .. }) => run::readers(*found),
            _ => None,
        }
    }

    /// The error `source` of the description of `network`.
    pub(crate) fn description(network: String, source: ModelError) -> Self {
        if names_file(&source) { Self::ModelFile(source) } else { Self::Description { network, source } }
    }

    /// The error `source` of `weights`.
    pub(crate) fn weights(weights: String, source: ModelError) -> Self {
        if names_file(&source) { Self::ModelFile(source) } else { Self::Weights { weights, source } }
    }

    /// Whether the reader of standard output went away.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// 2 where other arguments would help, else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::NoGeometry { .. }
            | Self::NoWeights(_)
            | Self::NeedsTrainings(_)
            | Self::NotWritable(_)
            | Self::Exists { .. }
            | Self::Recording { source: IoError::Undecided { .. }, .. }
            | Self::Misfit { .. }
            | Self::Option { .. }
            | Self::BetweenFrames { .. }
            | Self::NoInput { .. }
            | Self::Decision(_)
            | Self::Digits(DigitsError::Folds { .. })
            | Self::OverlayTaken { .. } => ExitCode::from(2),
            _ => ExitCode::from(1),
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

    use super::{CliError, chain};
    use crate::prepare::StreamsError;

    fn denied() -> io::Error {
        io::Error::new(io::ErrorKind::PermissionDenied, "denied")
    }

    #[test]
    fn an_error_of_the_program_does_not_repeat_its_source() {
        let path = PathBuf::from("some.file");
        let line = serde_json::from_str::<u8>("x").expect_err("not a number");
        let format = IoError::UnknownFormat { length: 3, start: "abc".to_owned() };
        let engine = || EngineError::Sensor(Sensor::new(0, 1));
        let tensors = safetensors::SafeTensorError::HeaderTooSmall;
        for error in [
            CliError::Recording { recording: "some.file".to_owned(), source: format },
            CliError::File(IoError::File { action: "open", path: path.clone(), source: denied() }),
            CliError::Streams { path: path.clone(), source: StreamsError::Format(tensors) },
            CliError::State { path: path.clone(), line: 2, source: line },
            CliError::description("some".to_owned(), ModelError::Engine(engine())),
            CliError::weights("some".to_owned(), ModelError::Read { path: path.clone(), source: denied() }),
            CliError::Engine(engine()),
            CliError::Resume { path: path.clone(), source: engine() },
            CliError::Open { path: path.clone(), source: denied() },
            CliError::Write { path, source: denied() },
            CliError::Output(denied()),
        ] {
            let mut outer: &dyn Error = &error;
            while let Some(source) = outer.source() {
                assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
                outer = source;
            }
        }
    }

    #[test]
    fn the_program_prints_an_error_with_all_its_sources() {
        let path = PathBuf::from("some.pth");
        let error = CliError::weights("some.pth".to_owned(), ModelError::Read { path, source: denied() });
        assert_eq!(chain(&error), "cannot read some.pth: denied");
    }
}
