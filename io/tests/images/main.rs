//! What the images promise, on files that the tests make themselves.
#![forbid(unsafe_code)]

mod bombs;
mod hostile;
mod jpeg;
mod png;
mod pnm;
mod sequence;
mod support;
