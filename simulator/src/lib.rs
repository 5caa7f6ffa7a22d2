//! Event cameras and touch, simulated with labels.
//!
//! Input: grey images with times, or the tracks of markers. Output: events in order of time, each
//! with its [`Cause`]. Equal input and an equal seed give equal events on every machine.
//!
//! [`Camera`] is the model of the sensor: it finds the exact time at which each pixel crosses its
//! threshold between two images. [`MarkerTracks`] draws moving discs. [`Press`] moves the markers
//! of a soft dome, which [`DomeView`] sees; [`PressTable`] has its presses in real time. [`gel`]
//! presses indenters into a flat gel under coloured lights. [`grasp`] has two fingers that grasp a
//! bolt, with the force over time. [`plants`] are the objects that controllers move.
//!
//! ```
//! use meissner_engine::Sensor;
//! use meissner_simulator::{Camera, CameraSettings, Cause};
//!
//! // One pixel becomes twice as bright within 10 ms: ln 2 / 0.2 is 3.47, so three events.
//! let settings = CameraSettings { initial_phase: false, ..CameraSettings::ideal() };
//! let mut camera = Camera::new(Sensor::new(1, 1), settings, 0)?;
//! let mut events = Vec::new();
//! camera.push(0, &[0.4], &mut events)?;
//! camera.push(10_000, &[0.8], &mut events)?;
//! camera.finish(&mut events);
//! assert_eq!(events.len(), 3);
//! assert!(events.iter().all(|simulated| simulated.event.on && simulated.cause == Cause::Signal));
//! # Ok::<(), meissner_simulator::SimulatorError>(())
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod camera;
mod dome;
mod error;
pub mod gel;
pub mod grasp;
mod markers;
mod membrane;
pub mod plants;

pub use camera::{Camera, CameraSettings, Cause, SimulatedEvent};
pub use dome::DomeView;
pub use dome::PressTable;
pub use error::{Result, SimulatorError};
pub use markers::{MarkerScene, MarkerTracks};
pub use membrane::{Dome, Press, Vector};
