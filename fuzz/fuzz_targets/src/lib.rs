//! Fuzz targets: each takes bytes, and panics if a promise is broken.
//!
//! Each is a plain function in [`TARGETS`], so that cargo-fuzz (`fuzz/fuzz_target.rs`), the replay
//! of the corpora (`tests/replay.rs`) and the mutator (`src/bin/mutate.rs`) check the same
//! promises.
mod c_interface;
pub mod corpus;
mod descriptions;
mod oracle;
mod recordings;
mod snapshots;
mod sockets;
mod weights;

use c_interface::c_interface;
use descriptions::description;
use meissner_io::Format;
use oracle::{graph, interleavings};
use recordings::{any_recording, convert, csv, electrodes, image, labels, mcap, raw, recording, video};
use snapshots::{frame_snapshot, snapshot};
use sockets::socket;
use weights::{pickle, weights};

pub use corpus::Mutator;
pub use snapshots::seeds as snapshot_seeds;
pub use weights::NETWORK;

/// The outcome of an input. A broken promise is a panic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The input gave a result that keeps its promises.
    Accepted,
    /// The input was refused with a typed error.
    Refused,
}

/// A function over bytes that panics if a promise is broken.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is also that of its corpus and of its cargo-fuzz binary.
    pub name: &'static str,
    /// The function.
    pub run: fn(&[u8]) -> Verdict,
}

/// All targets.
pub const TARGETS: [Target; 32] = [
    Target { name: "aedat4", run: |bytes| recording(Format::Aedat4, bytes) },
    Target { name: "aedat3", run: |bytes| recording(Format::Aedat3, bytes) },
    Target { name: "aedat2", run: |bytes| recording(Format::Aedat2, bytes) },
    Target { name: "evt2", run: |bytes| recording(Format::Evt2, bytes) },
    Target { name: "evt21", run: |bytes| recording(Format::Evt21, bytes) },
    Target { name: "evt3", run: |bytes| recording(Format::Evt3, bytes) },
    Target { name: "dat", run: |bytes| recording(Format::Dat, bytes) },
    Target { name: "es", run: |bytes| recording(Format::Es, bytes) },
    Target { name: "nmnist", run: |bytes| recording(Format::Nmnist, bytes) },
    Target { name: "raw", run: raw },
    Target { name: "socket", run: socket },
    Target { name: "csv", run: csv },
    Target { name: "npy", run: |bytes| recording(Format::Npy, bytes) },
    Target { name: "hdf5", run: |bytes| recording(Format::Hdf5, bytes) },
    Target { name: "mcap", run: mcap },
    Target { name: "any_recording", run: any_recording },
    Target { name: "convert", run: convert },
    Target { name: "electrodes", run: electrodes },
    Target { name: "labels", run: labels },
    Target { name: "png", run: image },
    Target { name: "jpeg", run: image },
    Target { name: "pnm", run: image },
    Target { name: "video", run: video },
    Target { name: "safetensors", run: weights },
    Target { name: "torch", run: weights },
    Target { name: "pickle", run: pickle },
    Target { name: "description", run: description },
    Target { name: "snapshot", run: snapshot },
    Target { name: "frame_snapshot", run: frame_snapshot },
    Target { name: "graph", run: graph },
    Target { name: "interleavings", run: interleavings },
    Target { name: "c_interface", run: c_interface },
];

/// Runs the target of this name on `bytes`, for cargo-fuzz.
///
/// # Panics
/// If there is no target of this name, or a promise is broken.
pub fn run(name: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target of this name");
    (target.run)(bytes);
}
