//! State and its order: events -> window -> graph -> dirty rows -> layers -> readout; frames beside it.
#![forbid(unsafe_code)]

mod activations;
mod adapt;
mod admission;
mod after;
mod batch;
mod cells;
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
mod maxima;
mod members;
mod metric;
mod network;
mod pooled;
mod queues;
mod readers;
mod readout;
pub mod representations;
mod rows;
mod snapshot;
mod stages;
mod stale;
mod step;
mod window;

pub use admission::{Admission, LatePolicy, Outcome};
pub use batch::{Batch, Cells, Edges, Graph, LevelTrace, Search, Stream, Trace};
pub use counters::{Counters, DropReason, EventCounters, LayerCounters, PredictionCounters};
pub use engine::{Engine, Options, Prediction, Snapshot};
pub use error::EngineError;
pub use event::{Event, Sensor};
pub use fraction::Fraction;
pub use network::{
    Block, Candidates, DenseLayer, GraphRule, Level, Lifetime, Network, NetworkParts, Normalisation, Pooling,
    Position, Reach, Readout,
};
pub use snapshot::snapshot_note;
pub use stages::Stage;
pub use stale::{StaleReadout, Staleness};
