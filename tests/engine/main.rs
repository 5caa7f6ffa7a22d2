//! Whole-engine properties, oracles, golden files, determinism: one program, because linking one per file took most of the time.

mod approximations;
mod conformance;
mod determinism;
mod errors;
mod extremes;
mod filters;
mod fingerprints;
mod frames;
mod golden_frames;
mod golden_networks;
mod golden_operators;
mod house;
mod incremental;
mod neighbours;
#[allow(dead_code, reason = "other tests use more of it")]
#[path = "../../models/tests/support/network_text.rs"]
mod network_text;
mod out_of_range;
mod promises;
mod readout_by_time;
mod readout_sums;
mod recomputed_rows;
mod recordings;
mod reference;
mod reference_golden;
mod representations;
mod restarts;
mod snapshots_damaged;
mod snapshots_of_frames;
mod snapshots_refused;
mod stage_times;
mod stream;
mod stress;
mod tactile;
mod tolerance;
mod trained_angles;
mod trained_digits;
mod trained_force;
mod trained_slip;
mod trained_touch;
