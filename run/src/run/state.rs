//! Options of a run over events, and the states that it writes so that a later run can resume.
//!
//! Invariant: a state is taken directly after an event, before any result that is due only because
//! the input ends. A run that resumes from it makes the same predictions as a single run over both
//! inputs, unless the clock restarts at the very end of the first: events that wait for a restart
//! to be confirmed are late in the state.

use std::io::Write;
use std::path::PathBuf;

use meissner_engine::{LatePolicy, RestartPolicy};

use crate::approximations::Approximations;
use crate::error::RunError;
use crate::predictor::Mode;
use crate::schedule::Every;

/// The default for the predictions of networks over events.
pub(crate) const EVERY: Every = Every::StreamUs(10_000);

/// Options of a run over events. `Default` runs all events, exactly.
#[derive(Clone, Debug, Default)]
pub struct RunOptions {
    /// How a network over events computes predictions.
    pub mode: Mode,
    /// When predictions are read. The default is every 10 ms; over frames, every frame.
    pub every: Option<Every>,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// What is done when the clock of the sensor restarts.
    pub restart: RestartPolicy,
    /// Approximations of a network over events.
    pub approximations: Approximations,
    /// Whether two threads share the work of a network over events, see
    /// [`Options`](meissner_engine::Options::two_threads).
    pub two_threads: bool,
    /// Largest number of events to take.
    pub limit: Option<u64>,
    /// State that an earlier run wrote, to resume from.
    pub resume: Option<Vec<u8>>,
    /// Where the state is written.
    pub save: Option<SaveState>,
    /// Largest number of consecutive empty frames that are pushed. The default is 6000.
    pub longest_silence: Option<u64>,
}

/// The file for the state of a run, and when it is written. The file is replaced atomically.
#[derive(Clone, Debug)]
pub struct SaveState {
    /// The file.
    pub path: PathBuf,
    /// Stream time after which the state is also written before the end.
    pub every_us: Option<i64>,
}

/// Writes states.
pub(super) struct Saver {
    to: SaveState,
    /// Stream time of the last state, or of the first event.
    last_us: Option<i64>,
}

impl Saver {
    pub(super) fn new(to: SaveState) -> Self {
        Self { to, last_us: None }
    }

    /// Whether a state is due after an event at `t_us`.
    pub(super) fn is_due(&mut self, t_us: i64) -> bool {
        // After a restart of the clock, `t_us` is earlier.
        let last = self.last_us.map_or(t_us, |last| last.min(t_us));
        self.last_us = Some(last);
        let due = self.to.every_us.is_some_and(|every| t_us.saturating_sub(last) >= every);
        if due {
            self.last_us = Some(t_us);
        }
        due
    }

    pub(super) fn write(&self, bytes: &[u8]) -> Result<(), RunError> {
        meissner_io::replace_file(&self.to.path, |out| out.write_all(bytes)).map_err(RunError::File)
    }
}

#[cfg(test)]
mod tests {
    use super::{SaveState, Saver};

    #[test]
    fn states_are_due_when_the_time_has_passed_since_the_last() {
        let saver = |every_us| Saver::new(SaveState { path: "state".into(), every_us });
        let mut every_10 = saver(Some(10));
        let due: Vec<bool> = [-3, 6, 7, 16, 17, 90, 91].map(|t| every_10.is_due(t)).to_vec();
        assert_eq!(due, [false, false, true, false, true, true, false]);
        let mut at_the_end = saver(None);
        assert!(!at_the_end.is_due(0) && !at_the_end.is_due(i64::MAX));
        let mut restarted = saver(Some(10));
        assert_eq!([1000, 0, 9, 10].map(|t| restarted.is_due(t)), [false, false, false, true]);
    }
}
