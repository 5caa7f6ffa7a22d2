//! The promises of the image readers, on files that the tests make.
#![forbid(unsafe_code)]

mod formats;
mod hostile;
mod video;
