//! Opens the source and loads the network that the arguments select.

use std::path::Path;
use std::time::Duration;

use meissner_engine::EngineError;
use meissner_io::{Format, Recording};
use meissner_models::DEFAULT_NETWORK;
use meissner_run::bench::Part;
use meissner_run::losses::LossReason;
use meissner_run::model::{Model, ModelOptions};
use meissner_run::provenance::ModelCard;
use meissner_run::source::{self, Source};
use meissner_run::{RunError, streams};

use crate::args::{Input, ReadArgs};
use crate::error::CliError;
use crate::stderr::tell;

impl ReadArgs {
    /// This part of the recording in the file at `path`, or of all of standard input if it is `-`.
    ///
    /// # Errors
    /// It cannot be read, or options do not fit its format.
    pub(crate) fn read(self, path: &Path, part: Part) -> Result<Recording, CliError> {
        self.check(path)?;
        let recording = source::read(path, &self.options().range(part.range()))?;
        self.fits(&path.display().to_string(), &recording.format.to_string())?;
        Ok(recording)
    }

    /// Opens this part of `recording`; `None` is the embedded one. See [`Source::open`].
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn open(self, recording: Option<&Path>, part: Part) -> Result<Source, CliError> {
        recording.map_or(Ok(()), |path| self.check(path))?;
        let options = self.options().range(part.range());
        if let Some(path) = recording
            .filter(|path| streams::is_live(path) && !streams::is_stdin(path) && self.sensor.is_none())
        {
            tell(format_args!(
                "note: {}: waits for the first event, before which a text may name the sensor; with --sensor WxH it begins at once",
                streams::name(path)
            ));
        }
        let source = Source::open(recording, &options, self.sensor.is_some(), self.strict)?;
        recording.map_or(Ok(()), |_| self.fits(&source.name, &source.format))?;
        let default = || recording.map_or(Duration::ZERO, streams::patience);
        Ok(source.patient(self.reconnect.unwrap_or_else(default)))
    }

    /// Refuses `--salvage` for a stream.
    fn check(self, path: &Path) -> Result<(), CliError> {
        if self.salvage && streams::is_live(path) {
            return Err(CliError::usage("--salvage", "a file", &streams::name(path)));
        }
        Ok(())
    }

    /// Refuses options for one format if `name` has another `format`.
    fn fits(self, name: &str, format: &str) -> Result<(), CliError> {
        let (text, npy) = (format.starts_with("CSV"), format == Format::Npy.to_string());
        let refused = |option: &str, expected: &str| {
            Err(CliError::usage(option, expected, &format!("{name}, which is {format}")))
        };
        match self {
            Self { columns: Some(_), .. } if !text => refused("--columns", "a text of events"),
            Self { time_unit: Some(_), .. } if !text && !npy => refused("--time-unit", "a text of events"),
            Self { chip: Some(_), .. } if format != Format::Aedat2.to_string() => {
                refused("--chip", "a recording in AEDAT2")
            }
            _ => Ok(()),
        }
    }
}

impl Input {
    /// The name of the network, or its file.
    pub(crate) fn network(&self) -> &str {
        self.network.as_deref().unwrap_or(DEFAULT_NETWORK)
    }

    /// The network with its weights.
    pub(crate) fn model(&self) -> Result<Model, CliError> {
        let file = self.weights.file();
        let options = ModelOptions {
            network: self.network().to_owned(),
            weights: file.map(|file| file.path.to_owned()),
            map: file.map_or_else(Vec::new, |file| file.map.to_vec()),
            ignore_preparation: self.weights.ignore_preparation,
            span_us: self.span_us,
            capacity: self.capacity.map(|capacity| capacity as usize),
            approximations: self.approximations.values(),
        };
        Model::load(&options).map_err(with_option)
    }

    /// The source. Only every `stride`-th event is taken if the weights of `card` state a stride.
    pub(crate) fn source(&self, card: &ModelCard) -> Result<Source, CliError> {
        self.source_of(self.recording.as_deref(), card)
    }

    /// The same with `recording` instead of the first one.
    pub(crate) fn source_of(&self, recording: Option<&Path>, card: &ModelCard) -> Result<Source, CliError> {
        let source = self.read.open(recording, self.part.part())?;
        Ok(source.every(card.network.stride).with_advice(advice))
    }
}

/// The option that may help against a loss of input.
pub(crate) fn advice(reason: LossReason) -> Option<&'static str> {
    match reason {
        LossReason::OutsideSensor => Some("--sensor sets it"),
        LossReason::Late => Some("--late clamp lets such events in"),
        LossReason::Restart => Some("--restart keep goes on with the old clock"),
        LossReason::OutsideCrop => Some("`meissner inspect` shows it"),
        LossReason::LinesRefused => Some("--strict makes the first an error"),
        _ => None,
    }
}

/// Names the option that caused `error`, if one did.
fn with_option(error: RunError) -> CliError {
    match error {
        RunError::Engine(EngineError::Option { what: "neighbours of a node", expected, found }) => {
            CliError::usage("--neighbours", &expected, &found)
        }
        error => error.into(),
    }
}
