//! Incremental inference over streams: an engine keeps the activations of a network and computes again what an event or a
//! frame changes, bit for bit as if everything had been computed.
//!
//! ```text
//! events -> admission -> window -> event graph -> changed rows -> layers -> readout -> prediction
//! frames -> changed pixels -> layers and states -> prediction
//! ```
//!
//! | type | what it is |
//! |---|---|
//! | [`Engine`] | a [`Network`] over the events of a sliding window: push, advance, predict, reset, snapshot, restore |
//! | [`Batch`] | the same network from scratch, on any number of streams: the oracle of the engine |
//! | [`BatchEngine`] | a batch with the verbs of the engine; [`Predictor`] is what all engines have in common |
//! | [`frames::FrameEngine`] | a network over frames, with the same verbs |
//! | [`Event`], [`Sensor`] | a pixel at a time in microseconds, and the size that it is on |
//! | [`Prediction`], [`Counters`] | values with their time and cost; what was computed, skipped and dropped |
//! | [`filters`], [`representations`] | what stands before an engine: event filters; frames out of events |
//!
//! Networks usually come from description files and weights (crate `meissner_models`). This one is made by hand:
//!
//! ```
//! use meissner_engine::{Batch, Engine, Event, Sensor, Stream};
//! use meissner_engine::{Block, Candidates, DenseLayer, GraphRule, Level, Lifetime, Network};
//! use meissner_engine::{NetworkParts, Normalisation, Reach, Readout};
//! use meissner_kernels::{Activation, Dense, SplineConv, SplineParts};
//!
//! // One spline block over the 8 nearest events of the past, its maximum over the image, one dense layer.
//! let spline = SplineParts { inputs: 1, outputs: 4, kernel: [2, 2, 2], weight: vec![0.5; 8 * 4], ..Default::default() };
//! let conv = SplineConv::new(&spline)?.into();
//! let dense = Dense::new(1, 4, 1, &[1.0; 4], None, Activation::Identity)?;
//! let network = Network::new(NetworkParts {
//!     name: "by hand".to_owned(),
//!     span_us: 50_000,
//!     capacity: 1024,
//!     graph: GraphRule { reach: Reach::Knn { k: 8 }, candidates: Candidates::Past(Lifetime::Frozen) },
//!     normalisation: Normalisation::Fixed,
//!     events: Level { scale: 0.5, blocks: vec![Block { name: "conv".to_owned(), input: 0, skip: None, conv }] },
//!     pooled: Vec::new(),
//!     readout: Readout { from: 1, columns: 1, rows: 1, by_time: false },
//!     dense: vec![DenseLayer { name: "out".to_owned(), dense }],
//!     head: None,
//! })?;
//!
//! let sensor = Sensor::new(64, 48);
//! let mut engine = Engine::new(network, sensor)?;
//! let events = [Event::new(0, 10, 10, true), Event::new(900, 11, 10, true), Event::new(1500, 11, 11, false)];
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
//! An unoptimised build is many times slower, with the same bits: measure with `--release`.
#![forbid(unsafe_code)]

mod activations;
mod admission;
mod batch;
mod batch_engine;
mod cells;
mod convolution;
mod counters;
mod delta;
mod engine;
mod error;
mod event;
pub mod filters;
mod fingerprint;
mod fraction;
pub mod frames;
mod graph;
mod grid;
mod head;
mod maxima;
mod members;
mod merged;
mod metric;
mod network;
mod options;
mod pooled;
mod predictor;
mod queues;
mod readers;
mod readout;
pub mod representations;
mod room;
mod rows;
mod snapshot;
mod stages;
mod stale;
mod step;
mod window;

pub use admission::{Admission, LatePolicy, Outcome};
pub use batch::{Batch, Cells, Edges, Graph, LevelTrace, Places, Propose, Search, Stream, Trace};
pub use batch_engine::BatchEngine;
pub use convolution::{ConvolutionScratch, GraphConvolution};
pub use counters::{Counters, DropReason, EventCounters, LayerCounters, PredictionCounters};
pub use engine::{Engine, Prediction, Snapshot};
pub use error::EngineError;
pub use event::{Event, Sensor};
pub use fraction::Fraction;
pub use network::{
    Block, Candidates, DenseLayer, GraphRule, Level, Lifetime, Network, NetworkParts, Normalisation, Pooling,
    Position, Reach, Readout,
};
pub use options::Options;
pub use predictor::Predictor;
pub use snapshot::{SnapshotOf, snapshot_note};
pub use stages::Stage;
pub use stale::{StaleReadout, Staleness};
