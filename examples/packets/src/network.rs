//! The networks that an integration can run: over events, or over frames of events.

use std::path::Path;
use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameOptions};
use meissner_engine::{
    DropReason, Engine, EngineError, Event, EventCounters, Network, Outcome, Prediction, Predictor, Sensor,
    snapshot_note,
};
use meissner_models::AnyDescription;
use meissner_run::RunError;
use meissner_run::live_frames::LiveFrames;
use meissner_run::model::{FrameModel, Model, WeightsFile, describe_any};

/// A network with its weights, which all of its engines share.
#[derive(Clone)]
pub enum AnyNetwork {
    /// Over events.
    Events(Arc<Network>),
    /// Over frames of events.
    Frames(Arc<FrameModel>),
}

impl AnyNetwork {
    /// The network called `name`, shipped or described in a file, with the weights in the file at
    /// `weights` or its shipped weights.
    ///
    /// # Errors
    /// The network is unknown, or the weights do not fit.
    pub fn named(name: &str, weights: Option<&Path>) -> Result<Self, RunError> {
        let weights = weights.map(WeightsFile::from);
        Ok(match describe_any(name)?.0 {
            AnyDescription::Events(_) => Self::Events(Model::named(name, weights, false)?.network.into()),
            AnyDescription::Frames(_) => {
                Self::Frames(FrameModel::named(name, weights, Convolution::Direct, false)?.into())
            }
        })
    }

    /// Number of predicted values.
    pub fn outputs(&self) -> usize {
        match self {
            Self::Events(network) => network.outputs(),
            Self::Frames(model) => model.description.output().values(),
        }
    }

    /// An engine before the first event of `sensor`.
    ///
    /// # Errors
    /// The network does not fit the sensor, or reads other input than events.
    pub fn engine(&self, sensor: Sensor) -> Result<AnyEngine, RunError> {
        Ok(match self {
            Self::Events(network) => AnyEngine::Events(Box::new(Engine::new(Arc::clone(network), sensor)?)),
            Self::Frames(model) => {
                let frames = LiveFrames::new(Arc::clone(model), sensor, FrameOptions::new())?;
                AnyEngine::Frames(Box::new(frames))
            }
        })
    }
}

/// A network and its state.
pub enum AnyEngine {
    /// Over events.
    Events(Box<Engine>),
    /// Over frames of events.
    Frames(Box<LiveFrames>),
}

impl AnyEngine {
    /// Dropped events by reason.
    pub fn dropped(&self) -> [(DropReason, u64); EventCounters::DROP_REASONS] {
        match self {
            Self::Events(engine) => engine.counters().events.dropped(),
            Self::Frames(frames) => frames.dropped(),
        }
    }

    /// The state with a note, as bytes.
    pub fn to_bytes_with(&mut self, note: &[u8]) -> Vec<u8> {
        match self {
            Self::Events(engine) => engine.to_bytes_with(note),
            Self::Frames(frames) => frames.to_bytes_with(note),
        }
    }

    /// The note in the state `bytes` of such an engine.
    ///
    /// # Errors
    /// The bytes are not a state.
    pub fn note(&self, bytes: &[u8]) -> Result<Vec<u8>, EngineError> {
        match self {
            Self::Events(_) => snapshot_note(bytes).map(<[u8]>::to_vec),
            Self::Frames(_) => LiveFrames::note(bytes),
        }
    }

    /// Restores a state.
    ///
    /// # Errors
    /// The state is of another network or sensor, or damaged.
    pub fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        match self {
            Self::Events(engine) => engine.restore_bytes(bytes),
            Self::Frames(frames) => frames.restore_bytes(bytes),
        }
    }

    /// Inserts events in order; returns the number of accepted events.
    pub fn push_slice(&mut self, events: &[Event]) -> usize {
        match self {
            Self::Events(engine) => engine.push_slice(events),
            Self::Frames(frames) => {
                let pushed = events.iter().map(|event| frames.push(event));
                pushed.filter(|outcome| *outcome == Ok(Outcome::Accepted)).count()
            }
        }
    }

    fn predictor(&mut self) -> &mut dyn Predictor<Input = Event> {
        match self {
            Self::Events(engine) => &mut **engine,
            Self::Frames(frames) => &mut **frames,
        }
    }
}

impl Predictor for AnyEngine {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        self.predictor().push(event)
    }

    fn push_slice(&mut self, events: &[Event]) -> Result<(), EngineError> {
        self.predictor().push_slice(events)
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
