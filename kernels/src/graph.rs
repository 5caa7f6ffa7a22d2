//! What graph convolutions read: in-edges, and the rows that they lead to.
//!
//! Enters: coordinate differences. Leaves: attributes and offsets of edges, in f32. A difference is rounded to f32 first, and
//! nowhere before.

use crate::lanes::Lanes;

/// An in-edge: the row that is read, and where it lies relative to the reader.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Neighbour {
    /// Row of the feature matrix.
    pub row: u32,
    /// Edge attribute along x, y and t, each in [0, 1]; 0.5 is no difference.
    pub u: [f32; 3],
}

/// Edge attribute of a coordinate difference `p_j - p_i`: clamp(difference / (2 scale) + 0.5, 0, 1).
#[inline]
pub fn attribute(difference: f64, scale: f32) -> f32 {
    (difference as f32 / (2.0 * scale) + 0.5).clamp(0.0, 1.0)
}

/// Offset of a coordinate difference `p_j - p_i`: difference / scale, as large as it is.
#[inline]
pub fn offset(difference: f64, scale: f32) -> f32 {
    difference as f32 / scale
}

/// What one row of a graph convolution reads.
#[derive(Clone, Copy, Debug, Default)]
pub struct GraphRow<'a> {
    /// The in-edges, in neighbourhood order; their rows index the features.
    pub neighbours: &'a [Neighbour],
    /// [`spline_basis`](crate::spline_basis) of each in-edge, for spline convolutions that
    /// [read it](crate::SplineConv::reads_basis); computed where it is empty.
    pub basis: &'a [Lanes],
    /// [`offset`] of each in-edge along x, y and t; read by [`PointNetConv`](crate::PointNetConv) only.
    pub offsets: &'a [[f32; 3]],
    /// The row itself, C values in lanes; read by `PointNet` and by a root weight only.
    pub own: &'a [Lanes],
    /// O values in lanes that are added last.
    pub skip: Option<&'a [Lanes]>,
}
