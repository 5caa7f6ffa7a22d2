//! A frame network that takes events and predicts at any time, as [`meissner_live`] requires.
//!
//! Input: events in order of arrival. Output: the prediction after the newest complete frame.
//! Frames are those of a [run](crate::run::FrameRun) with default options, a sliding window every
//! 10 ms, so that predictions depend only on the events.

use std::sync::Arc;

use meissner_engine::frames::{FrameEngine, FrameOptions};
use meissner_engine::{
    DropReason, EngineError, Event, EventCounters, LatePolicy, Outcome, Prediction, Predictor, RestartPolicy,
    Sensor,
};
use serde::{Deserialize, Serialize};

use crate::error::{Result, RunError};
use crate::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FeedState, FrameFeed, read_note};
use crate::model::FrameModel;
use crate::run::EVERY;

/// A frame network over the events of one sensor.
///
/// In a [`Prediction`], `t_us` is the end of the newest complete frame, and `nodes` the number of
/// frames since the last reset. Events that are earlier than one before them are dropped.
pub struct LiveFrames {
    model: Arc<FrameModel>,
    sensor: Sensor,
    feed: FrameFeed,
    frames: Frames,
    /// Events dropped before this feed.
    dropped: Dropped,
}

/// Dropped events by reason.
pub type Dropped = [(DropReason, u64); EventCounters::DROP_REASONS];

/// The engine and the counts of its input.
struct Frames {
    engine: FrameEngine,
    newest_us: Option<i64>,
    /// The error for a frame that ended without an event and that the engine refused; the next
    /// prediction returns it.
    refused: Option<EngineError>,
}

/// The note of a state.
#[derive(Serialize, Deserialize)]
struct Note {
    /// The preparation of frames and their sensor. States of other frames are refused.
    made: String,
    /// `None` before the first event.
    feed: Option<FeedState>,
    silence: u64,
    newest_us: Option<i64>,
    dropped: Vec<u64>,
    caller: Vec<u8>,
}

impl LiveFrames {
    /// The network of `model` before the first event of `sensor`.
    ///
    /// # Errors
    /// Frames are not made of events, the sensor lacks their pixels, or an option is refused.
    pub fn new(model: Arc<FrameModel>, sensor: Sensor, options: FrameOptions) -> Result<Self> {
        let feed = feed(&model, sensor, 0, None)?;
        let frames = Frames {
            engine: FrameEngine::with_options(Arc::clone(&model.network), options)?,
            newest_us: None,
            refused: None,
        };
        let dropped = feed.counters().dropped();
        Ok(Self { model, sensor, feed, frames, dropped })
    }

    /// Dropped events by reason, since the first event or that of the restored state.
    pub fn dropped(&self) -> Dropped {
        let mut dropped = self.dropped;
        for ((_, count), (_, new)) in dropped.iter_mut().zip(self.feed.counters().dropped()) {
            *count += new;
        }
        dropped
    }

    /// Encodes the state as bytes for [`Self::restore_bytes`], with a note of the caller that
    /// [`Self::note`] returns. Size: that of the engine's state, plus the events that the next
    /// frames cover.
    pub fn to_bytes_with(&mut self, note: &[u8]) -> Vec<u8> {
        let note = Note {
            made: self.made(),
            feed: self.feed.state(),
            silence: self.feed.silence(),
            newest_us: self.frames.newest_us,
            dropped: self.dropped().map(|(_, count)| count).to_vec(),
            caller: note.to_vec(),
        };
        self.frames.engine.to_bytes_with(&note.written())
    }

    /// The caller's note in the state `bytes`.
    ///
    /// # Errors
    /// The bytes are not a state of such a network.
    pub fn note(bytes: &[u8]) -> Result<Vec<u8>, EngineError> {
        Ok(Note::read(bytes)?.caller)
    }

    /// Restores the state that [`Self::to_bytes_with`] wrote for an equal network and sensor. Later
    /// predictions are those of the network that wrote it.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] and [`EngineError::SnapshotBytes`] as
    /// [`FrameEngine::restore_bytes`], or for frames with a different preparation. The state is
    /// then unchanged.
    pub fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        let note = Note::read(bytes)?;
        FeedState::check(note.feed.as_ref(), self.sensor, (&self.made(), &note.made))?;
        self.frames.engine.restore_bytes(bytes)?;
        self.feed_from(note.silence, note.feed.as_ref());
        (self.frames.newest_us, self.frames.refused) = (note.newest_us, None);
        self.dropped = self.feed.counters().dropped();
        self.dropped.iter_mut().zip(note.dropped).for_each(|((_, count), before)| *count = before);
        Ok(())
    }

    /// Continues from the events of `state`, after a silence of `silence` frames.
    fn feed_from(&mut self, silence: u64, state: Option<&FeedState>) {
        self.feed = feed(&self.model, self.sensor, silence, state).expect("this sensor has a feed");
    }

    fn made(&self) -> String {
        format!("{:?} on {}", self.model.source, self.sensor)
    }
}

/// A feed for the frames of `model` that keeps the events of its state.
fn feed(model: &FrameModel, sensor: Sensor, silence: u64, state: Option<&FeedState>) -> Result<FrameFeed> {
    let options = FeedOptions {
        late: LatePolicy::Drop,
        restart: RestartPolicy::Reset,
        every: EVERY,
        silence: EmptyFrameLimit::new(None, silence),
        keeps: true,
    };
    let network = &model.name;
    FrameFeed::new(&model.description, sensor, options, state)
        .map_err(|source| RunError::Frames { network: network.clone(), source })?
        .ok_or_else(|| {
            RunError::other_network(network, "a network over events or their frames", "one over other input")
        })
}

impl Note {
    fn written(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("numbers and text are JSON")
    }

    fn read(bytes: &[u8]) -> Result<Self, EngineError> {
        read_note(bytes, "that of a frame network over events")
    }
}

impl Frames {
    fn take(&mut self, output: FeedOutput<'_>) -> Result<(), EngineError> {
        match output {
            FeedOutput::Frame { values, t_us, .. } => {
                self.engine.push(values)?;
                self.newest_us = Some(t_us);
            }
            FeedOutput::LeftOut { resets: true, .. } => self.engine.reset(),
            FeedOutput::LeftOut { resets: false, .. } => {}
            FeedOutput::Restart => {
                self.engine.reset();
                self.newest_us = None;
            }
        }
        Ok(())
    }
}

impl Predictor for LiveFrames {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        self.feed.push(*event, |output| self.frames.take(output))
    }

    fn advance(&mut self, t_us: i64) {
        let frames = &mut self.frames;
        if let Err(error) = self.feed.advance(t_us, |output| frames.take(output)) {
            frames.refused = Some(error);
        }
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let Frames { engine, newest_us, refused, .. } = &mut self.frames;
        if let Some(error) = refused.take() {
            return Err(error);
        }
        let prediction = engine.predict()?;
        let nodes = usize::try_from(prediction.frames).unwrap_or(usize::MAX);
        Ok(Prediction {
            values: prediction.values,
            t_us: *newest_us,
            nodes,
            rows: &[],
            unlike: prediction.unlike,
        })
    }

    /// Forgets all events; counts of dropped events are kept.
    fn reset(&mut self) {
        self.dropped = self.dropped();
        self.feed_from(0, None);
        self.frames.engine.reset();
        (self.frames.newest_us, self.frames.refused) = (None, None);
    }

    fn event_counters(&self) -> EventCounters {
        *self.feed.counters()
    }
}
