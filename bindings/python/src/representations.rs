//! Frames, voxel grids and time surfaces of events, as arrays.

mod consecutive;
mod event_frame;
mod of_network;
mod shared;
mod sliding;
mod time_surface;
mod voxel_grid;

pub(crate) use consecutive::EventFrames;
pub(crate) use event_frame::EventFrame;
pub(crate) use of_network::frames_for;
pub(crate) use sliding::SlidingFrame;
pub(crate) use time_surface::TimeSurface;
pub(crate) use voxel_grid::VoxelGrid;
