//! Errors of the node.

use std::error::Error as StdError;

use meissner_io::IoError;
use meissner_packets::PacketError;
use meissner_run::RunError;

/// The node cannot start, or cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A step of ROS 2 fails.
    #[error("cannot {step}")]
    Ros {
        /// The step.
        step: &'static str,
        /// The reason.
        source: Box<dyn StdError + Send + Sync>,
    },
    /// A name is no name of ROS 2.
    #[error("{what}: expected a name of ROS 2 such as {expected}, got {found}")]
    Name {
        /// What it names.
        what: &'static str,
        /// An example.
        expected: &'static str,
        /// The name.
        found: String,
    },
    /// The network.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl Error {
    /// `step` fails because of `reason`.
    pub fn ros(step: &'static str, reason: impl std::fmt::Display) -> Self {
        Self::Ros { step, source: reason.to_string().into() }
    }
}

/// Why a packet is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Refused {
    /// The sensor has a side without pixels, or of more than 16 bits.
    #[error("sensor: expected 1 to 65535 pixels a side, got {width}x{height}")]
    Sensor {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The most significant byte of its events comes first.
    #[error("events: expected the least significant byte first, got is_bigendian")]
    BigEndian,
    /// Its events cannot be decoded.
    #[error(transparent)]
    Events(#[from] IoError),
    /// The engine does not take its sensor.
    #[error(transparent)]
    Packets(#[from] PacketError),
}
