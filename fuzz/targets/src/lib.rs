//! Fuzz targets: bytes in, a promise kept or a panic.
//!
//! Each target is a plain function, so that cargo-fuzz (`fuzz/fuzz_targets/`), the replay of the corpora
//! (`tests/replay.rs`) and the mutator (`src/bin/mutate.rs`) hold the same promises. `fuzz/README.md` says how to run them.
#![forbid(unsafe_code)]

mod archive;
mod choices;
pub mod corpus;
mod descriptions;
mod images;
mod mutation;
mod oracle;
mod readings;
mod recordings;

mod snapshots;
mod target;
mod weights;

pub use descriptions::description;
pub use images::image;
pub use mutation::Mutator;
pub use oracle::{graph, interleavings};
pub use readings::electrodes;
pub use recordings::{aedat4, any_recording, convert, csv, dat, evt2, evt3, nmnist, npy};
pub use snapshots::{frame_snapshot, seeds as snapshot_seeds, snapshot};
pub use target::{TARGETS, Target, Verdict};
pub use weights::{NETWORK, pickle, weights};
