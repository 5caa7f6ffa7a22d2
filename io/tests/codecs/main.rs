//! The promises of the codecs, on bytes that the tests make themselves, and on real recordings where they are at
//! hand.
#![forbid(unsafe_code)]

mod aedat2;
mod aedat3;
mod aedat4;
mod csv;
mod dat;
mod datasets;
mod detect;
mod digits;
mod electrodes;
mod encoders;
mod es;
mod evt2;
mod evt3;
mod gelsight;
#[cfg(feature = "hdf5")]
mod hdf5;
mod hostile;
mod kinds;
mod left_out;
mod neutouch;
mod nmnist;
mod npy;
mod packed;
mod ranges;
mod recordings;
mod ros;
mod salvage;
#[path = "../../../tests/shared_files.rs"]
mod shared_files;
mod support;
mod texts;
