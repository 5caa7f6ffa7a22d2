//! Inputs of graph convolutions: in-edges, and the rows that they belong to.
//!
//! Input: coordinate differences. Output: attributes and offsets of edges in f32. A difference is
//! rounded to f32 first; nothing is rounded before.

use crate::lanes::Lanes;

/// An in-edge: the source row, and its position relative to the reader.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Neighbour {
    /// Row of the feature matrix.
    pub row: u32,
    /// Edge attribute along x, y and t, each in [0, 1]; 0.5 means no difference.
    pub u: [f32; 3],
}

/// Edge attribute of a difference `p_j - p_i`: clamp(difference / (2 scale) + 0.5, 0, 1).
#[inline]
pub fn attribute(difference: f64, scale: f32) -> f32 {
    (difference as f32 / (2.0 * scale) + 0.5).clamp(0.0, 1.0)
}

/// Offset of a coordinate difference `p_j - p_i`: difference / scale, without a limit.
#[inline]
pub fn offset(difference: f64, scale: f32) -> f32 {
    difference as f32 / scale
}

/// The inputs of one row of a graph convolution.
#[derive(Clone, Copy, Debug, Default)]
pub struct GraphRow<'a> {
    /// The in-edges, in neighbourhood order; their rows index the features.
    pub neighbours: &'a [Neighbour],
    /// [`spline_basis`](crate::spline_basis) of each in-edge, for spline convolutions that [read
    /// it](crate::SplineConv::reads_basis); if empty, it is computed.
    pub basis: &'a [Lanes],
    /// [`offset`] of each in-edge along x, y, t, which only [`crate::PointNetConv`] reads.
    pub offsets: &'a [[f32; 3]],
    /// The row's own input, C values in lanes; read only by `PointNet` and by a root weight.
    pub own: &'a [Lanes],
    /// O values in lanes that are added last, if any.
    pub skip: Option<&'a [Lanes]>,
}
