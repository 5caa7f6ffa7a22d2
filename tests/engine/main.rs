//! Whole-engine properties, oracles, golden files: one program, as linking takes most of the time.

mod approximations;
mod book;
mod conformance;
mod determinism;
mod extremes;
mod figures;
mod filters;
mod frames;
mod golden_frames;
mod golden_networks;
mod hot_pixels;
mod house;
mod incremental;
mod inspection;
mod neighbours;
#[allow(dead_code, reason = "other tests use more of it")]
#[path = "../../models/tests/support/network_text.rs"]
mod network_text;
mod out_of_range;
mod readout;
mod recomputed_rows;
mod reference;
mod representations;
mod restarts;
mod snapshots_damaged;
mod snapshots_refused;
mod stage_times;
mod stream;
mod stress;
mod tolerance;
mod trained;
mod unlike_frames;
mod unlikeness;
