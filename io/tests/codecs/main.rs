//! The promises of the codecs, on bytes that the tests make themselves, and on real recordings if
//! they are available.
#![forbid(unsafe_code)]

mod aedat;
mod aedat4;
mod braille;
mod csv;
mod datasets;
mod electrodes;
mod formats;
#[cfg(feature = "hdf5")]
mod hdf5;
mod hostile;
mod labels;
mod left_out;
mod mcap;
mod neutouch;
mod npy;
mod packed;
mod packets;
mod prophesee;
mod ranges;
mod raw;
mod recordings;
#[path = "../../../tests/shared_files.rs"]
mod shared_files;
mod texts;
