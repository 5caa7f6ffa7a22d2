//! Errors of engines, networks and batches.

use thiserror::Error;

use crate::Sensor;
use crate::frames::FrameShape;

/// An engine, network or batch refused its input, or a result is not a number.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EngineError {
    /// A network's parts do not fit together.
    #[error("layer {layer:?}: {what}: expected {expected}, found {found}")]
    Network {
        /// Name of the layer.
        layer: String,
        /// The value that does not fit.
        what: &'static str,
        /// Values that would fit.
        expected: String,
        /// The value found.
        found: String,
    },
    /// A layer's parameters were refused by its kernel.
    #[error("layer {layer:?}")]
    Layer {
        /// Name of the layer.
        layer: String,
        /// The kernel's error.
        source: meissner_kernels::KernelError,
    },
    /// A value of the network's graph or of the engine's options is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Name of the value.
        what: &'static str,
        /// The admissible range.
        expected: String,
        /// The value found.
        found: String,
    },
    /// The sensor has no pixels.
    #[error("sensor {0}: expected at least one pixel on each axis")]
    Sensor(Sensor),
    /// The engine would need more memory than its limit.
    #[error(
        "network {network:?} on {sensor} with a capacity of {capacity} events: expected at most {limit} bytes of state, found {bytes}"
    )]
    Memory {
        /// Name of the network.
        network: String,
        /// The sensor.
        sensor: Sensor,
        /// Capacity of the window in events.
        capacity: usize,
        /// Bytes needed.
        bytes: u128,
        /// Limit in bytes.
        limit: u128,
    },
    /// A frame engine would need more memory than its limit.
    #[error("network {network:?}: expected at most {limit} bytes of activations and state, found {bytes}")]
    FrameMemory {
        /// Name of the network.
        network: String,
        /// Bytes needed.
        bytes: u128,
        /// Limit in bytes.
        limit: u128,
    },
    /// The number of values of a frame differs from the network's input.
    #[error("values of a frame: expected {} ({expected}), found {found}", .expected.values())]
    FrameLength {
        /// Expected shape of a frame.
        expected: FrameShape,
        /// Number of values found.
        found: usize,
    },
    /// A value of a frame is not finite.
    #[error("frame: expected finite values, found {value} as value {at}")]
    FrameValue {
        /// Index of the value in the frame.
        at: usize,
        /// The value.
        value: f32,
    },
    /// Attributes and grid origin are recomputed from each graph, so one event can change every
    /// row.
    #[error(
        "network {0:?} normalises edge attributes and grid origin over each graph: one event can change every row, so \
         it has no incremental form; run it in batch mode"
    )]
    NotIncremental(String),
    /// A stream contains an event or a time that no engine would have accepted.
    #[error("stream: {what}: expected {expected}, found {found}")]
    Stream {
        /// The value that does not fit.
        what: &'static str,
        /// Values that would fit.
        expected: String,
        /// The value found.
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
    /// The bytes of a snapshot break its format, or describe a state that no engine can reach.
    #[error("snapshot: {what} at byte {at}: expected {expected}, found {found}")]
    SnapshotBytes {
        /// The field that is wrong.
        what: String,
        /// Offset of the field in bytes.
        at: usize,
        /// Values that it can have.
        expected: String,
        /// The value found.
        found: String,
    },
    /// A snapshot belongs to a different network, sensor, set of options or format version.
    #[error("snapshot: expected {what} {expected}, found {found}")]
    Snapshot {
        /// The property that differs.
        what: &'static str,
        /// The engine's value.
        expected: String,
        /// The snapshot's value.
        found: String,
    },
}

pub(crate) fn misfit(
    layer: &str,
    what: &'static str,
    expected: impl ToString,
    found: impl ToString,
) -> EngineError {
    let (layer, expected) = (layer.to_owned(), expected.to_string());
    EngineError::Network { layer, what, expected, found: found.to_string() }
}

pub(crate) fn option(what: &'static str, expected: impl ToString, found: impl ToString) -> EngineError {
    EngineError::Option { what, expected: expected.to_string(), found: found.to_string() }
}

pub(crate) fn in_range(what: &'static str, value: i64, low: i64, high: i64) -> Result<(), EngineError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(option(what, format!("{low} to {high}"), value)) }
}
