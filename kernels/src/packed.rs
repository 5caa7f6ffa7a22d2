//! Weights packed for kernels whose vectors run over outputs.

use crate::lanes::{LANES, Lanes, Wide};

/// Weights (I, O) by blocks of outputs: all rows of the first sixteen, then of the next, and so on; a remainder of
/// eight or fewer is a block of single lanes.
#[derive(Clone, Debug)]
pub(crate) struct Packed {
    rows: usize,
    wide: Vec<Wide>,
    last: Vec<Lanes>,
}

impl Packed {
    /// Packs `weight`, rows of `outputs` values.
    pub(crate) fn new(weight: &[f32], outputs: usize) -> Self {
        let rows = weight.len() / outputs;
        let lanes: Vec<Vec<Lanes>> = weight.chunks_exact(outputs).map(Lanes::pack).collect();
        let blocks = Lanes::count(outputs) / 2;
        let block = |b: usize| lanes.iter().map(move |row| Wide::join(row[2 * b], row[2 * b + 1]));
        let last = lanes.iter().filter_map(|row| row.get(2 * blocks)).copied();
        Self { rows, wide: (0..blocks).flat_map(block).collect(), last: last.collect() }
    }

    /// The weights in their original layout: rows of `outputs` values.
    pub(crate) fn unpacked(&self, outputs: usize) -> Vec<f32> {
        let blocks = Lanes::count(outputs) / 2;
        let value = |row: usize, o: usize| match o / (2 * LANES) {
            block if block < blocks => self.wide[block * self.rows + row].0[o % (2 * LANES)],
            _ => self.last[row].0[o % LANES],
        };
        (0..self.rows).flat_map(|row| (0..outputs).map(move |o| value(row, o))).collect()
    }

    /// All rows of the sixteen outputs from lane `lane`, which is even.
    #[inline(always)]
    pub(crate) fn wide(&self, lane: usize) -> &[Wide] {
        &self.wide[lane / 2 * self.rows..][..self.rows]
    }

    /// All rows of the outputs of a single last lane.
    #[inline(always)]
    pub(crate) fn last(&self) -> &[Lanes] {
        &self.last
    }
}
