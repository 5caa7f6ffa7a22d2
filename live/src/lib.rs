//! Live inference for a sensor that may be faster than the engine: a bounded queue, a thread that
//! owns the engine, and predictions within a deadline.
//!
//! ```text
//! sensor's thread      Input --events, time--> bounded queue --> worker with the engine
//! controller's thread  Live  --predict(deadline)---------->  the newest finished prediction
//! ```
//!
//! | type | use |
//! |---|---|
//! | [`Input`] | sensor's side: offers events; waits only under [`Overload::Block`] |
//! | [`Live`] | controller's side: a [`TimedAnswer`] with its age by a deadline |
//! | [`Fleet`] | many sensors in one process, each with engine, queue and counters |
//! | [`Asked`] | a prediction that was asked for, for a caller that cannot only wait |
//! | [`QueueOptions`], [`Overload`] | capacity, and the rule for events when it is full |
//! | [`QueueCounters`] | counts of offered, delivered, waiting and dropped events |
//! | [`Predictor`], [`Item`] | engines that can run live, over events or frames |
//!
//! ```
//! use std::time::Duration;
//!
//! use meissner_engine::{Engine, Event, Sensor};
//! use meissner_live::{Live, Overload, QueueOptions};
//! use meissner_models::{Description, Weights};
//!
//! let description = Description::shipped("tactigraph-past").expect("a shipped network");
//! let weights = Weights::shipped("tactigraph-past").expect("its weights");
//! let engine = Engine::new(description.network(&weights)?, Sensor::new(240, 180))?;
//!
//! let options = QueueOptions::new().with_capacity(8192).with_overload(Overload::DropOldest);
//! let (mut input, mut live) = Live::spawn(engine, options)?;
//! let events: Vec<Event> = (0..100).map(|x| Event::new(0, x, 90, true)).collect();
//! let sensor = std::thread::spawn(move || input.push_slice(&events));
//! sensor.join().expect("the sensor's thread does not panic")?;
//!
//! let timely = live.predict(Duration::MAX)?; // a controller would give it a few milliseconds
//! assert_eq!((timely.nodes, timely.behind_events), (100, 0));
//! let engine = live.close()?;
//! assert_eq!(engine.nodes(), 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Determinism: the engine receives a sequence of events and clock advances, and its predictions
//! equal those without threads, bit for bit. The machine's speed decides which events are dropped.
#![forbid(unsafe_code)]

mod error;
mod fleet;
mod input;
mod intake;
#[cfg(all(test, meissner_loom))]
mod interleavings;
mod live;
mod overload;
mod shared;
mod sync;
#[cfg(all(test, not(meissner_loom)))]
mod tests;
mod worker;

pub use error::LiveError;
pub use fleet::Fleet;
pub use input::Input;
pub use intake::Item;
pub use live::{Asked, Live, TimedAnswer};
pub use meissner_engine::Predictor;
pub use overload::{Overload, QueueCounters, QueueOptions};
pub use worker::cores;
