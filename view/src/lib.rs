//! Lets people watch an engine: a [`Session`] runs a network over events as the page in the folder
//! `page` asks, and gives it binary frames with the engine's state and the computed rows.
//!
//! ```text
//! commands as JSON -> Session (events, engine, cursor) -> frames -> page
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`frame`] | the bytes of a frame |
//! | [`session`] | a network over items with a cursor in time: play, step, seek, compare |
//! | [`subject`] | an engine that a session runs, and its items |
//! | [`events`], [`scene`] | an engine over events, and its data in a frame |
//! | [`frames`] | an engine over pictures, readings of electrodes or frames of events |
//! | [`command`] | the commands of a page |
//! | [`facts`] | the JSON in frames |
//! | [`networks`] | networks by name |
//! | [`truth`] | the truth at a time |
//! | `server` | with the feature `server`: the page on the loopback address |
//! | `watch`, `bystander` | also with it: a session in a thread; an engine that others run |
//! | `sensors` | also with it: several sensors side by side, whose engines others run |
//! | [`series`], [`latency`] | predictions over time; durations of the newest events |
//!
//! A session knows no file, thread, socket or clock: events and the clock are arguments. It runs
//! wherever the engine runs, also in a browser.
//!
//! ```
//! use meissner_engine::{Event, Sensor};
//! use meissner_view::{Input, Session, Shipped};
//!
//! let events = (0..100).map(|i| Event::new(500 * i, 40 + i as u16, 30, true)).collect();
//! let input = Input { sensor: Sensor::new(346, 260), events, ..Input::default() };
//! let mut session: Session = Session::new(input, Box::new(Shipped), "tactigraph-past", || 0.0)?;
//! session.command(r#"{"do": "seek_event", "event": 60}"#)?;
//! let frame = session.step(1e6).expect("the cursor has moved");
//! assert_eq!(&frame[..4], b"MSN1");
//! # Ok::<(), meissner_view::ViewError>(())
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "server")]
pub mod bystander;
pub mod clock;
pub mod command;
mod error;
pub mod events;
pub mod facts;
pub mod frame;
pub mod frames;
pub mod latency;
pub mod networks;
#[cfg(feature = "server")]
mod pace;
pub mod scene;
#[cfg(feature = "server")]
pub mod sensors;
pub mod series;
#[cfg(feature = "server")]
pub mod server;
pub mod session;
pub mod subject;
pub mod truth;
#[cfg(feature = "server")]
pub mod watch;

pub use error::ViewError;
pub use networks::{Chosen, Networks, Own, Shipped};
pub use session::{Input, Session};
pub use truth::Truth;

#[cfg(test)]
mod tests;
