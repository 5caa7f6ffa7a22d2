//! Errors of the subcommands, hints against them, and the exit status.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use meissner_engine::EngineError;
use meissner_evaluate::{EvaluateError, RequestPart};
use meissner_io::{Format, IoError, Kind};
use meissner_models::systems::slip::DecisionError;
use meissner_models::{ModelError, TensorProblem};
use meissner_report::ReportError;
use meissner_run::RunError;
use meissner_run::streams::STDIN_NAME;
use meissner_verify::VerifyError;
use meissner_view::ViewError;

use crate::kind::readers;

/// The reason why a subcommand ends without success.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// A source cannot be read, or a network cannot run.
    #[error(transparent)]
    Run(Box<RunError>),
    /// The requested format, given by name or by extension, cannot be written.
    #[error("{0}; choose one with --to aedat4|csv|npy|dat|evt3|es|mcap")]
    NotWritable(String),
    /// An argument does not fit the input, the network or other arguments.
    #[error("{subject}: expected {expected}, found {found}")]
    Usage {
        /// The option, the file or the network.
        subject: String,
        /// The accepted alternative.
        expected: String,
        found: String,
    },
    /// The option does not apply to the kind of network.
    #[error("{option} is for {fits}: network {network} is {kind}")]
    Misfit {
        option: String,
        /// The kinds of networks that it applies to.
        fits: String,
        network: String,
        kind: &'static str,
    },
    /// The value of an option does not fit the network or the input.
    #[error("{option}")]
    OptionValue { option: &'static str, source: Box<RunError> },
    /// The options for decisions contradict each other.
    #[error(transparent)]
    Decision(#[from] DecisionError),
    /// A network cannot be evaluated.
    #[error(transparent)]
    Evaluate(Box<EvaluateError>),
    /// Threads cannot be started.
    #[error("--threads {threads}")]
    Threads { threads: usize, source: rayon::ThreadPoolBuildError },
    /// A prediction differs in a bit from the prediction of the batch.
    #[error("--verify: expected the prediction of the batch over the accepted events, found other bits")]
    NotEqual,
    /// A run cannot resume from a state.
    #[error("--resume {}", path.display())]
    Resume { path: PathBuf, source: EngineError },
    /// The engine differs from full recomputation.
    #[error("{name}: {difference}")]
    Differs {
        network: String,
        /// The streams or the recording.
        name: String,
        /// The file with the minimal stream.
        file: String,
        /// The location, and both values.
        difference: String,
    },
    /// A stream to replay cannot be read.
    #[error("cannot replay {}", path.display())]
    Replay { path: PathBuf, source: Box<VerifyError> },
    /// There is nothing to verify or soak, or its description cannot be read.
    #[error(transparent)]
    Verify(VerifyError),
    /// Results break promises; the output names each.
    #[error("promises that are broken: expected none, found {0}")]
    Broken(usize),
    /// There is no page of results.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// Presses are odd, but none may be; the notes name each kind.
    #[error("--strict: expected nothing odd about the presses, found {0} kinds of oddities")]
    Odd(usize),
    /// A session of the page cannot begin.
    #[error(transparent)]
    View(Box<ViewError>),
    /// The page cannot be served.
    #[error("--port {port}")]
    Port { port: u16, source: io::Error },
    /// Standard output cannot be written.
    #[error("standard output")]
    Output(#[from] io::Error),
}

impl From<RunError> for CliError {
    fn from(error: RunError) -> Self {
        let option = match error {
            RunError::Output(error) => return Self::Output(error),
            RunError::FramePeriod { .. } | RunError::ManyFrames { .. } => "--every",
            RunError::OverlayTaken { .. } => "--overlay",
            RunError::Video { .. } => "--video",
            error => return Self::Run(Box::new(error)),
        };
        Self::OptionValue { option, source: Box::new(error) }
    }
}

impl From<ViewError> for CliError {
    fn from(error: ViewError) -> Self {
        Self::View(Box::new(error))
    }
}

impl From<EngineError> for CliError {
    fn from(error: EngineError) -> Self {
        RunError::Engine(error).into()
    }
}

impl From<EvaluateError> for CliError {
    /// Errors about arguments name the argument.
    fn from(error: EvaluateError) -> Self {
        use EvaluateError as Error;
        let usage = Self::usage;
        match error {
            Error::Run(error) => Self::Run(error),
            Error::Request { part, expected, found } => {
                let option = match part {
                    RequestPart::Events => "EVENTS",
                    RequestPart::Folder => "FOLDER",
                    RequestPart::Pictures => "PICTURES",
                    RequestPart::Recording => "RECORDING",
                    RequestPart::Networks => "--network",
                    RequestPart::Trainings => "--trainings",
                    RequestPart::Settings => "--only",
                    RequestPart::Every => "--every",
                    RequestPart::Seconds => "--seconds",
                    RequestPart::Rate => "--rate",
                    RequestPart::Slower => "--slower",
                    RequestPart::Lost => "--drop",
                    RequestPart::Labels => "--labels",
                    RequestPart::Offset => "--offset",
                    RequestPart::Outputs => "--outputs",
                    _ => "DATA",
                };
                usage(option, &expected, &found)
            }
            Error::OneNetwork { found } => usage("--weights", "one --network", &format!("{found} networks")),
            Error::WeightsOfFold(_) => {
                usage("--weights", "a whole training", "a fold: judge it with --trainings")
            }
            error => Self::Evaluate(Box::new(error)),
        }
    }
}

impl From<VerifyError> for CliError {
    fn from(error: VerifyError) -> Self {
        match error {
            VerifyError::Engine(error) => error.into(),
            VerifyError::Run(error) => (*error).into(),
            error => Self::Verify(error),
        }
    }
}

impl CliError {
    /// The error for an argument `subject` that is `found` instead of `expected`.
    pub(crate) fn usage(subject: &str, expected: &str, found: &str) -> Self {
        let [subject, expected, found] = [subject, expected, found].map(str::to_owned);
        Self::Usage { subject, expected, found }
    }

    /// The error `source` of writing the file at `path`.
    pub(crate) fn write(path: &Path, source: io::Error) -> Self {
        RunError::file("write", path, source).into()
    }

    /// Advice beyond the message, if there is any.
    pub(crate) fn hint(&self) -> Option<String> {
        match self {
            Self::Run(error) | Self::OptionValue { source: error, .. } => hint(error),
            Self::Evaluate(error) if matches!(**error, EvaluateError::NeedsTrainings(_)) => {
                Some("add --trainings DIR".to_owned())
            }
            Self::Differs { network, file, .. } => Some(format!(
                "the minimal stream is in {file}: `meissner verify {network} --replay {file}` runs it again"
            )),
            _ => None,
        }
    }

    /// Whether the reader of standard output has closed the pipe.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// 2 if other arguments would help, otherwise 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        let is_usage = match self {
            Self::Run(error) => match error.as_ref() {
                RunError::NoGeometry { .. } | RunError::NoWeights(_) => true,
                RunError::Recording { source, .. } => matches!(**source, IoError::Undecided { .. }),
                _ => false,
            },
            Self::Evaluate(error) => {
                matches!(**error, EvaluateError::NeedsTrainings(_) | EvaluateError::Folds { .. })
            }
            Self::Verify(error) => matches!(error, VerifyError::Empty(_)),
            Self::NotWritable(_)
            | Self::Usage { .. }
            | Self::Misfit { .. }
            | Self::OptionValue { .. }
            | Self::Decision(_)
            | Self::Replay { .. } => true,
            _ => false,
        };
        ExitCode::from(if is_usage { 2 } else { 1 })
    }
}

/// Advice against `error` in terms of the program's options.
fn hint(error: &RunError) -> Option<String> {
    let text = match error {
        RunError::NoGeometry { .. } => "add --sensor WxH, such as --sensor 346x260",
        RunError::Engine(EngineError::NotIncremental(_)) => "`meissner run --mode batch` runs it",
        RunError::NoWeights(_) => "add --weights FILE (`meissner draw` writes untrained ones)",
        RunError::UnknownNetwork { .. } => "`meissner networks` lists the shipped networks",
        RunError::OtherNetwork { .. } => "`meissner inspect` shows the network",
        RunError::ManyFrames { .. } => "--for takes a part of the recording",
        RunError::Image(IoError::Content { source, .. }) => {
            let IoError::OtherKind { found, .. } = **source else { return None };
            return readers(found);
        }
        RunError::IsRecording { .. } => "`meissner info` shows a recording",
        RunError::Recording { salvaged: Some(salvaged), .. } => {
            return Some(format!("with --salvage it is read as far as it is whole: {salvaged}"));
        }
        RunError::Recording { recording, source, .. } => return hint_of_recording(recording, source),
        RunError::Weights { source, .. } => match &**source {
            ModelError::Preparation { published, .. } => {
                let instead =
                    published.map_or_else(String::new, |name| format!("--network {name} --mode batch, or "));
                return Some(format!(
                    "use {instead}weights of this network; --ignore-preparation gives predictions that the weights were \
                     not trained for"
                ));
            }
            ModelError::Weights { problems, .. } if problems.iter().any(TensorProblem::is_missing) => {
                "--map OLD=NEW says what the network calls a tensor of the file, --map FILE has such lines"
            }
            ModelError::Ambiguous { .. } | ModelError::Doubled { .. } => {
                "--map OLD=NEW, or OLD.=NEW. for all names that start so, says which is meant"
            }
            _ => return None,
        },
        _ => return None,
    };
    Some(text.to_owned())
}

/// Advice against the error `source` of reading `recording`.
fn hint_of_recording(recording: &str, source: &IoError) -> Option<String> {
    let text = match source {
        IoError::Undecided { .. } => {
            "state the order of the columns with --columns, such as --columns xytp (_ for any other column), and the unit \
             of time with --time-unit s, ms, us or ns"
        }
        IoError::Lines { first, .. } => return hint_of_recording(recording, first),
        IoError::Malformed { format: "AEDAT2", what: "address" | "AEChip", .. } => {
            "state the chip, such as --chip DAVIS346, or the size of its sensor, such as --sensor 346x260"
        }
        IoError::UnknownFormat { start, length, .. } if *length > 0 && !start.contains("\\x") => {
            "if it is a text of events, state the order of its columns, such as --columns xytp"
        }
        IoError::Malformed { format: "CSV", what, .. } if !matches!(*what, "header" | "row" | "field") => {
            "if the columns are in another order or the times in another unit, use --columns, such as \
             --columns xytp, and --time-unit s, ms, us or ns"
        }
        IoError::OtherKind { found: Kind::Events(format), expected }
            if recording == STDIN_NAME && *expected != "readings of electrodes" =>
        {
            return Some(match format {
                Format::Aedat4 | Format::Evt2 | Format::Evt21 | Format::Evt3 => {
                    let name = format.to_string().to_lowercase().replace('.', "");
                    format!("--format {name} reads it as it arrives")
                }
                _ => format!("{format} is read from a file: give its path instead of -"),
            });
        }
        IoError::OtherKind { found, .. } => return readers(*found),
        _ => return None,
    };
    Some(text.to_owned())
}
