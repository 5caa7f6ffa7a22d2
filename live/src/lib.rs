//! An engine beside a sensor that may be faster than it: a bounded queue, a thread that owns the engine, and predictions
//! within a deadline.
//!
//! ```text
//! sensor's thread          Input --events, time--> bounded queue --> worker, which owns the engine
//! controller's thread      Live  --predict(deadline)-------------->  the newest finished prediction
//! ```
//!
//! | file | job |
//! |---|---|
//! | `overload` | what becomes of events that come faster than they are taken, and the counts of it |
//! | `intake` | the queue: bounded, and every offered event accounted for |
//! | `shared` | what the threads have in common, and how they wait for each other |
//! | `input`, `live` | the handles of the two sides |
//! | `worker`, `pace` | the thread that owns the engine; when it stops taking events for a prediction |
//! | `predictor` | what the worker needs of an engine |
//! | `record` | what a batch needs of a stream's past |
//! | `recorded` | an engine that remembers what it accepted, to be held against a batch |
//!
//! Bits: what the engine is given is a sequence of events and moves of time, and its predictions are those of the same
//! sequence without threads. Which events are in the sequence depends, under overload, on how fast the machine is.
#![forbid(unsafe_code)]

mod error;
mod input;
mod intake;
mod live;
mod overload;
mod pace;
mod predictor;
mod record;
mod recorded;
mod shared;
mod worker;

pub use error::LiveError;
pub use input::Input;
pub use live::{Live, Timely};
pub use overload::{Overload, QueueCounters, QueueOptions};
pub use predictor::Predictor;
pub use record::Record;
pub use recorded::Recorded;
