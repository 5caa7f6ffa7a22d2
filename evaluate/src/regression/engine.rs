//! Networks that read events, behind the same calls: event graphs, and frame networks over a
//! sliding or over consecutive windows.
//!
//! Enters: events in order of time. Leaves: the values at any time, and counts of the work that
//! they took. The value of consecutive windows is that of the last one that has ended.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameOptions, FrameShape};
use meissner_engine::representations::{Completed, Consecutive, ConsecutiveFrames, SlidingSigned};
use meissner_engine::{EngineError, Event, Network, Options, Sensor};
use meissner_models::description::CostUnit;
use meissner_models::description::frames::SignedTiming;
use meissner_models::{AnyDescription, Description, FrameDescription, FrameSource, ModelError};
use meissner_run::RunError;
use meissner_run::approximations::Approximations;
use meissner_run::model::{LayerCost, Model, frame_network};
use meissner_run::predictor::{EventPredictor, Mode};

use crate::error::{EvaluateError, RequestPart, weights_error};
use crate::trainings::Training;

/// A network that reads events, with its engine.
#[derive(Clone)]
pub(crate) enum PressEngine {
    Graph { predictor: Box<EventPredictor>, costs: Arc<GraphCosts> },
    Frames { window: Box<SlidingSigned>, engine: Box<FrameEngine>, costs: Arc<Vec<LayerCost>> },
    Counts { windows: Box<ConsecutiveFrames>, taker: Box<WindowedEngine>, costs: Arc<Vec<LayerCost>> },
}

/// How a network over consecutive windows runs: exactly by default.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CountsOptions {
    pub(crate) convolution: Convolution,
    pub(crate) options: FrameOptions,
    /// Of so many windows the network sees the first, without the events of the others. It makes a
    /// step for each window that it sees, so that time passes more slowly for it; its last answer
    /// stands for the windows after that.
    pub(crate) every: usize,
}

impl Default for CountsOptions {
    fn default() -> Self {
        Self { convolution: Convolution::Direct, options: FrameOptions::new(), every: 1 }
    }
}

/// A frame engine that takes windows that have ended.
#[derive(Clone)]
pub(crate) struct WindowedEngine {
    engine: FrameEngine,
    every: u64,
    /// Windows that have ended since the last reset.
    ended: u64,
}

/// Multiply-adds of a network over events.
pub(crate) struct GraphCosts {
    /// Of a row of each layer.
    row: Vec<u64>,
    /// Of a changed cell of the readout, in the first dense layer.
    cell: u64,
    /// Of a prediction: all other dense layers, and the layers of a head.
    prediction: u64,
}

/// Counts of work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    /// Rows of event graphs; 0 for frames.
    pub(crate) rows: u64,
    pub(crate) multiply_adds: u64,
}

impl PressEngine {
    /// The network of `description` with the weights of `training`, for events of `sensor`.
    pub(crate) fn new(
        description: &AnyDescription,
        training: &Training,
        sensor: Sensor,
        mode: Mode,
    ) -> Result<Self, EvaluateError> {
        match description {
            AnyDescription::Events(description) => Self::graph(description, training, sensor, mode),
            AnyDescription::Frames(description) => Self::frames(description, training, sensor),
        }
    }

    fn graph(
        description: &Description,
        training: &Training,
        sensor: Sensor,
        mode: Mode,
    ) -> Result<Self, EvaluateError> {
        Self::adapted(description, training, (sensor, mode), &Approximations::default(), Ok)
    }

    /// The network of `description` as `adapt` changes it, with the filters, the tolerance and the
    /// staleness of `approximations`.
    pub(crate) fn adapted(
        description: &Description,
        training: &Training,
        (sensor, mode): (Sensor, Mode),
        approximations: &Approximations,
        adapt: impl FnOnce(Network) -> Result<Network, EvaluateError>,
    ) -> Result<Self, EvaluateError> {
        let model = Model::of(description, (&training.weights, training.label.clone()), false)?;
        let network = adapt(model.network)?;
        let dense = description.layers().iter().filter(|layer| layer.cost.per == CostUnit::Prediction);
        let dense: usize = dense.map(|layer| layer.cost.multiply_adds).sum();
        let head: usize = description.head().iter().map(|layer| layer.multiply_adds).sum();
        // The grids of a readout by time move from age to age, so that a prediction may read all of
        // them again.
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

    fn frames(
        description: &FrameDescription,
        training: &Training,
        sensor: Sensor,
    ) -> Result<Self, EvaluateError> {
        let (
            &FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, place, rule },
            FrameShape::Image { height, width, .. },
        ) = (description.source(), description.input())
        else {
            let expected = "networks over events, or over signed frames of a sliding window";
            let found = format!("{}, which reads other frames", description.name());
            return Err(EvaluateError::request(RequestPart::Networks, expected, found));
        };
        let weights = (&training.weights, training.label.clone());
        let (network, _) = frame_network(description, weights, Convolution::Direct, false)?;
        // The sides in a description are at most 4096.
        let crop = place.crop(width as u16, height as u16, sensor);
        let window = SlidingSigned::new(sensor, crop, rule, span_us, SlidingSigned::DEFAULT_CAPACITY);
        let network_name = description.name().to_owned();
        let window = window.map_err(|source| RunError::Frames { network: network_name, source })?;
        let costs = Arc::new(description.layers().iter().map(LayerCost::new).collect());
        Ok(Self::Frames { window: Box::new(window), engine: Box::new(FrameEngine::new(network)?), costs })
    }

    /// The network of `description` over counts of events in windows of which the first begins at
    /// 0.
    pub(crate) fn counts(
        description: &FrameDescription,
        training: &Training,
        sensor: Sensor,
        how: CountsOptions,
    ) -> Result<Self, EvaluateError> {
        let (
            &FrameSource::EventCounts { period_us, place, maximum },
            FrameShape::Image { height, width, .. },
        ) = (description.source(), description.input())
        else {
            let expected = "networks over events, or over counts of events in consecutive windows";
            let found = format!("{}, which reads other frames", description.name());
            return Err(EvaluateError::request(RequestPart::Networks, expected, found));
        };
        let weights = (&training.weights, training.label.clone());
        let (network, _) = frame_network(description, weights, how.convolution, false)?;
        // The sides in a description are at most 4096.
        let crop = place.crop(width as u16, height as u16, sensor);
        let windows =
            ConsecutiveFrames::counts(sensor, Consecutive { crop, period_us, start_us: Some(0) }, maximum);
        let network_name = description.name().to_owned();
        let windows = windows.map_err(|source| RunError::Frames { network: network_name, source })?;
        let costs = Arc::new(description.layers().iter().map(LayerCost::new).collect());
        let engine = FrameEngine::with_options(network, how.options)?;
        let taker = WindowedEngine { engine, every: how.every as u64, ended: 0 };
        Ok(Self::Counts { windows: Box::new(windows), taker: Box::new(taker), costs })
    }

    pub(crate) fn reset(&mut self) {
        match self {
            Self::Counts { windows, taker, .. } => {
                windows.reset();
                taker.ended = 0;
                taker.engine.reset();
            }
            Self::Graph { predictor, .. } => predictor.reset(),
            Self::Frames { window, engine, .. } => {
                window.reset();
                engine.reset();
            }
        }
    }

    pub(crate) fn push(&mut self, event: Event) -> Result<(), EngineError> {
        match self {
            Self::Graph { predictor, .. } => {
                if predictor.admit(event).0 {
                    predictor.push(event);
                }
            }
            Self::Frames { window, .. } => drop(window.push(event)),
            Self::Counts { windows, taker, .. } => {
                let mut pushed = Ok(());
                windows.push(event, |completed| taker.take(&completed, &mut pushed));
                return pushed;
            }
        }
        Ok(())
    }

    /// Writes the prediction at `t_us` to `values`.
    pub(crate) fn predict(&mut self, t_us: i64, values: &mut Vec<f32>) -> Result<(), EngineError> {
        values.clear();
        match self {
            Self::Graph { predictor, .. } => {
                predictor.advance(t_us);
                values.extend_from_slice(predictor.predict()?.values);
            }
            Self::Frames { window, engine, .. } => {
                window.advance(t_us);
                engine.push(window.frame().values)?;
                values.extend_from_slice(engine.predict()?.values);
            }
            Self::Counts { windows, taker, .. } => {
                let mut pushed = Ok(());
                windows.advance(t_us, |completed| taker.take(&completed, &mut pushed));
                pushed?;
                values.extend_from_slice(taker.engine.predict()?.values);
            }
        }
        Ok(())
    }

    /// The readout of the last prediction; `None` for frame networks and from scratch.
    pub(crate) fn readout(&self) -> Option<Vec<f32>> {
        match self {
            Self::Graph { predictor, .. } => Some(predictor.engine()?.readout().concat()),
            Self::Frames { .. } | Self::Counts { .. } => None,
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
            Self::Frames { engine, costs, .. } => of_frames(engine, costs),
            Self::Counts { taker, costs, .. } => of_frames(&taker.engine, costs),
        }
    }

    /// Rows of event graphs, or pixels of frame networks, that were computed since the engine was
    /// made.
    pub(crate) fn computed(&self) -> u64 {
        let pixels = |engine: &FrameEngine| engine.counters().layers.iter().map(|layer| layer.computed).sum();
        match self {
            Self::Graph { .. } => self.count().rows,
            Self::Frames { engine, .. } => pixels(engine),
            Self::Counts { taker, .. } => pixels(&taker.engine),
        }
    }

    /// Events that no filter dropped, or windows that the network saw, since the engine was made.
    pub(crate) fn entered(&self) -> u64 {
        match self {
            Self::Graph { predictor, .. } => predictor.events().pushed,
            Self::Frames { engine, .. } => engine.counters().frames,
            Self::Counts { taker, .. } => taker.engine.counters().frames,
        }
    }
}

fn of_frames(engine: &FrameEngine, costs: &[LayerCost]) -> Count {
    let layers = costs.iter().zip(&engine.counters().layers);
    Count { rows: 0, multiply_adds: layers.map(|(cost, layer)| cost.of(layer)).sum() }
}

/// Largest number of multiply-adds of a row, for each of [`Network::layers`]: at the event level
/// with all in-edges that the network allows, at a pooled level with all adjacent cells; 0 for a
/// pooling.
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

impl WindowedEngine {
    /// Pushes windows that have ended, unless `pushed` has failed.
    fn take(&mut self, completed: &Completed<'_>, pushed: &mut Result<(), EngineError>) {
        let count = if let Completed::Empty(run) = completed { run.count } else { 1 };
        // Window 0 is seen, and then every `every`-th one.
        let seen = |windows: u64| windows.div_ceil(self.every);
        let (before, after) = (seen(self.ended), seen(self.ended + count));
        self.ended += count;
        match completed {
            _ if pushed.is_err() || before == after => {}
            Completed::Frame(frame) => *pushed = self.engine.push(frame.values),
            Completed::Empty(_) => {
                let zeros = vec![0.0; self.engine.network().input().values()];
                *pushed = (before..after).try_for_each(|_| self.engine.push(&zeros));
            }
        }
    }
}
