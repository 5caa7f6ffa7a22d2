//! Networks that read events, behind the same calls: event graphs, and networks over frames.
//!
//! Input: events in order of time. Output: the values at any time, and counts of the work for
//! them. The value of consecutive windows is the value of the last window that has ended.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameOptions};
use meissner_engine::{EngineError, Event, LatePolicy, Network, Options, RestartPolicy, Sensor};
use meissner_models::description::CostUnit;
use meissner_models::description::frames::SignedTiming;
use meissner_models::{AnyDescription, Description, FrameDescription, FrameSource, ModelError};
use meissner_run::RunError;
use meissner_run::approximations::Approximations;
use meissner_run::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FeedState, FrameFeed};
use meissner_run::model::{LayerCost, Model, frame_network};
use meissner_run::predictor::{EventPredictor, Mode};
use meissner_run::schedule::Every;

use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::trainings::Training;

/// A network that reads events, with its engine.
#[derive(Clone)]
pub(crate) enum PressEngine {
    Graph { predictor: Box<EventPredictor>, costs: Arc<GraphCosts> },
    Frames(Box<FramePress>),
}

/// How a network over consecutive windows runs: exactly by default.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CountsOptions {
    pub(crate) convolution: Convolution,
    pub(crate) options: FrameOptions,
    /// The network sees the first of so many windows; time passes more slowly for it.
    pub(crate) every: u64,
}

impl Default for CountsOptions {
    fn default() -> Self {
        Self { convolution: Convolution::Direct, options: FrameOptions::new(), every: 1 }
    }
}

/// A network over frames of events, with the feed that makes them.
#[derive(Clone)]
pub(crate) struct FramePress {
    description: Arc<FrameDescription>,
    sensor: Sensor,
    feed: FrameFeed,
    frames: FramesSeen,
    costs: Arc<Vec<LayerCost>>,
}

/// A frame engine that sees some of the frames.
#[derive(Clone)]
struct FramesSeen {
    engine: FrameEngine,
    every: u64,
    /// Frames since the last reset.
    count: u64,
}

/// Multiply-adds of a network over events.
pub(crate) struct GraphCosts {
    /// Multiply-adds of a row of each layer.
    row: Vec<u64>,
    /// Multiply-adds of a changed cell of the readout, in the first dense layer.
    cell: u64,
    /// Multiply-adds of a prediction: all other dense layers, and the layers of a head.
    prediction: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    /// Rows of event graphs; 0 for frames.
    pub(crate) rows: u64,
    pub(crate) multiply_adds: u64,
}

impl Count {
    pub(crate) fn since(self, before: Self) -> Self {
        Self { rows: self.rows - before.rows, multiply_adds: self.multiply_adds - before.multiply_adds }
    }
}

impl PressEngine {
    /// The network with the weights of `training`; frames must be of a sliding window.
    pub(crate) fn new(
        description: &AnyDescription,
        training: &Training,
        sensor: Sensor,
        mode: Mode,
    ) -> Result<Self> {
        match description {
            AnyDescription::Events(description) => {
                Self::adapted(description, training, (sensor, mode), &Approximations::default(), Ok)
            }
            AnyDescription::Frames(description) => {
                if !matches!(
                    description.source(),
                    FrameSource::Signed { timing: SignedTiming::Sliding { .. }, .. }
                ) {
                    return Err(other_frames(description, "signed frames of a sliding window"));
                }
                Self::frames(description, training, sensor, CountsOptions::default())
            }
        }
    }

    /// The network of `description` over counts of events in consecutive windows.
    pub(crate) fn counts(
        description: &FrameDescription,
        training: &Training,
        sensor: Sensor,
        how: CountsOptions,
    ) -> Result<Self> {
        if !matches!(description.source(), FrameSource::EventCounts { .. }) {
            return Err(other_frames(description, "counts of events in consecutive windows"));
        }
        Self::frames(description, training, sensor, how)
    }

    fn frames(
        description: &FrameDescription,
        training: &Training,
        sensor: Sensor,
        how: CountsOptions,
    ) -> Result<Self> {
        let weights = (&training.weights, training.label.clone());
        let (network, _) = frame_network(description, weights, how.convolution, false)?;
        let engine = FrameEngine::with_options(network, how.options)?;
        Ok(Self::Frames(Box::new(FramePress {
            feed: feed(description, sensor, 0)?,
            frames: FramesSeen { engine, every: how.every, count: 0 },
            costs: Arc::new(description.layers().iter().map(LayerCost::new).collect()),
            description: Arc::new(description.clone()),
            sensor,
        })))
    }

    /// The engine of the network that `adapt` returns, with the filters, tolerance and staleness of
    /// `approximations`.
    pub(crate) fn adapted(
        description: &Description,
        training: &Training,
        (sensor, mode): (Sensor, Mode),
        approximations: &Approximations,
        adapt: impl FnOnce(Network) -> Result<Network>,
    ) -> Result<Self> {
        let model = Model::of(description, (&training.weights, training.label.clone()), false)?;
        let network = adapt(model.network)?;
        let dense = description.layers().iter().filter(|layer| layer.cost.per == CostUnit::Prediction);
        let dense: usize = dense.map(|layer| layer.cost.multiply_adds).sum();
        let head: usize = description.head().iter().map(|layer| layer.multiply_adds).sum();
        // The grids of a readout by time move, so that a prediction may read all of them again.
        let parts = network.parts();
        let cells = parts.readout.columns * parts.readout.rows;
        let first = parts.dense.first().map(|layer| &layer.dense);
        let first = first.filter(|dense| dense.inputs() == cells * dense.channels());
        let cell = first.map_or(0, |dense| dense.channels() * dense.outputs());
        let prediction = (dense + head - cells * cell) as u64;
        let costs = GraphCosts { row: row_costs(&network), cell: cell as u64, prediction };
        let predictor =
            EventPredictor::new(mode, Arc::new(network), sensor, approximations, Options::default());
        let predictor =
            predictor.map_err(|source| weights_error(&training.label)(ModelError::Engine(source)))?;
        Ok(Self::Graph { predictor: Box::new(predictor), costs: Arc::new(costs) })
    }

    /// Forgets all events. Time and the first of consecutive windows begin at `t_us`.
    pub(crate) fn reset(&mut self, t_us: i64) {
        match self {
            Self::Graph { predictor, .. } => predictor.reset(),
            Self::Frames(press) => {
                press.feed = feed(&press.description, press.sensor, t_us).expect("there was a feed before");
                press.frames.engine.reset();
                press.frames.count = 0;
            }
        }
    }

    pub(crate) fn push(&mut self, event: Event) -> Result<(), EngineError> {
        match self {
            Self::Graph { predictor, .. } => {
                if predictor.admit(event).0 {
                    predictor.push(event);
                }
                Ok(())
            }
            Self::Frames(press) => press.feed.push(event, |frame| press.frames.take(frame)).map(drop),
        }
    }

    /// Writes the prediction at `t_us` to `values`; returns how unlike its window is.
    pub(crate) fn predict(&mut self, t_us: i64, values: &mut Vec<f32>) -> Result<Option<f32>, EngineError> {
        values.clear();
        match self {
            Self::Graph { predictor, .. } => {
                predictor.advance(t_us);
                let prediction = predictor.predict()?;
                values.extend_from_slice(prediction.values);
                Ok(prediction.unlike)
            }
            Self::Frames(press) => {
                let FramePress { feed, frames, .. } = &mut **press;
                feed.advance(t_us, |frame| frames.take(frame))?;
                if feed.slides() {
                    feed.finish(|frame| frames.take(frame))?;
                }
                let prediction = frames.engine.predict()?;
                values.extend_from_slice(prediction.values);
                Ok(prediction.unlike)
            }
        }
    }

    /// The readout of the last prediction; `None` for frame networks and from scratch.
    pub(crate) fn readout(&self) -> Option<Vec<f32>> {
        match self {
            Self::Graph { predictor, .. } => Some(predictor.engine()?.readout().concat()),
            Self::Frames(_) => None,
        }
    }

    /// Counts since the engine was made.
    pub(crate) fn count(&self) -> Count {
        match self {
            Self::Graph { predictor, costs } => {
                let counters = predictor.counters();
                let rows = || counters.layers.iter().map(|layer| layer.recomputed);
                let products: u64 = rows().zip(&costs.row).map(|(rows, cost)| rows * cost).sum();
                let of = counters.predictions;
                let cells = of.cells_recomputed - of.cells_unchanged;
                let after = cells * costs.cell + (of.read - of.reused) * costs.prediction;
                Count { rows: rows().sum(), multiply_adds: products + after }
            }
            Self::Frames(press) => {
                let layers = press.costs.iter().zip(&press.frames.engine.counters().layers);
                Count { rows: 0, multiply_adds: layers.map(|(cost, layer)| cost.of(layer)).sum() }
            }
        }
    }

    /// Rows of event graphs or pixels of frames that were computed since the engine was made.
    pub(crate) fn computed(&self) -> u64 {
        match self {
            Self::Graph { .. } => self.count().rows,
            Self::Frames(press) => {
                press.frames.engine.counters().layers.iter().map(|layer| layer.computed).sum()
            }
        }
    }

    /// Events that no filter dropped, or frames that the network saw, since the engine was made.
    pub(crate) fn entered(&self) -> u64 {
        match self {
            Self::Graph { predictor, .. } => predictor.events().pushed,
            Self::Frames(press) => press.frames.engine.counters().frames,
        }
    }
}

impl FramesSeen {
    /// Takes a frame; the network sees the first of each `every` consecutive frames.
    fn take(&mut self, output: FeedOutput<'_>) -> Result<(), EngineError> {
        let FeedOutput::Frame { values, .. } = output else {
            unreachable!("every frame is wanted, and the clock goes on")
        };
        let is_seen = self.count.is_multiple_of(self.every);
        self.count += 1;
        if is_seen { self.engine.push(values) } else { Ok(()) }
    }
}

/// A feed of all frames of `description`, from `t_us` on. A sliding window is read on demand.
pub(crate) fn feed(description: &FrameDescription, sensor: Sensor, t_us: i64) -> Result<FrameFeed, RunError> {
    let options = FeedOptions {
        late: LatePolicy::Drop,
        restart: RestartPolicy::Keep,
        every: Every::End,
        silence: EmptyFrameLimit::new(Some(u64::MAX), 0),
        keeps: false,
    };
    let feed = FrameFeed::new(description, sensor, options, Some(&FeedState::beginning(t_us)));
    let feed = feed.map_err(|source| RunError::Frames { network: description.name().to_owned(), source })?;
    Ok(feed.expect("frames of events"))
}

fn other_frames(description: &FrameDescription, expected: &str) -> EvaluateError {
    let expected = format!("networks over events, or over {expected}");
    let found = format!("{}, which reads other frames", description.name());
    EvaluateError::request(RequestPart::Networks, expected, found)
}

/// Maximum multiply-adds of a row of each of [`Network::layers`], with all edges; 0 for a pooling.
pub(crate) fn row_costs(network: &Network) -> Vec<u64> {
    let parts = network.parts();
    let events = parts.graph.reach.most();
    let mut costs: Vec<u64> =
        parts.events.blocks.iter().map(|block| block.conv.multiply_adds(events) as u64).collect();
    for (pooling, level) in &parts.pooled {
        let touching = if pooling.time.is_some() { 26 } else { 8 };
        costs.push(0);
        costs.extend(level.blocks.iter().map(|block| block.conv.multiply_adds(touching) as u64));
    }
    costs
}
