//! The methods of an engine under test, and of such an engine next to its full recomputation.

use meissner_engine::frames::{FrameEngine, FrameSnapshot};
use meissner_engine::{Engine, EngineError, Event, Predictor, Snapshot, WindowStatistics};
use meissner_kernels::Neighbour;

use crate::error::Difference;
use crate::stream::Step;

/// An engine under test. Implement it for your own engine.
pub trait Incremental: Predictor {
    /// A state in memory.
    type Snapshot;

    /// The state, to return to.
    fn snapshot(&self) -> Self::Snapshot;
    /// Returns to a state.
    ///
    /// # Errors
    /// The snapshot belongs to another network.
    fn restore(&mut self, snapshot: &Self::Snapshot) -> Result<(), EngineError>;
    /// The state as bytes.
    fn to_bytes(&self) -> Vec<u8>;
    /// Returns to a state that is stored as bytes.
    ///
    /// # Errors
    /// The bytes are no state of this network.
    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError>;

    /// Writes the state as bytes, forgets it, and returns to it.
    ///
    /// # Errors
    /// The engine refuses its own bytes.
    fn through_bytes(&mut self) -> Result<(), EngineError> {
        let bytes = self.to_bytes();
        self.reset();
        self.restore_bytes(&bytes)
    }

    /// Takes `inputs`, predicts, and returns to the state before them.
    ///
    /// # Errors
    /// The engine refuses an input or its own snapshot.
    fn detour(&mut self, inputs: impl IntoIterator<Item = Self::Input>) -> Result<(), EngineError> {
        let snapshot = self.snapshot();
        for input in inputs {
            self.push(&input)?;
        }
        // A prediction that is not a number is forgotten with the inputs.
        let _ = self.predict();
        self.restore(&snapshot)
    }
}

/// An engine over events, with its rows.
pub trait IncrementalEvents: Incremental<Input = Event> {
    /// Number of events in the window.
    fn nodes(&self) -> usize;
    /// In-edges of an event, by its index in the window, as [`Engine::neighbourhood`].
    fn neighbourhood(&self, index: usize) -> Vec<Neighbour>;
    /// Rows of a feature of a level as of the last prediction, as [`Engine::feature`].
    fn rows(&self, level: usize, feature: usize) -> Vec<Vec<f32>>;
    /// Sums over the window, as [`Engine::window_statistics`]; `None` for an engine without them.
    fn window_statistics(&self) -> Option<WindowStatistics> {
        None
    }
}

/// The values of the engine's prediction.
pub(crate) fn values(engine: &mut impl Predictor) -> Result<Vec<f32>, EngineError> {
    engine.predict().map(|prediction| prediction.values.to_vec())
}

/// An engine beside its full recomputation.
pub(crate) trait Checked {
    /// One input.
    type Input;
    /// Performs a step on both sides.
    fn step(&mut self, step: &Step<Self::Input>) -> Result<(), Difference>;
    /// Compares both sides.
    fn compare(&mut self) -> Result<(), Difference>;
    /// Rows that were compared, and comparisons at which both sides refused for the same reason.
    fn counts(&self) -> (u64, u64);
}

/// Implements the methods that both engines have under the same names.
macro_rules! same_methods {
    ($snapshot:ty) => {
        type Snapshot = $snapshot;

        fn snapshot(&self) -> Self::Snapshot {
            self.snapshot()
        }

        fn restore(&mut self, snapshot: &Self::Snapshot) -> Result<(), EngineError> {
            self.restore(snapshot)
        }

        fn to_bytes(&self) -> Vec<u8> {
            self.to_bytes()
        }

        fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
            self.restore_bytes(bytes)
        }
    };
}

impl Incremental for Engine {
    same_methods!(Snapshot);
}

impl IncrementalEvents for Engine {
    fn nodes(&self) -> usize {
        self.nodes()
    }

    fn neighbourhood(&self, index: usize) -> Vec<Neighbour> {
        self.neighbourhood(index)
    }

    fn rows(&self, level: usize, feature: usize) -> Vec<Vec<f32>> {
        self.feature(level, feature)
    }

    fn window_statistics(&self) -> Option<WindowStatistics> {
        Some(self.window_statistics())
    }
}

impl Incremental for FrameEngine {
    same_methods!(FrameSnapshot);
}
