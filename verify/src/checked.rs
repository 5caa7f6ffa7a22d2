//! Compares an engine with its full recomputation: a batch, or a frame engine that skips nothing.
//!
//! Input: steps. Output: the first difference in outcomes, neighbourhoods, rows and predictions.
//! Invariant: the batch gets exactly the events that the admission rules accept.

use std::fmt::Display;
use std::sync::Arc;

use meissner_engine::frames::{FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_engine::{
    BatchEngine, Engine, EngineError, Event, Network, Options, Outcome, Search, Sensor, Trace,
};
use meissner_kernels::Neighbour;

use crate::error::{Difference, first_difference};
use crate::incremental::{Checked, Incremental, IncrementalEvents, values};
use crate::stream::{Script, Step};

/// An engine that fills expired rows with NaN, so that a read of a stale row is visible.
///
/// # Errors
/// As [`Engine::with_options`].
pub fn poisoned(network: Arc<Network>, sensor: Sensor) -> Result<Engine, EngineError> {
    Engine::with_options(network, sensor, Options::new().with_poison(true))
}

/// An engine beside a batch over the same events.
#[derive(Clone, Debug)]
pub struct CheckedEngine<E = Engine> {
    /// The engine.
    pub engine: E,
    /// The batch.
    pub batch: BatchEngine,
    /// Comparisons at which both sides refused to predict, for the same reason.
    pub refused: u64,
    /// Rows that were compared.
    pub rows: u64,
}

impl CheckedEngine {
    /// An engine that fills expired rows with NaN, so that a read of a stale row is visible.
    ///
    /// # Panics
    /// If the engine refuses the network.
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor, search: Search) -> Self {
        Self::with_options(network, sensor, search, Options::new().with_poison(true))
    }

    /// An engine with these options.
    ///
    /// # Panics
    /// If the engine refuses the network or the options.
    pub fn with_options(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        search: Search,
        options: Options,
    ) -> Self {
        let network = network.into();
        let engine = Engine::with_options(Arc::clone(&network), sensor, options)
            .expect("an exact network and valid options");
        let batch = BatchEngine::new(network, sensor).expect("the sensor has pixels");
        Self::of(engine, batch.with_search(search).with_late(options.late))
    }
}

impl<E: IncrementalEvents> CheckedEngine<E> {
    /// `engine` beside `batch`, both without events, of the same network, sensor and late policy.
    pub fn of(engine: E, batch: BatchEngine) -> Self {
        Self { engine, batch, refused: 0, rows: 0 }
    }

    /// Pushes an event into the engine and into the batch.
    ///
    /// # Panics
    /// If the outcomes differ.
    pub fn push(&mut self, event: Event) -> Outcome {
        let outcome = self.batch.push(event);
        assert_eq!(self.engine.push(&event), Ok(outcome), "{event:?}");
        outcome
    }

    /// Advances both clocks.
    pub fn advance(&mut self, t_us: i64) {
        self.engine.advance(t_us);
        self.batch.advance(t_us);
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.engine.reset();
        self.batch.reset();
    }

    /// The prediction, which must equal the batch's; empty if both refuse for the same reason.
    ///
    /// # Errors
    /// The predictions differ.
    pub fn predict(&mut self) -> Result<Vec<f32>, Difference> {
        let expected = self.batch.trace().map(|trace| trace.prediction);
        let found = values(&mut self.engine);
        self.refused += u64::from(!Difference::of_predictions(&found, &expected)?);
        Ok(found.unwrap_or_default())
    }

    /// Compares prediction, neighbourhoods and every row with the batch's, bit for bit. If both
    /// refuse to predict for the same reason, nothing else is compared.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&mut self) -> Result<(), Difference> {
        self.compare_with(self.batch.batch().search())
    }

    /// As [`Self::compare`], with another search in the batch.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare_with(&mut self, search: Search) -> Result<(), Difference> {
        let trace = self.batch.batch().clone().with_search(search).forward(self.batch.stream());
        let prediction = values(&mut self.engine);
        let (trace, prediction) = match (trace, prediction) {
            (Ok(trace), Ok(prediction)) => (trace, prediction),
            (trace, prediction) => {
                Difference::of_predictions(&prediction, &trace.map(|trace| trace.prediction))?;
                self.refused += 1;
                return Ok(());
            }
        };
        self.compare_windows()?;
        self.compare_neighbourhoods(&trace)?;
        self.compare_rows(&trace)?;
        Difference::of_predictions(&Ok(prediction), &Ok(trace.prediction)).map(drop)
    }

    fn compare_windows(&self) -> Result<(), Difference> {
        let Some(found) = self.engine.window_statistics() else { return Ok(()) };
        let expected = self.batch.window_statistics();
        if found == expected {
            return Ok(());
        }
        Err(Difference::Window { found: Box::new(found), expected: Box::new(expected) })
    }

    fn compare_neighbourhoods(&self, trace: &Trace) -> Result<(), Difference> {
        let events = &trace.levels[0];
        let (nodes, first) = (events.features[0].rows() - events.first, events.first as u32);
        if self.engine.nodes() != nodes {
            return Err(Difference::Nodes { found: self.engine.nodes(), expected: nodes });
        }
        for event in 0..nodes {
            let edges = events.edges.row(events.first + event).iter();
            // A frozen neighbour may have left the window; the engine does not list it any more.
            let present = edges.filter(|n| n.row >= first);
            let expected: Vec<Neighbour> = present.map(|n| Neighbour { row: n.row - first, ..*n }).collect();
            let found = self.engine.neighbourhood(event);
            if found != expected {
                return Err(Difference::Neighbourhood { event, found, expected });
            }
        }
        Ok(())
    }

    pub(crate) fn compare_rows(&mut self, trace: &Trace) -> Result<(), Difference> {
        for (l, level) in trace.levels.iter().enumerate() {
            for (f, feature) in level.features.iter().enumerate() {
                let found = self.engine.rows(l, f);
                let expected = (level.first..feature.rows()).map(|row| feature.values(row).collect());
                let expected: Vec<Vec<f32>> = expected.collect();
                self.rows += expected.len() as u64;
                let values = |rows: &[Vec<f32>]| rows.iter().map(Vec::len).sum();
                if found.len() != expected.len() || values(&found) != values(&expected) {
                    let (found, expected) = (values(&found), values(&expected));
                    return Err(Difference::Size { layer: self.layer(l, f), found, expected });
                }
                for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    if let Some((channel, found, expected)) = first_difference(found, expected) {
                        let layer = self.layer(l, f);
                        return Err(Difference::Row { layer, row, channel, found, expected });
                    }
                }
            }
        }
        Ok(())
    }

    /// The layer that writes a feature.
    fn layer(&self, level: usize, feature: usize) -> String {
        let network = self.batch.network();
        match (level, feature) {
            (0, 0) => "events".to_owned(),
            (_, 0) => network.parts().pooled[level - 1].0.name.clone(),
            _ => network.level(level).blocks[feature - 1].name.clone(),
        }
    }

    /// Runs a script, comparing at every prediction, after every reset and return, and at the end.
    ///
    /// # Errors
    /// The first difference, and its step.
    pub fn run(&mut self, script: &Script) -> Result<(), String> {
        self.run_with(script, Self::compare)
    }

    /// As [`Self::run`], with `check` instead of the comparison.
    ///
    /// # Errors
    /// The first difference, and its step.
    pub fn run_with<D: Display>(
        &mut self,
        script: &Script,
        mut check: impl FnMut(&mut Self) -> Result<(), D>,
    ) -> Result<(), String> {
        for (i, step) in script.steps.iter().enumerate() {
            self.step(step).map_err(|e| format!("step {i}: {e}"))?;
            if step.is_compared() {
                check(self).map_err(|e| format!("step {i}: {e}"))?;
            }
        }
        check(self).map_err(|e| format!("at the end: {e}"))
    }
}

impl<E: IncrementalEvents> Checked for CheckedEngine<E> {
    type Input = Event;

    fn step(&mut self, step: &Step) -> Result<(), Difference> {
        match *step {
            Step::Push(event) => {
                let expected = self.batch.push(event);
                let found = self.engine.push(&event).map_err(|e| Difference::failed("push", &e))?;
                if found != expected {
                    return Err(Difference::Outcome { found, expected });
                }
            }
            Step::Advance(t_us) => self.advance(t_us),
            Step::Predict => {}
            Step::Reset => self.reset(),
            Step::Snapshot => {
                let now = self.batch.now_us().unwrap_or(0);
                let ahead = (0..5).map(|i| Event::new(now.saturating_add(40 * i), i as u16, 1, true));
                self.engine.detour(ahead).map_err(|e| Difference::failed("restore", &e))?;
            }
            Step::Bytes => {
                self.engine.through_bytes().map_err(|e| Difference::failed("restore_bytes", &e))?;
            }
        }
        Ok(())
    }

    fn compare(&mut self) -> Result<(), Difference> {
        self.compare()
    }

    fn counts(&self) -> (u64, u64) {
        (self.rows, self.refused)
    }
}

/// A frame engine, and one over the same frames that computes every value of every frame.
pub(crate) struct CheckedFrames<E> {
    engine: E,
    whole: FrameEngine,
    values: u64,
    refused: u64,
}

impl<E> CheckedFrames<E> {
    /// `engine`, new, of `network`.
    pub(crate) fn of(engine: E, network: Arc<FrameNetwork>) -> Result<Self, EngineError> {
        let whole = FrameEngine::with_options(network, FrameOptions::new().with_skip(Skip::Nothing))?;
        Ok(Self { engine, whole, values: 0, refused: 0 })
    }
}

impl<E: Incremental<Input = Vec<f32>>> Checked for CheckedFrames<E> {
    type Input = Vec<f32>;

    fn step(&mut self, step: &Step<Vec<f32>>) -> Result<(), Difference> {
        let done = match step {
            Step::Push(frame) => self.whole.push(frame).and_then(|()| self.engine.push(frame).map(drop)),
            Step::Advance(_) | Step::Predict => Ok(()),
            Step::Reset => {
                self.whole.reset();
                self.engine.reset();
                Ok(())
            }
            Step::Snapshot => self.engine.detour([vec![1.0; self.whole.network().input().values()]]),
            Step::Bytes => self.engine.through_bytes(),
        };
        done.map_err(|error| Difference::failed("a call of the engine", &error))
    }

    fn compare(&mut self) -> Result<(), Difference> {
        let expected = values(&mut self.whole);
        self.values += expected.as_ref().map_or(0, Vec::len) as u64;
        self.refused += u64::from(!Difference::of_predictions(&values(&mut self.engine), &expected)?);
        Ok(())
    }

    fn counts(&self) -> (u64, u64) {
        (self.values, self.refused)
    }
}
