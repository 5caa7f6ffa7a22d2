//! Frames from events and from electrode readings.
//!
//! Enters: events in order of time, or readings. Leaves: dense row-major frames, each with the
//! pixels that have events or changed, so that a network can skip the rest. An event costs O(1), a
//! frame the pixels that it touched; buffers are reused. Where events leave again, sums are
//! integers, and floats are computed when read.
//!
//! An event is *late* if earlier than the newest event or the last `advance`. Late events and
//! events outside the sensor are dropped and counted, as in [`crate::Engine`]. One on the sensor
//! but outside the [`Crop`] advances time and is not part of a frame.

mod consecutive;
mod crop;
mod error;
mod frame;
mod sliding;
mod tactile;
mod time_surface;
mod voxel_grid;

pub use consecutive::{Consecutive, ConsecutiveFrames};
pub use crop::Crop;
pub use error::RepresentationError;
pub use frame::{Completed, EmptyRun, EventFrame, SignedRule};
pub use sliding::SlidingSigned;
pub use tactile::{
    ELECTRODE_COLUMNS, ELECTRODE_ROWS, ELECTRODES, Sampling, Scaling, TACTILE_CELLS, TACTILE_COLUMNS,
    TACTILE_ROWS, TactileForm, TactileLayout, TactileSequence, TactileWindow,
};
pub use time_surface::{Decay, Surface, TimeSurface};
pub use voxel_grid::{VoxelCounters, VoxelFrame, VoxelGrid, VoxelTime};
