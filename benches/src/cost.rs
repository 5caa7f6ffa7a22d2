//! Operations and bytes of a row, from shapes alone.
//!
//! The multiply-adds of the equations are counted, two operations each: sums per kernel slot,
//! weights, root weight. Work that a faster kernel might avoid (basis, ELU, norm, padding) is not
//! counted.
//!
//! Bytes are those of a row alone: data that the previous row left in a register counts again.

use meissner_engine::{GraphConvolution, Network, Trace};
use meissner_kernels::{LANES, Lanes, Neighbour, SplineConv};

/// The cost of a computation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Number of products that are added to a sum.
    pub multiply_adds: usize,
    /// Bytes read and written.
    pub bytes: usize,
}

impl Cost {
    /// Floating-point operations.
    pub fn flops(self) -> usize {
        2 * self.multiply_adds
    }

    /// Operations per byte.
    pub fn intensity(self) -> f64 {
        self.flops() as f64 / self.bytes as f64
    }

    /// GFLOP/s of a computation that took `ns` nanoseconds.
    pub fn gflops(self, ns: f64) -> f64 {
        self.flops() as f64 / ns
    }
}

impl std::iter::Sum for Cost {
    fn sum<I: Iterator<Item = Self>>(costs: I) -> Self {
        costs.fold(Self::default(), |sum, cost| Self {
            multiply_adds: sum.multiply_adds + cost.multiply_adds,
            bytes: sum.bytes + cost.bytes,
        })
    }
}

/// Bytes of `values` f32, padded to whole lanes.
pub(crate) fn row_bytes(values: usize) -> usize {
    Lanes::count(values) * LANES * size_of::<f32>()
}

/// A row of a spline block with `degree` in-edges: edges, rows, weights, sums, root, skip, result.
pub fn spline_row(conv: &SplineConv, degree: usize, skip: bool) -> Cost {
    let corners: usize = conv.kernel().iter().map(|&k| k.min(2)).product();
    let touched = conv.slots().min(degree * corners);
    let (read, written) = (row_bytes(conv.inputs()), row_bytes(conv.outputs()));
    let edges = degree * (size_of::<Neighbour>() + read);
    let weights = (touched + usize::from(conv.has_root())) * conv.inputs() * written;
    let root = if conv.has_root() { read } else { 0 };
    // Bias, scale and shift are read with the weights.
    let rest = 3 * written + if skip { written } else { 0 } + written;
    Cost {
        multiply_adds: conv.multiply_adds(degree),
        bytes: edges + weights + root + 2 * touched * read + rest,
    }
}

/// A row of any block with `degree` in-edges, as [`spline_row`] for splines.
pub fn row(conv: &GraphConvolution, degree: usize, skip: bool) -> Cost {
    if let Some(conv) = conv.spline() {
        return spline_row(conv, degree, skip);
    }
    let (read, written) = (row_bytes(conv.inputs()), row_bytes(conv.outputs()));
    let edges = degree * (size_of::<Neighbour>() + size_of::<[f32; 3]>() + read) + read;
    let weights = conv.multiply_adds(0) / conv.outputs() * written;
    let rest = 4 * written + if skip { written } else { 0 };
    Cost { multiply_adds: conv.multiply_adds(degree), bytes: edges + weights + rest }
}

/// A dense layer of `segments` x `channels` inputs.
pub fn dense(segments: usize, channels: usize, outputs: usize) -> Cost {
    let input = segments * row_bytes(channels);
    let bytes = input + outputs * (input + size_of::<f32>()) + row_bytes(outputs);
    Cost { multiply_adds: segments * channels * outputs, bytes }
}

/// Every row of a block and dense layer of a forward pass, without search and maxima.
pub fn forward(network: &Network, trace: &Trace) -> Cost {
    let levels = trace.levels.iter().enumerate();
    let blocks = levels.map(|(l, level)| -> Cost {
        let rows = |conv, skip| -> Cost {
            (0..level.edges.rows()).map(|i| row(conv, level.edges.row(i).len(), skip)).sum()
        };
        network.level(l).blocks.iter().map(|block| rows(&block.conv, block.skip.is_some())).sum()
    });
    let mut inputs = (trace.readout.rows(), trace.readout.columns());
    let layers = network.parts().dense.iter().map(|layer| {
        let (segments, channels) = std::mem::replace(&mut inputs, (1, layer.dense.outputs()));
        dense(segments, channels, layer.dense.outputs())
    });
    blocks.chain(layers).sum()
}
