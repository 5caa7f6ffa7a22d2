//! Kernels over frames: convolutions and poolings of maps (height, width, channels), channels last.
//!
//! Each kernel computes the outputs of a [`Region`], with the same bits in every region: the order
//! of a sum depends neither on the output's position nor on other outputs.

mod conv;
mod feature_map;
mod kn2row;
mod layer;
mod pool;
pub(crate) mod shape;
mod weights;
mod winograd;

pub use conv::{Conv1x1, Conv3x3, DirectConv, PooledConv3x3, PooledScratch, TransposedConv2x2};
pub use feature_map::{Band, FeatureMap, View};
pub use kn2row::{Kn2rowConv3x3, Kn2rowScratch};
pub use pool::{SqueezeExcite, SqueezeScratch, average_pool, global_average, max_pool_2x2};
pub use shape::Region;
pub use weights::ConvParts;
pub use winograd::{ConvScratch, WinogradConv3x3, WinogradTile};

/// An empty vector with room for `bytes` of values.
fn room<T>(bytes: u128) -> Vec<T> {
    Vec::with_capacity(bytes as usize / size_of::<T>())
}
