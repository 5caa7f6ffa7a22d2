//! Results of a batch: in-edges, features, positions and members of each level.

use std::ops::Range;

use meissner_kernels::{GraphRow, Lanes, Matrix, Neighbour, add, clear_negative_zero, maximum};

/// In-edges of consecutive rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edges {
    pub(super) start: Vec<usize>,
    pub(super) list: Vec<Neighbour>,
    /// Offset of each in-edge, if a block reads offsets.
    pub(super) offsets: Vec<[f32; 3]>,
}

impl Edges {
    /// Appends a row with its in-edges.
    pub fn push(&mut self, row: impl IntoIterator<Item = Neighbour>) {
        self.start.push(self.list.len());
        self.list.extend(row);
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.start.len()
    }

    /// In-edges of `row`, in neighbourhood order.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, row: usize) -> &[Neighbour] {
        &self.list[self.span(row)]
    }

    fn span(&self, row: usize) -> Range<usize> {
        self.start[row]..self.start.get(row + 1).copied().unwrap_or(self.list.len())
    }

    /// Inputs of a block for `row`: its in-edges, its `own` input, and the `skip` input.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn read<'a>(&'a self, row: usize, own: &'a [Lanes], skip: Option<&'a [Lanes]>) -> GraphRow<'a> {
        let span = self.span(row);
        let offsets = self.offsets.get(span.clone()).unwrap_or_default();
        GraphRow { neighbours: &self.list[span], offsets, own, skip, ..GraphRow::default() }
    }
}

/// One level, computed from scratch.
#[derive(Clone, Debug)]
pub struct LevelTrace {
    /// Neighbourhood of each row.
    pub edges: Edges,
    /// The level's input, then the output of each block.
    pub features: Vec<Matrix>,
    /// Position of each row: fractions of sensor and span, time from the epoch; in f32 and from the
    /// window's first event with [`Normalisation::PerGraph`](crate::Normalisation::PerGraph).
    pub positions: Vec<[f64; 3]>,
    /// Index of each row's cell along x, y and t; empty at the event level.
    pub cells: Vec<[i64; 3]>,
    /// Rows of the level below that each row pools, ascending; empty at the event level.
    pub members: Vec<Vec<usize>>,
    /// First row that is in the window; earlier rows are needed for `frozen` in-edges.
    pub first: usize,
}

/// All activations of a batch.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The event level, then one per pooling.
    pub levels: Vec<LevelTrace>,
    /// (cells, channels).
    pub readout: Matrix,
    /// Outputs of the last dense layer.
    pub prediction: Vec<f32>,
}

/// Channel-wise sum of rows: within each part of time in order, then over the parts.
pub(super) fn sum_of(features: &Matrix, rows: &[usize], part: impl Fn(usize) -> i64, out: &mut [Lanes]) {
    out.fill(Lanes::ZERO);
    let mut sum = vec![Lanes::ZERO; out.len()];
    for rows in rows.chunk_by(|&a, &b| part(a) == part(b)) {
        sum.fill(Lanes::ZERO);
        rows.iter().for_each(|&row| add(&mut sum, features.row(row)));
        add(out, &sum);
    }
}

/// Channel-wise maximum over some rows.
pub(super) fn maximum_of(features: &Matrix, rows: &[usize], out: &mut [Lanes]) {
    out.fill(Lanes::splat(f32::NEG_INFINITY));
    rows.iter().for_each(|&row| maximum(out, features.row(row)));
    clear_negative_zero(out);
}
