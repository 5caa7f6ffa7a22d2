//! The promises of the image readers, on files that the tests make.
#![forbid(unsafe_code)]

mod bombs;
mod hostile;
mod jpeg;
mod png;
mod pnm;
mod sequence;
mod support;
