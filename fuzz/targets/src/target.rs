//! The targets by name.

use crate::{
    aedat4, any_recording, convert, csv, dat, description, electrodes, evt2, evt3, frame_snapshot, graph,
    image, interleavings, nmnist, npy, pickle, snapshot, weights,
};

/// What came of an input; whatever must not come of any is a panic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It gave a result that keeps its promises.
    Accepted,
    /// It was refused with a typed error.
    Refused,
}

/// A function over bytes that panics where a promise is broken.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is also that of its corpus and of its cargo-fuzz binary.
    pub name: &'static str,
    /// The function.
    pub run: fn(&[u8]) -> Verdict,
}

/// All targets.
pub const TARGETS: [Target; 21] = [
    Target { name: "aedat4", run: aedat4 },
    Target { name: "evt2", run: evt2 },
    Target { name: "evt3", run: evt3 },
    Target { name: "dat", run: dat },
    Target { name: "nmnist", run: nmnist },
    Target { name: "csv", run: csv },
    Target { name: "npy", run: npy },
    Target { name: "any_recording", run: any_recording },
    Target { name: "convert", run: convert },
    Target { name: "electrodes", run: electrodes },
    Target { name: "png", run: image },
    Target { name: "jpeg", run: image },
    Target { name: "pnm", run: image },
    Target { name: "safetensors", run: weights },
    Target { name: "torch", run: weights },
    Target { name: "pickle", run: pickle },
    Target { name: "description", run: description },
    Target { name: "snapshot", run: snapshot },
    Target { name: "frame_snapshot", run: frame_snapshot },
    Target { name: "graph", run: graph },
    Target { name: "interleavings", run: interleavings },
];
