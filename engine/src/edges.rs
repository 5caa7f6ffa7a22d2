//! In-edges of the event graph, with the values that layers read.

use std::ops::Range;

use meissner_kernels::{Lanes, Neighbour, spline_basis};

use crate::convolution::EdgeReads;
use crate::memory::Memory;
use crate::metric::{Metric, Node};

/// In-edges, and edge data that every block would otherwise recompute.
#[derive(Clone, Debug)]
pub(crate) struct EdgeStore {
    pub(crate) neighbours: Vec<Neighbour>,
    pub(crate) d2: Vec<f64>,
    /// Spline basis of each in-edge, if blocks read it.
    pub(crate) basis: Vec<Lanes>,
    /// Offset of each in-edge, if blocks read it.
    pub(crate) offsets: Vec<[f32; 3]>,
}

impl EdgeStore {
    pub(crate) fn new(edges: usize, reads: EdgeReads, memory: &mut Memory) -> Self {
        Self {
            neighbours: memory.copies(Neighbour { row: 0, u: [0.5; 3] }, edges),
            d2: memory.copies(0.0, edges),
            basis: memory.copies(Lanes::ZERO, if reads.basis { edges } else { 0 }),
            offsets: memory.copies([0.0; 3], if reads.offsets { edges } else { 0 }),
        }
    }

    /// Writes edge `at`: `reader` reads the node `source` in slot `row`.
    #[inline]
    pub(crate) fn set(
        &mut self,
        at: usize,
        metric: &Metric,
        (row, source): (u32, Node),
        reader: Node,
        d2: f64,
    ) {
        let u = metric.attributes(source, reader);
        self.neighbours[at] = Neighbour { row, u };
        self.d2[at] = d2;
        if let Some(basis) = self.basis.get_mut(at) {
            *basis = spline_basis(u);
        }
        if let Some(offset) = self.offsets.get_mut(at) {
            *offset = metric.offsets(source, reader);
        }
    }

    #[inline]
    pub(crate) fn shift(&mut self, from: Range<usize>, to: usize) {
        self.neighbours.copy_within(from.clone(), to);
        self.d2.copy_within(from.clone(), to);
        if !self.basis.is_empty() {
            self.basis.copy_within(from.clone(), to);
        }
        if !self.offsets.is_empty() {
            self.offsets.copy_within(from, to);
        }
    }
}
