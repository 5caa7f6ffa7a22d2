//! Files as other programs write them, made for the tests: no code is shared with the readers of
//! `meissner-io`.
//!
//! A package of its own, so that tests are not optimised as the readers are: they compile several
//! times faster.
#![allow(clippy::missing_panics_doc, reason = "a file that cannot be made is a failed test")]

pub mod codecs;
pub mod images;
