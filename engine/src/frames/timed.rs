//! A frame engine whose frames have times, as live predictions need.

use super::engine::FrameEngine;
use crate::{DropReason, EngineError, EventCounters, Outcome, Prediction, Predictor, RestartPolicy};

/// A frame and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time in microseconds, on any epoch.
    pub t_us: i64,
    /// The values in the order of [`FrameEngine::push`].
    pub values: Vec<f32>,
}

/// A [`FrameEngine`] with the common methods of all engines: it takes frames in order of time.
///
/// A frame earlier than the newest is late and dropped. [`CONFIRMING_FRAMES`] late frames in a row,
/// in order, restart the clock: the engine resets and takes the last one ([`RestartPolicy`]).
/// `nodes` of a [`Prediction`] counts frames since the last reset.
#[derive(Clone, Debug)]
pub struct TimedFrames {
    engine: FrameEngine,
    newest_us: Option<i64>,
    /// Current time: that of the newest frame, or of a later `advance`.
    now_us: Option<i64>,
    restart: RestartPolicy,
    /// Number of late frames in a row that follow each other in time, and the time of the last one.
    late: Option<(usize, i64)>,
    counters: EventCounters,
}

/// Number of consecutive late frames that confirm a restart of the clock.
pub const CONFIRMING_FRAMES: usize = 3;

impl TimedFrames {
    /// Adds a clock that has not started to `engine`.
    pub fn new(engine: FrameEngine) -> Self {
        Self {
            engine,
            newest_us: None,
            now_us: None,
            restart: RestartPolicy::default(),
            late: None,
            counters: EventCounters::default(),
        }
    }

    /// The same with a different policy for restarts.
    #[must_use]
    pub fn with_restart(self, restart: RestartPolicy) -> Self {
        Self { restart, ..self }
    }

    /// The engine.
    pub fn engine(&self) -> &FrameEngine {
        &self.engine
    }

    /// Whether the late frame at `t_us` confirms a restart of the clock, which resets the engine.
    fn restarts(&mut self, t_us: i64) -> bool {
        let run = self.late.filter(|&(_, last)| t_us >= last).map_or(1, |(run, _)| run + 1);
        self.late = Some((run, t_us));
        let restarts = self.restart == RestartPolicy::Reset && run >= CONFIRMING_FRAMES;
        if restarts {
            self.reset();
            self.counters.restarts += 1;
        }
        restarts
    }

    /// The engine, without the clock.
    pub fn into_engine(self) -> FrameEngine {
        self.engine
    }
}

impl Predictor for TimedFrames {
    type Input = Frame;

    /// A frame that is refused counts as pushed.
    fn push(&mut self, Frame { t_us, values }: &Frame) -> Result<Outcome, EngineError> {
        self.counters.pushed += 1;
        if self.now_us.is_some_and(|now| *t_us < now) && !self.restarts(*t_us) {
            self.counters.late += 1;
            return Ok(Outcome::Dropped(DropReason::Late));
        }
        self.late = None;
        self.engine.push(values)?;
        (self.newest_us, self.now_us) = (Some(*t_us), Some(*t_us));
        self.counters.accepted += 1;
        Ok(Outcome::Accepted)
    }

    fn advance(&mut self, t_us: i64) {
        self.now_us = self.now_us.map(|now| now.max(t_us));
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        Ok(Prediction { t_us: self.newest_us, ..Predictor::predict(&mut self.engine)? })
    }

    fn reset(&mut self) {
        self.engine.reset();
        (self.newest_us, self.now_us, self.late) = (None, None, None);
    }

    fn event_counters(&self) -> EventCounters {
        self.counters
    }
}
