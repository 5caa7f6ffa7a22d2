//! Arithmetic on tensors: stateless, without events, files, threads or clocks.
//!
//! Every kernel documents its order of operations, so results have the same bits on every
//! instruction set. Lanes run over independent outputs. A product that is added is rounded once
//! with the sum (fused multiply-add, in software where needed). Elementary functions are the
//! crate's own (exp without it). [`naive`] contains scalar twins for the tests.
//!
//! | type | what it computes |
//! |---|---|
//! | [`SplineConv`] | spline convolution of in-edges ([`Neighbour`]) with ELU, batch norm, skip |
//! | [`PointNetConv`] | PointNet convolution of in-edges with ReLU, batch norm, skip |
//! | [`Dense`], [`Lstm`] | a dense layer; a step of an LSTM |
//! | [`Conv3x3`], [`WinogradConv3x3`], [`Kn2rowConv3x3`], [`PlanarConv3x3`] | of images |
//! | [`TransposedConv2x2`] | a transposed convolution of images |
//! | [`PlanarConvLstm`] | a step of a convolutional LSTM, with peepholes |
//! | [`exp`], [`tanh`], [`sigmoid`], [`elu`] | each with its [`Elementary::bound`] |
//! | [`Isa`] | the instruction set that kernels run on; no result depends on it |
//!
//! ```
//! use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, Neighbour, attribute};
//! use meissner_kernels::{SplineConv, SplineParts, SplineScratch};
//!
//! // Two channels into one; x varies fastest, so slot 1 is "to the right".
//! let mut weight = vec![0.0; 8 * 2];
//! weight[2] = 1.0;
//! let kernel = [2, 2, 2];
//! let parts = SplineParts { inputs: 2, outputs: 1, kernel, weight, ..Default::default() };
//! let conv = SplineConv::new(&parts)?;
//!
//! // A row reads row 0: 0.25 to the right, at the same height, earlier by the scale, 0.25.
//! let features = Matrix::from_rows(2, &[3.0, 7.0]);
//! let u = [0.25, 0.0, -0.25].map(|difference| attribute(difference, 0.25));
//! let row = GraphRow { neighbours: &[Neighbour { row: 0, u }], ..GraphRow::default() };
//! let mut out = [Lanes::ZERO];
//! conv.rows(Isa::best(), &features, &[row], &mut SplineScratch::default(), &mut out);
//! assert_eq!((u, out[0].0[0]), ([1.0, 0.5, 0.0], 1.5));
//! # Ok::<(), meissner_kernels::KernelError>(())
//! ```

#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

mod dense;
mod elementary;
mod error;
pub mod floats;
mod frames;
mod graph;
#[allow(
    unsafe_code,
    reason = "the one place where an instruction set beyond the build's baseline is entered"
)]
mod isa;
mod lanes;
mod matrix;
pub mod naive;
mod nearby;
mod packed;
mod planar;
mod pointnet;
pub mod random;
mod recurrent;
mod rows;
mod spline;

pub use dense::{Activation, Dense};
pub use elementary::{Elementary, elu, exp, expm1, sigmoid, softmax, tanh};
pub use error::KernelError;
pub use frames::{
    Band, Conv1x1, Conv3x3, ConvParts, ConvScratch, DirectConv, FeatureMap, Kn2rowConv3x3, Kn2rowScratch,
    PooledConv3x3, PooledScratch, Region, SqueezeExcite, SqueezeScratch, TransposedConv2x2, View,
    WinogradConv3x3, WinogradTile, average_pool, global_average, max_pool_2x2,
};
pub use graph::{GraphRow, Neighbour, attribute, offset};
pub use isa::{Divisor, Exponent, Isa, Portable, Simd, Task, Vector, fused, prefetch};
pub use lanes::{LANES, Lanes, Wide};
pub use matrix::Matrix;
pub use nearby::Nearby;
pub use planar::{Occupancy, PlanarConv3x3, Planes, TileRegion, planar_average_pool, planar_max_pool};
pub use pointnet::{PointNetConv, PointNetParts, PointNetScratch, pointnet_multiply_adds};
pub use recurrent::{
    Lstm, LstmParts, LstmState, PlanarConvLstm, PlanarConvLstmState, Squash, lstm_update, lstm_update_rows,
};
pub use rows::{
    Replaced, add, clear_negative_zero, is_nan, maximum, replace_rows, replace_rows_beyond, same_bits,
};
pub use spline::{SplineConv, SplineParts, SplineScratch, spline_basis, spline_multiply_adds};

/// Inner loops for the tests of this crate. No version promises them.
#[doc(hidden)]
pub mod inner {
    pub use crate::elementary::elus;
    pub use crate::isa::panel::{Taps, accumulate, accumulate_taps, accumulate_wide};
    pub use crate::isa::portable::fused_each;
}
