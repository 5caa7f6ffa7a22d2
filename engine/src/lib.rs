//! Incremental inference over streams: an engine keeps the activations of a network and recomputes
//! only what an event or a frame changes. The result equals full recomputation, bit for bit.
//!
//! ```text
//! events -> admission -> window -> event graph -> changed rows -> layers -> readout -> prediction
//! frames -> changed pixels -> layers and states -> prediction
//! ```
//!
//! | type | what it is |
//! |---|---|
//! | [`Engine`] | a [`Network`] over a sliding window of events: push, advance, predict, snapshot |
//! | [`Batch`] | the same network from scratch, on any number of streams: the engine's oracle |
//! | [`BatchEngine`] | a batch as an engine; [`Predictor`] is the trait of all engines |
//! | [`frames::FrameEngine`] | a network over frames, with the same methods |
//! | [`Event`], [`Sensor`] | a brightness change at a pixel and time (us); the sensor's size |
//! | [`Prediction`], [`Counters`] | values with time and cost; counts of work done and skipped |
//! | [`filters`], [`representations`] | preprocessing: event filters; frames built from events |
//!
//! Networks usually come from description files and weights (`meissner_models`). A network built by
//! hand:
//!
//! ```
//! use meissner_engine::{Batch, Engine, Event, Sensor, Stream};
//! use meissner_engine::{Aggregation, Block, Candidates, DenseLayer, GraphRule, Level, Lifetime};
//! use meissner_engine::{Network, NetworkParts, Normalisation, Reach, Readout};
//! use meissner_kernels::{Activation, Dense, SplineConv, SplineParts};
//!
//! // One spline block over the 8 nearest past events, its maximum over the image, a dense layer.
//! let kernel = [2, 2, 2];
//! let weight = vec![0.5; 8 * 4];
//! let spline = SplineParts { inputs: 1, outputs: 4, kernel, weight, ..Default::default() };
//! let conv = SplineConv::new(&spline)?.into();
//! let dense = Dense::new(1, 4, 1, &[1.0; 4], None, Activation::Identity)?;
//! let network = Network::new(NetworkParts {
//!     name: "by hand".to_owned(),
//!     span_us: 50_000,
//!     capacity: 1024,
//!     graph: GraphRule {
//!         reach: Reach::Knn { k: 8 },
//!         candidates: Candidates::Past(Lifetime::Frozen),
//!     },
//!     normalisation: Normalisation::Fixed,
//!     place: None,
//!     events: Level {
//!         scale: 0.5,
//!         blocks: vec![Block { name: "conv".to_owned(), input: 0, skip: None, conv }],
//!     },
//!     pooled: Vec::new(),
//!     readout: Readout {
//!         from: 1,
//!         columns: 1,
//!         rows: 1,
//!         aggregation: Aggregation::Max,
//!         by_time: false,
//!     },
//!     dense: vec![DenseLayer { name: "out".to_owned(), dense }],
//!     head: None,
//! })?;
//!
//! let sensor = Sensor::new(64, 48);
//! let mut engine = Engine::new(network, sensor)?;
//! let rows = [(0, 10, 10, true), (900, 11, 10, true), (1500, 11, 11, false)];
//! let events = rows.map(|(t, x, y, on)| Event::new(t, x, y, on));
//! engine.push_slice(&events);
//! let prediction = engine.predict()?;
//! assert_eq!((prediction.nodes, prediction.t_us), (3, Some(1500)));
//!
//! let values = prediction.values.to_vec();
//! let from_scratch = Batch::new(engine.network().clone(), sensor)?.forward(Stream::new(&events))?;
//! assert_eq!(values[0].to_bits(), from_scratch.prediction[0].to_bits());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! An unoptimised build gives the same bits but is many times slower: measure with `--release`.
#![forbid(unsafe_code)]
#![allow(clippy::inline_always, reason = "compiled for the instruction set that runs it")]

/// The names of an enum's variants, as reports show them.
macro_rules! names {
    ($kind:ident { $($variant:ident => $name:literal),* $(,)? }) => {
        impl $kind {
            /// Short name, as in the program's reports.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),*
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

mod activations;
mod admission;
mod batch;
mod batch_engine;
mod cells;
mod convolution;
mod counters;
mod edges;
mod engine;
mod error;
mod event;
pub mod filters;
mod fingerprint;
pub mod frames;
mod gaussian;
mod graph;
mod grid;
mod head;
mod maxima;
mod memory;
mod merged;
mod metric;
mod nearest;
mod network;
mod options;
mod pooled;
mod predictor;
mod queues;
mod readers;
mod readout;
pub mod representations;
mod restart;
mod rows;
mod snapshot;
mod stale;
mod step;
mod sums;
mod unlikeness;
mod window;

pub use admission::{Admission, LatePolicy};
pub use batch::{Batch, Cells, Edges, Graph, LevelTrace, Places, Propose, Search, Stream, Trace};
pub use batch_engine::BatchEngine;
pub use convolution::{ConvolutionScratch, GraphConvolution};
pub use counters::{
    ComputedRow, Counters, DropReason, EventCounters, LayerCounters, Outcome, PredictionCounters, Stage,
};
pub use engine::{Engine, Prediction, Snapshot};
pub use error::EngineError;
pub use event::{Event, Sensor};
pub use network::{
    Aggregation, Block, Candidates, DenseLayer, Fraction, GraphRule, Level, Lifetime, Network, NetworkParts,
    Normalisation, Pooling, Position, Reach, Readout,
};
pub use options::Options;
pub use predictor::Predictor;
pub use restart::{CONFIRMING, ClockWatch, Decision, Held, MAX_SILENCE_US, RestartPolicy};
pub use snapshot::{SnapshotOf, snapshot_note};
pub use stale::{StaleReadout, Staleness};
pub use unlikeness::{Features, TrainingWindows, WindowStatistics};

#[cfg(test)]
mod tests {
    mod rows;
    mod search;
    mod time;
}
