//! What `prepare digits`, `eval digits` and `pareto digits` share: the data set of digits, networks and their trainings.
//!
//! | file | job |
//! |---|---|
//! | `data` | the recordings |
//! | `networks`, `training` | which networks, with which weights, and what those say about themselves |
//! | `folds` | which recordings the folds of a cross-validation are judged on |

mod data;
mod folds;
mod networks;
mod training;

pub(crate) use data::DigitsData;
pub(crate) use folds::{Validation, validations};
pub(crate) use networks::{Asked, Candidate, candidates};
pub(crate) use training::{Training, seed_name};
