//! Runs a network over an input, passes the predictions to an observer, and returns a summary.
//!
//! | input | run |
//! |---|---|
//! | events, for a network over events | [`EventRun`] |
//! | events, for a network over frames of events | [`FrameRun`] |
//! | readings of 24 electrodes | [`ElectrodeRun`] |
//! | pictures of an optical tactile sensor, in files or as raw video | [`PictureRun`] |
//!
//! Inputs are processed as fast as they arrive; pictures of a camera may be late (see
//! [`VideoOptions`]). The timings cover making frames, pushes, clock advances and predictions. They
//! do not cover reading and the observer.
//!
//! The steps at the end of a stream depend on how it ends:
//!
//! | the stream ends with | state | due predictions | result |
//! |---|---|---|---|
//! | its last event, the limit, a signal | written | read | success |
//! | input that cannot be read, a refused line | written | read | the error |
//! | a text of which most lines are refused | not written | read | the error |
//! | an error of the engine | not written | not read | the error |
//! | an error of the observer | written | not read | the error |

mod electrodes;
mod events;
mod frames;
mod pictures;
mod prediction;
mod summary;
pub(crate) mod video;

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use meissner_engine::{Event, LatePolicy, RestartPolicy, Sensor};

use crate::approximations::Approximations;
use crate::error::{Result, RunError};
use crate::interrupt;
use crate::losses::{InputLosses, LossWarning, LossWatch};
use crate::predictor::Mode;
use crate::schedule::Every;
use crate::source::Source;
pub use electrodes::{ElectrodeOptions, ElectrodeRun, PERIOD_US, Readings, open_readings};
pub use events::EventRun;
pub use frames::FrameRun;
pub use pictures::{BLUR_RADIUS, ContactPredictor, PictureOptions, PictureRun, open_pictures};
pub use prediction::{
    ElectrodePrediction, EventPrediction, FramePrediction, Observer, PicturePrediction, Prediction,
    ReportPrediction, ReportState,
};
use summary::Ending;
pub use summary::{
    ElectrodeCounts, Ended, EventCounts, EventSummary, FrameSummary, InputCounts, LayerPixels, Pixels,
    Summary, VideoCounts,
};
pub use video::VideoOptions;

/// A network with its source of events, before the run.
pub struct StreamRun<S> {
    pub(crate) source: Source,
    pub(crate) sensor: Sensor,
    pub(crate) limit: u64,
    pub(crate) saver: Option<Saver>,
    pub(crate) steps: S,
}

/// The steps of one kind of network.
pub trait Steps {
    /// Takes an event, and shows the predictions that become due.
    ///
    /// # Errors
    /// The engine fails, or the observer cannot show a prediction.
    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<()>;

    /// Events taken so far.
    fn taken(&self) -> u64;

    /// The newest time; `None` before the first event.
    fn now_us(&self) -> Option<i64>;

    /// The state after the newest event; `None` if this network cannot be resumed.
    fn state(&mut self) -> Option<Vec<u8>>;

    /// Decides about the events that wait for later events: there will be none.
    ///
    /// # Errors
    /// As [`Self::take`].
    fn settle(&mut self, observer: &mut dyn Observer) -> Result<()>;

    /// Shows the predictions that are due at the end, without those that a resumed run makes.
    ///
    /// # Errors
    /// As [`Self::take`].
    fn finish(&mut self, resumes: bool, observer: &mut dyn Observer) -> Result<()>;

    /// The losses so far.
    fn losses(&self, source: &Source, sensor: Sensor) -> InputLosses;

    /// The summary of the run.
    fn summary(self, source: Source, warnings: Vec<LossWarning>) -> Summary;
}

impl<S: Steps> StreamRun<S> {
    /// The source.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The number of events that the run will take, if it is known.
    pub fn total(&self) -> Option<u64> {
        self.source.remaining().map(|remaining| remaining.min(self.limit))
    }

    /// Takes all events, or the events up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        // A second signal must not end the program before the state is written.
        let held = self.saver.is_some().then(interrupt::hold);
        let mut watch = LossWatch::new(self.source.is_live());
        let mut result = Ok(());
        while result.is_ok() && self.steps.taken() < self.limit && !interrupt::requested() {
            let Some(event) = self.source.next() else { break };
            result = event.and_then(|event| {
                observer.event(0, event);
                self.take(event, observer)
            });
            let Self { source, sensor, steps, .. } = &self;
            observer.progress(steps.taken());
            watch.look(steps.taken(), Instant::now, &source.name, || steps.losses(source, *sensor));
        }
        let mut ending = Ending(result);
        if ending.predicts() {
            ending.then(self.steps.settle(observer));
        }
        if ending.saves() {
            ending.then(self.save());
        }
        drop(held);
        if ending.predicts() {
            ending.then(self.steps.finish(self.saver.is_some(), observer));
        }
        let Self { source, sensor, steps, .. } = self;
        let warnings = watch.end(&source.name, &steps.losses(&source, sensor));
        Ended { summary: steps.summary(source, warnings), result: ending.0 }
    }

    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<()> {
        self.steps.take(event, observer)?;
        let due = self.saver.as_mut().zip(self.steps.now_us()).is_some_and(|(saver, now)| saver.is_due(now));
        if due { self.save() } else { Ok(()) }
    }

    fn save(&mut self) -> Result<()> {
        let Some(saver) = &self.saver else { return Ok(()) };
        self.steps.state().map_or(Ok(()), |state| saver.write(&state))
    }
}

/// The default for the predictions of networks over events.
pub const EVERY: Every = Every::StreamUs(10_000);

/// Options of a run over events. `Default` runs all events, exactly.
#[derive(Clone, Debug, Default)]
pub struct RunOptions {
    /// How a network over events computes predictions.
    pub mode: Mode,
    /// When predictions are read. The default is every 10 ms; over frames, every frame.
    pub every: Option<Every>,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// Rule for restarts of the sensor's clock.
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

pub(crate) struct Saver {
    to: SaveState,
    /// Stream time of the last state, or of the first event.
    last_us: Option<i64>,
}

impl Saver {
    pub(crate) fn new(to: SaveState) -> Self {
        Self { to, last_us: None }
    }

    /// Whether a state is due after an event at `t_us`.
    pub(crate) fn is_due(&mut self, t_us: i64) -> bool {
        // After a restart of the clock, `t_us` is earlier.
        let last = self.last_us.map_or(t_us, |last| last.min(t_us));
        self.last_us = Some(last);
        let due = self.to.every_us.is_some_and(|every| t_us.saturating_sub(last) >= every);
        if due {
            self.last_us = Some(t_us);
        }
        due
    }

    pub(crate) fn write(&self, bytes: &[u8]) -> Result<()> {
        meissner_io::replace_file(&self.to.path, |out| out.write_all(bytes)).map_err(RunError::File)
    }
}
