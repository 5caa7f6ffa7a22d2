//! Files like those of other programs, made for the tests: they share no code with the readers of
//! `meissner-io`.
//!
//! A separate package, so that tests are not optimised like the readers: they compile several times
//! faster.
#![allow(clippy::missing_panics_doc, reason = "a file that cannot be made is a failed test")]

pub mod codecs;
pub mod images;
