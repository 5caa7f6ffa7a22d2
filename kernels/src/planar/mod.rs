//! Images of few channels, one plane after the other: lanes run over neighbouring positions of a row, weights are the
//! same for all of them. For images of many channels, channels-last is the better layout.

mod conv;
mod occupancy;
mod planes;
mod pool;

pub use conv::PlanarConv3x3;
pub(crate) use conv::RowOut;
pub use occupancy::Occupancy;
pub(crate) use planes::TILE;
pub use planes::{Planes, TileRegion};
pub use pool::{planar_average_pool, planar_max_pool};
