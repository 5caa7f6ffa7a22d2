//! What the whole-engine tests share: random networks and streams, the comparison with a batch, and the files beside
//! the project.

pub mod compare;
pub mod event_filters;
pub mod event_frames;
pub mod fixed_run;
pub mod frame_networks;
pub mod networks;
pub mod shared;
pub mod snapshots;
pub mod stored;
pub mod streams;

pub use meissner_models::random;
