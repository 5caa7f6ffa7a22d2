//! What `prepare slip`, `eval slip` and `pareto slip` share: the data set, networks and their trainings, and the windows
//! that a network reads.
//!
//! | file | job |
//! |---|---|
//! | `data` | the recordings, and what slipped in each |
//! | `networks`, `training` | which networks, with which weights, and what those say about themselves |
//! | `windows` | windows of all recordings, and the networks' outputs for them |

mod data;
mod networks;
mod training;
mod windows;

pub(crate) use data::SlipData;
pub(crate) use networks::{Candidate, candidates};
pub(crate) use training::{HeldOut, Scheme, Training};
pub(crate) use windows::{Windows, engine};
