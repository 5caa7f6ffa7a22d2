//! Converts numbered packets of events to predictions: the common part of the integrations, without
//! a transport.
//!
//! ```text
//! source -> feed --packets (stream, number, events)--> [ transport ] --> coverage -> engine
//! ```
//!
//! Input: numbered packets of a sensor. Output: predictions, and a reason for each event that no
//! prediction covers. Invariants: `next = accepted + lost`; a prediction has the bits of one engine
//! with the accepted events.
//!
//! | type | use |
//! |---|---|
//! | [`Coverage`], [`Gap`], [`Reason`] | numbers of packets and events: missing ones, and the
//! reason |
//! | [`SensorEngine`] | an engine for the streams of one sensor, in the caller's thread |
//! | [`LiveSensor`] | an engine for one stream, in a thread behind a bounded queue |
//! | [`AnyNetwork`], [`AnyEngine`] | networks over events, or over frames of them |
//! | [`Replay`] | the single process that predictions are compared with |
//! | [`feed`] | the events of a recording when they are due, or of a live stream as they arrive |
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod coverage;
mod error;
mod feed;
mod live_sensor;
mod network;
mod replay;
mod saved;
mod sensor_engine;

pub use coverage::{Coverage, Gap, Losses, Lost, Numbers, Placed, Reason, by_reason};
pub use error::{Cause, PacketError, failed};
pub use feed::{FeedOptions, feed};
pub use live_sensor::{LiveOptions, LivePrediction, LiveSensor};
pub use network::{AnyEngine, AnyNetwork};
pub use replay::Replay;
pub use saved::{Mark, StateWriter};
pub use sensor_engine::{Counts, SensorEngine, Taken};

use std::time::{SystemTime, UNIX_EPOCH};

/// Nanoseconds since 1970, on this machine's clock.
pub fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}
