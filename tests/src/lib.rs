//! Helpers of the whole-engine tests: numbers of cases, oracles for filters and representations, stored rows, and the files beside the project.
//! Random networks and streams, and the comparison with a batch, are in `meissner_verify`.

pub mod cases;
pub mod event_filters;
pub mod event_frames;
pub mod fixed_run;
#[path = "../../models/tests/support/network_text.rs"]
pub mod network_text;
pub mod shared;
pub mod snapshots;
pub mod within_tolerance;
