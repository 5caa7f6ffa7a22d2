//! Helpers of the whole-engine tests: numbers of cases, oracles for filters and representations, stored rows, and the files beside the project.
//! Random networks and streams, and the comparison with a batch, are in `meissner_verify`.

pub mod cases;
pub mod event_filters;
pub mod event_frames;
pub mod fixed_run;
pub mod shared;
pub mod snapshots;
pub mod within_tolerance;
