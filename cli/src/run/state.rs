//! The state of a run as a file, to go on from.
//!
//! Enters: what `--save-state`, `--save-every` and `--resume` ask for. Leaves: the bytes of a file, and a file that is
//! replaced whole. Invariant: a state is of the moment behind an event, before what is due at the end of an input, so that a
//! run that goes on from it predicts what one run over both inputs would.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use meissner_engine::EngineError;

use crate::args::STATE;
use crate::error::CliError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::time::span_us;

/// What can be asked for where a run goes on later.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct StateArgs {
    /// Write the state after the last event to this file, for --resume.
    ///
    /// For networks over events, and over frames of events. What is due only because the input ends (the prediction of
    /// --every TIME, a frame whose window is still open) is left to the run that goes on; --every end predicts. The state
    /// is also written at Ctrl-C, SIGTERM and errors of input and output, but not where the engine ends with an error or
    /// most of a text is refused. The file is replaced whole: a crash while it is written leaves the former one.
    #[arg(long, value_name = "FILE", help_heading = STATE)]
    pub(crate) save_state: Option<PathBuf>,
    /// Write the state also whenever TIME of stream time has passed.
    #[arg(long = "save-every", value_name = "TIME", requires = "save_state", value_parser = span_us,
          help_heading = STATE)]
    pub(crate) save_every_us: Option<i64>,
    /// Go on from the state in this file; INPUT is what comes after it.
    ///
    /// Both runs together print what one run would. Network, weights, sensor, --late and --tolerance must be those of
    /// the run that wrote the state, or it is refused. Events that the other run has already seen are not recognised:
    /// those before its last event are late (see --late), and those at its time count twice. "rows" of the first
    /// prediction and "skips" are of this run, which computes each row anew.
    #[arg(long, value_name = "FILE", help_heading = STATE)]
    pub(crate) resume: Option<PathBuf>,
}

impl StateArgs {
    /// The first of the options that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [("--save-state", self.save_state.is_some()), ("--resume", self.resume.is_some())];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The bytes to go on from.
    pub(crate) fn read(&self) -> Result<Option<Resumed<'_>>, CliError> {
        let Some(path) = self.resume.as_deref() else { return Ok(None) };
        let bytes = fs::read(path).map_err(|source| PipelineError::Open { path: path.to_owned(), source })?;
        Ok(Some(Resumed { path, bytes }))
    }

    pub(crate) fn saver(&self) -> Option<Saver> {
        let path = self.save_state.clone()?;
        Some(Saver { path, every_us: self.save_every_us, last_us: None })
    }
}

/// A state to go on from.
pub(crate) struct Resumed<'a> {
    path: &'a Path,
    pub(crate) bytes: Vec<u8>,
}

impl Resumed<'_> {
    /// The state is refused.
    pub(crate) fn refused(&self, source: EngineError) -> CliError {
        CliError::Resume { path: self.path.to_owned(), source }
    }

    /// What a run has written beside the engine's state is not what this one needs.
    pub(crate) fn misfit(&self, what: &'static str, expected: String, found: String) -> CliError {
        self.refused(EngineError::Snapshot { what, expected, found })
    }
}

/// Writes states.
pub(crate) struct Saver {
    path: PathBuf,
    every_us: Option<i64>,
    /// Stream time of the last one, or of the first event.
    last_us: Option<i64>,
}

impl Saver {
    /// Whether a state is due behind an event at `t_us`, which is not earlier than the one before.
    pub(crate) fn is_due(&mut self, t_us: i64) -> bool {
        let last = *self.last_us.get_or_insert(t_us);
        let due = self.every_us.is_some_and(|every| t_us.saturating_sub(last) >= every);
        if due {
            self.last_us = Some(t_us);
        }
        due
    }

    pub(crate) fn write(&self, bytes: &[u8]) -> Result<(), CliError> {
        let written = meissner_io::replace_file(&self.path, |out| out.write_all(bytes));
        Ok(written.map_err(PipelineError::File)?)
    }
}

#[cfg(test)]
mod tests {
    use super::Saver;

    #[test]
    fn states_are_due_when_the_time_has_passed_since_the_last() {
        let mut saver = Saver { path: "state".into(), every_us: Some(10), last_us: None };
        let due: Vec<bool> = [-3, 6, 7, 16, 17, 90, 91].map(|t| saver.is_due(t)).to_vec();
        assert_eq!(due, [false, false, true, false, true, true, false]);
        assert!(!Saver { every_us: None, ..saver }.is_due(i64::MAX));
    }
}
