//! What can go wrong, in one message, and the exit status that says whose fault it is.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use meissner_engine::EngineError;
use meissner_evaluate::{EvaluateError, RequestPart};
use meissner_io::{Format, ImageError, IoError, Kind};
use meissner_models::ModelError;
use meissner_models::systems::digits::DigitsError;
use meissner_models::systems::slip::DecisionError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::source::STDIN_NAME;
use meissner_verify::VerifyError;

use crate::kind::readers;

/// A subcommand gives up.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// A source cannot be read, or a network cannot run.
    #[error(transparent)]
    Pipeline(Box<PipelineError>),
    /// A format that cannot be written was asked for, by name or by extension.
    #[error("{0}; choose one with --to csv|npy|dat|evt3")]
    NotWritable(String),
    /// An output is there already.
    #[error("{}: expected no such file, found one: --force replaces it", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
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
    /// The value of an option does not fit the network or the input.
    #[error("{option}")]
    OptionValue {
        /// The option.
        option: &'static str,
        /// Why.
        source: Box<PipelineError>,
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
    /// How a decision is to be held makes no sense.
    #[error(transparent)]
    Decision(#[from] DecisionError),
    /// A network cannot be judged or measured.
    #[error(transparent)]
    Evaluate(Box<EvaluateError>),
    /// Threads cannot be started.
    #[error("--threads {threads}")]
    Threads {
        /// How many.
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
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
    /// The engine differs from the full recomputation.
    #[error("{name}: {difference}")]
    Differs {
        /// The network.
        network: String,
        /// The streams or the recording.
        name: String,
        /// The file with the minimal stream.
        file: String,
        /// Where, and both values.
        difference: String,
    },
    /// Nothing could be verified or soaked.
    #[error(transparent)]
    Verify(VerifyError),
    /// Results are not what is promised; they say how.
    #[error("promises that are broken: expected none, found {0}")]
    Broken(usize),
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

impl From<PipelineError> for CliError {
    fn from(error: PipelineError) -> Self {
        let option = match &error {
            PipelineError::BetweenFrames { .. }
            | PipelineError::FramePeriod { .. }
            | PipelineError::ManyFrames { .. } => "--every",
            PipelineError::OverlayTaken { .. } => "--overlay",
            _ => {
                return match error {
                    PipelineError::Output(error) => Self::Output(error),
                    error => Self::Pipeline(Box::new(error)),
                };
            }
        };
        Self::OptionValue { option, source: Box::new(error) }
    }
}

impl From<EngineError> for CliError {
    fn from(error: EngineError) -> Self {
        PipelineError::Engine(error).into()
    }
}

impl From<EvaluateError> for CliError {
    /// Errors of what was asked for name the option.
    fn from(error: EvaluateError) -> Self {
        use EvaluateError as Error;
        let (option, expected, found) = match error {
            Error::Pipeline(error) => return Self::Pipeline(error),
            Error::Write { path, source } => return Self::Write { path, source },
            Error::Request { part, expected, found } => {
                let option = match part {
                    RequestPart::Recording => "RECORDING",
                    RequestPart::Networks => "--network",
                    RequestPart::Trainings => "--trainings",
                    RequestPart::Settings => "--only",
                    _ => "DATA",
                };
                (option, expected, found)
            }
            Error::OneNetwork { found } => {
                ("--weights", "one --network".to_owned(), format!("{found} networks"))
            }
            Error::WeightsOfFold(_) => {
                ("--weights", "a whole training".to_owned(), "a fold: judge it with --trainings".to_owned())
            }
            error => return Self::Evaluate(Box::new(error)),
        };
        Self::Option { option, expected, found }
    }
}

impl From<VerifyError> for CliError {
    fn from(error: VerifyError) -> Self {
        match error {
            VerifyError::Engine(error) => error.into(),
            VerifyError::Pipeline(error) => (*error).into(),
            error => Self::Verify(error),
        }
    }
}

impl CliError {
    /// The remedy, if there is one beyond the message.
    pub(crate) fn hint(&self) -> Option<String> {
        match self {
            Self::Pipeline(error) | Self::OptionValue { source: error, .. } => hint(error),
            Self::Evaluate(error) if matches!(**error, EvaluateError::NeedsTrainings(_)) => {
                Some("add --trainings DIR".to_owned())
            }
            Self::Differs { network, file, .. } => Some(format!(
                "the minimal stream is in {file}: `meissner verify {network} --replay {file}` runs it again"
            )),
            _ => None,
        }
    }

    /// Whether the reader of standard output went away.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// 2 where other arguments would help, else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Pipeline(error) => match error.as_ref() {
                PipelineError::NoGeometry { .. } | PipelineError::NoWeights(_) => ExitCode::from(2),
                PipelineError::Recording { source, .. } if matches!(**source, IoError::Undecided { .. }) => {
                    ExitCode::from(2)
                }
                _ => ExitCode::from(1),
            },
            Self::Evaluate(error) => match **error {
                EvaluateError::NeedsTrainings(_) | EvaluateError::Digits(DigitsError::Folds { .. }) => {
                    ExitCode::from(2)
                }
                _ => ExitCode::from(1),
            },
            Self::NotWritable(_)
            | Self::Exists { .. }
            | Self::Misfit { .. }
            | Self::Option { .. }
            | Self::OptionValue { .. }
            | Self::NoInput { .. }
            | Self::Decision(_)
            | Self::Verify(VerifyError::Empty(_) | VerifyError::Line { .. }) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }
}

/// The remedy for `error` in the program's options.
fn hint(error: &PipelineError) -> Option<String> {
    let text = match error {
        PipelineError::NoGeometry { .. } => "add --sensor WxH, such as --sensor 346x260",
        PipelineError::NoWeights(_) => "add --weights FILE (`meissner draw` writes untrained ones)",
        PipelineError::UnknownNetwork { .. } => "`meissner networks` lists the shipped networks",
        PipelineError::IsFrameNetwork(_) | PipelineError::FramesOfOther { .. } => {
            "`meissner inspect` shows the network"
        }
        PipelineError::ManyFrames { .. } => "--for takes a part of the recording",
        PipelineError::Image(ImageError::OtherKind { found, .. }) => return readers(*found),
        PipelineError::IsRecording { .. } => "`meissner info` shows a recording",
        PipelineError::Cut { salvaged, .. } => {
            return Some(format!("with --salvage it is read as far as it is whole: {salvaged}"));
        }
        PipelineError::Recording { recording, source } => return hint_of_recording(recording, source),
        PipelineError::Weights { source, .. } => {
            let ModelError::Preparation { published, .. } = **source else { return None };
            let instead =
                published.map_or_else(String::new, |name| format!("--network {name} --mode batch, or "));
            return Some(format!(
                "use {instead}weights of this network; --ignore-preparation gives predictions that the weights were not \
                 trained for"
            ));
        }
        _ => return None,
    };
    Some(text.to_owned())
}

/// The remedy for the error `source` of reading `recording`.
fn hint_of_recording(recording: &str, source: &IoError) -> Option<String> {
    let text = match source {
        IoError::Undecided { .. } => {
            "say the order of the columns with --columns, such as --columns xytp (_ for any other column), and the unit \
             of time with --time-unit s, ms, us or ns"
        }
        IoError::UnknownFormat { start, length } if *length > 0 && !start.contains("\\x") => {
            "if it is a text of events, say the order of its columns, such as --columns xytp"
        }
        IoError::Malformed { format: Format::Csv, what, .. }
            if !matches!(*what, "header" | "row" | "field") =>
        {
            "if the columns stand in another order or the times have another unit, say so: --columns, such as \
             --columns xytp, and --time-unit s, ms, us or ns"
        }
        IoError::OtherKind { found: Kind::Events(format), expected }
            if recording == STDIN_NAME && *expected != "readings of electrodes" =>
        {
            return Some(format!("{format} is read from a file: give its path in place of -"));
        }
        IoError::OtherKind { found, .. } => return readers(*found),
        _ => return None,
    };
    Some(text.to_owned())
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io;
    use std::path::PathBuf;

    use meissner_engine::{EngineError, Sensor};

    use super::CliError;

    #[test]
    fn an_error_of_the_program_does_not_repeat_its_source() {
        let denied = || io::Error::new(io::ErrorKind::PermissionDenied, "denied");
        let path = PathBuf::from("some.file");
        let engine = || EngineError::Sensor(Sensor::new(0, 1));
        for error in [
            engine().into(),
            CliError::Resume { path: path.clone(), source: engine() },
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
}
