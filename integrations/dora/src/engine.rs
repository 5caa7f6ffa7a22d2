//! The networks that a node can run: over events, or over frames that are made of them.

use std::path::Path;
use std::sync::Arc;

use meissner::frames::{Convolution, FrameOptions};
use meissner::live::Predictor;
use meissner::models::AnyDescription;
use meissner::{DropReason, EngineError, Event, EventCounters, Outcome, Prediction, Sensor, snapshot_note};
use meissner_pipeline::PipelineError;
use meissner_pipeline::live_frames::LiveFrames;
use meissner_pipeline::model::{FrameModel, Model, describe_any};

/// A network with its weights.
#[derive(Clone)]
pub(crate) enum Network {
    /// Over events.
    Events(Arc<meissner::Network>),
    /// Over frames of events.
    Frames(Arc<FrameModel>),
}

impl Network {
    /// The network called `name`, with the weights in the file at `weights` or its shipped weights.
    ///
    /// # Errors
    /// The network is unknown, or the weights do not fit.
    pub(crate) fn named(name: &str, weights: Option<&Path>) -> Result<Self, PipelineError> {
        Ok(match describe_any(name)?.0 {
            AnyDescription::Events(_) => Self::Events(Model::named(name, weights, false)?.network.into()),
            AnyDescription::Frames(_) => {
                Self::Frames(FrameModel::named(name, weights, Convolution::Direct, false)?.into())
            }
        })
    }

    /// An engine before the first event of `sensor`.
    ///
    /// # Errors
    /// The network does not fit the sensor, or reads other input than events.
    pub(crate) fn engine(&self, sensor: Sensor) -> Result<Engine, PipelineError> {
        Ok(match self {
            Self::Events(network) => {
                Engine::Events(Box::new(meissner::Engine::new(Arc::clone(network), sensor)?))
            }
            Self::Frames(model) => {
                Engine::Frames(Box::new(LiveFrames::new(Arc::clone(model), sensor, FrameOptions::new())?))
            }
        })
    }
}

/// A network and its state.
pub(crate) enum Engine {
    /// Over events.
    Events(Box<meissner::Engine>),
    /// Over frames of events.
    Frames(Box<LiveFrames>),
}

impl Engine {
    /// Dropped events by reason.
    pub(crate) fn dropped(&self) -> Vec<(DropReason, u64)> {
        match self {
            Self::Events(engine) => engine.counters().events.dropped().to_vec(),
            Self::Frames(frames) => frames.dropped().to_vec(),
        }
    }

    /// The state with a note, as bytes.
    pub(crate) fn encoded(&mut self, note: &[u8]) -> Vec<u8> {
        match self {
            Self::Events(engine) => engine.to_bytes_with(note),
            Self::Frames(frames) => frames.to_bytes_with(note),
        }
    }

    /// The note in the state `bytes` of such an engine.
    ///
    /// # Errors
    /// The bytes are no state.
    pub(crate) fn note(&self, bytes: &[u8]) -> Result<Vec<u8>, EngineError> {
        match self {
            Self::Events(_) => snapshot_note(bytes).map(<[u8]>::to_vec),
            Self::Frames(_) => LiveFrames::note(bytes),
        }
    }

    /// Restores a state.
    ///
    /// # Errors
    /// It is of another network or sensor, or damaged.
    pub(crate) fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        match self {
            Self::Events(engine) => engine.restore_bytes(bytes),
            Self::Frames(frames) => frames.restore_bytes(bytes),
        }
    }

    fn predictor(&mut self) -> &mut dyn Predictor<Input = Event> {
        match self {
            Self::Events(engine) => &mut **engine,
            Self::Frames(frames) => &mut **frames,
        }
    }
}

impl Predictor for Engine {
    type Input = Event;

    fn push(&mut self, event: Event) -> Outcome {
        self.predictor().push(event)
    }

    fn push_from(&mut self, events: &mut Vec<Event>) {
        self.predictor().push_from(events);
    }

    fn advance(&mut self, t_us: i64) {
        self.predictor().advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predictor().predict()
    }

    fn reset(&mut self) {
        self.predictor().reset();
    }

    fn event_counters(&self) -> EventCounters {
        match self {
            Self::Events(engine) => *engine.event_counters(),
            Self::Frames(frames) => frames.event_counters(),
        }
    }
}
