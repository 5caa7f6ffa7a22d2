//! Contact area and normal force from the images of an optical tactile sensor (`CANFnet`).
//!
//! The network maps an RGB image (3, 240, 320) to the normal force on each pixel's surface. Around it stand
//!
//! - [`ImageNormalisation`] before it and [`ForceNormalisation`] behind it,
//! - [`ContactMeter`]: the map of forces to a [`ContactReport`] (mask, area, total force, its running median, centroid),
//! - [`DifferenceBaseline`]: area and centroid without a network, from the difference to an image without contact,
//! - [`iou`] and [`force_mae`]: the figures that such maps are judged by,
//! - [`Overlay`]: forces, outline and centroid drawn over the image.
//!
//! Images are row-major from the top left with red, green and blue of a pixel side by side (`u8`); maps have one value
//! a pixel in the same order. Pixel coordinates are (column, row) with the centre of the top-left pixel at (0, 0).
//! Everything sums in a fixed order, so results are equal on every machine. After construction nothing allocates.

mod colour_map;
mod difference;
mod error;
mod geometry;
mod median;
mod metrics;
mod normalisation;
mod overlay;
mod report;

pub use colour_map::ColourMap;
pub use difference::{DifferenceBaseline, DifferenceReport, DifferenceSettings};
pub use error::ContactError;
pub use geometry::{Centroid, ImageSize, PixelSize};
pub use median::RunningMedian;
pub use metrics::{force_mae, iou};
pub use normalisation::{ForceNormalisation, ImageNormalisation};
pub use overlay::{Overlay, Picture};
pub use report::{ContactMeter, ContactReport, ContactSettings};
