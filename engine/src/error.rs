//! What can go wrong in an engine, its network, or a batch.

use thiserror::Error;

use crate::Sensor;
use crate::frames::FrameShape;

/// An engine, a network or a batch refuses what it was given, or found that a result is not a number.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EngineError {
    /// A network's parts do not fit together.
    #[error("layer {layer:?}: {what}: expected {expected}, found {found}")]
    Network {
        /// Name of the layer.
        layer: String,
        /// What does not fit.
        what: &'static str,
        /// What would fit.
        expected: String,
        /// What came.
        found: String,
    },
    /// A layer's parameters were refused by its kernel.
    #[error("layer {layer:?}")]
    Layer {
        /// Name of the layer.
        layer: String,
        /// Why.
        source: meissner_kernels::KernelError,
    },
    /// A value of the network's graph or of the engine's options is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Which value.
        what: &'static str,
        /// The admissible range.
        expected: String,
        /// What came.
        found: String,
    },
    /// The sensor has no pixels.
    #[error("sensor {0}: expected at least one pixel on each axis")]
    Sensor(Sensor),
    /// The engine would need more memory than it may take.
    #[error(
        "network {network:?} on {sensor} with a capacity of {capacity} events: expected at most {limit} bytes of state, found {bytes}"
    )]
    Memory {
        /// Name of the network.
        network: String,
        /// The sensor.
        sensor: Sensor,
        /// Events that the window may hold.
        capacity: usize,
        /// Bytes that it would take.
        bytes: u128,
        /// Bytes that it may take.
        limit: u128,
    },
    /// A frame engine would need more memory than it may take.
    #[error("network {network:?}: expected at most {limit} bytes of activations and state, found {bytes}")]
    FrameMemory {
        /// Name of the network.
        network: String,
        /// Bytes that it would take.
        bytes: u128,
        /// Bytes that it may take.
        limit: u128,
    },
    /// A frame has another number of values than the network's input.
    #[error("values of a frame: expected {} ({expected}), found {found}", .expected.values())]
    FrameLength {
        /// Shape of a frame.
        expected: FrameShape,
        /// Number of values.
        found: usize,
    },
    /// A value of a frame is not finite.
    #[error("frame: expected finite values, found {value} as value {at}")]
    FrameValue {
        /// Place of the value in the frame.
        at: usize,
        /// The value.
        value: f32,
    },
    /// The network's edge attributes and grid origin are recomputed from each graph, so that a single event can
    /// change every row: there is no incremental form.
    #[error(
        "network {0:?} normalises edge attributes and grid origin over each graph: one event can change every row, so \
         it has no incremental form; run it in batch mode"
    )]
    NotIncremental(String),
    /// A stream holds what no engine would have accepted.
    #[error("stream: {what}: expected {expected}, found {found}")]
    Stream {
        /// What does not fit.
        what: &'static str,
        /// What would fit.
        expected: String,
        /// What came.
        found: String,
    },
    /// A layer computed a value that is not a number.
    #[error("layer {layer:?} computed NaN for {rows} of its rows: no prediction")]
    NotANumber {
        /// Name of the layer.
        layer: String,
        /// Rows of the window that hold NaN.
        rows: usize,
    },
    /// The bytes of a snapshot are not what its format says, or not what an engine can be in.
    #[error("snapshot: {what} at byte {at}: expected {expected}, found {found}")]
    SnapshotBytes {
        /// What is wrong.
        what: String,
        /// Where it starts.
        at: usize,
        /// What it can be.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A snapshot belongs to another network, sensor or set of options, or is of another version.
    #[error("snapshot: expected {what} {expected}, found {found}")]
    Snapshot {
        /// What differs.
        what: &'static str,
        /// What the engine has.
        expected: String,
        /// What the snapshot has.
        found: String,
    },
}

/// A value that is out of range.
pub(crate) fn option(what: &'static str, expected: impl ToString, found: impl ToString) -> EngineError {
    EngineError::Option { what, expected: expected.to_string(), found: found.to_string() }
}

/// Refuses a value outside of `low..=high`.
pub(crate) fn in_range(what: &'static str, value: i64, low: i64, high: i64) -> Result<(), EngineError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(option(what, format!("{low} to {high}"), value)) }
}
