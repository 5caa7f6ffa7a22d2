//! A control loop of 1 kHz over live predictions, and the simulated fingertip that it levels on a tilted plane.
//!
//! ```text
//! fingertip   plane -> dome -> camera --events (UDP)--> queue -> engine's thread        controller
//!               ^                                                   | predict(deadline)
//!             wrist <--target (UDP)-- law of levelling <------------+  once in each cycle
//!               +------state (UDP)------^
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`law`] | from a predicted angle to the target of the wrist |
//! | [`wrist`] | the simulated actuator |
//! | [`tap`], [`fingertip`], [`surface`] | when the dome touches; what its camera sees; the plane that it touches |
//! | [`datagrams`] | state and target as bytes |
//! | [`realtime`] | absolute sleeps, priorities, locked memory |
//! | [`metered`], [`timing`] | the engine's computing time, and whose fault a missed deadline is |
//! | [`feed`], [`control`] | the sensor's thread; the loop |
//! | [`processor`], [`study`] | the closed loop in simulated time, with processors that are too slow |
//!
//! Invariant: nothing is allocated in any thread while the loop runs.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod control;
pub mod datagrams;
pub mod feed;
pub mod fingertip;
pub mod law;
pub mod metered;
pub mod processor;
pub mod realtime;
pub mod study;
pub mod surface;
pub mod tap;
pub mod timing;
pub mod wrist;

/// Angles about x and y in radians: roll and pitch. They are small, so they are added and subtracted like vectors.
pub type Angles = [f64; 2];

/// The size of `angles` together: the tilt, in radians.
pub fn tilt([roll, pitch]: Angles) -> f64 {
    libm::sqrt(roll * roll + pitch * pitch)
}
