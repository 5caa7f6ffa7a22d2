//! Features of one level, and the propagation of changes through its blocks.
//!
//! Input: rows whose neighbourhood changed, rows whose input changed. Output: features equal, bit for bit, to those
//! computed from scratch, and for each feature the rows that changed. A row is recomputed as a whole or not at all. If
//! its bits stay the same, propagation stops there.
//!
//! With a tolerance, a recomputed row that is within it of the stored row in every channel keeps the stored values, and
//! propagation stops there. The row is recomputed whenever its inputs change, and always compared with the stored
//! values. Every stored row is therefore within the tolerance of the row that its stored inputs give.

use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, replace_rows, replace_rows_beyond};

use crate::convolution::{ConvolutionScratch, GraphConvolution};
use crate::counters::LayerLog;
use crate::graph::Adjacency;
use crate::memory::Memory;
use crate::network::{Block, Level};
use crate::rows::{FewRows, GrowingSet, RowSet};

#[derive(Clone, Debug)]
pub(crate) struct Activations {
    /// The level's input, then the output of each block.
    features: Vec<Matrix>,
    /// For each feature, rows that changed since `finish`.
    changed: Vec<RowSet>,
    /// Rows whose neighbourhood changed since `finish`.
    rewired: RowSet,
    /// For each feature, rows that hold NaN.
    nan: Vec<FewRows>,
    dirty: GrowingSet,
    /// Largest change of a value that does not count as a change; 0 if every bit counts.
    tolerance: f32,
    scratch: ConvolutionScratch,
    /// Computed outputs of a group of rows.
    rows: Vec<Lanes>,
}

impl Activations {
    /// Features of `rows` rows with at most `most` in-edges each; `channels` holds the channels of each feature. There are no rows before
    /// [`Self::grow`], and no memory is touched for them.
    pub(crate) fn new(
        rows: usize,
        level: &Level,
        channels: &[usize],
        most: usize,
        tolerance: f32,
        memory: &mut Memory,
    ) -> Self {
        let widest = channels.iter().map(|&c| Lanes::count(c)).max().unwrap_or(0);
        let convs = level.blocks.iter().map(|block| &block.conv);
        memory.add(size_of::<Self>() as u128);
        Self {
            features: memory.each(channels.len(), |memory, i| memory.room_for_rows(rows, channels[i])),
            changed: memory.each(channels.len(), |memory, _| RowSet::within(rows, memory)),
            rewired: RowSet::within(rows, memory),
            nan: memory.each(channels.len(), |memory, _| FewRows::new(rows, memory)),
            dirty: GrowingSet::new(rows, memory),
            tolerance,
            scratch: ConvolutionScratch::new(convs, most, memory),
            rows: memory.copies(Lanes::ZERO, widest * GraphConvolution::GROUP),
        }
    }

    /// Adds rows of zeros, up to `rows` in all.
    pub(crate) fn grow(&mut self, rows: usize) {
        self.features.iter_mut().for_each(|feature| feature.grow(rows));
    }

    /// Removes all rows; with `poison`, fills the blocks' outputs with NaN.
    pub(crate) fn clear(&mut self, poison: bool) {
        self.nan.iter_mut().for_each(FewRows::clear);
        self.finish();
        if poison {
            for feature in &mut self.features[1..] {
                (0..feature.rows()).for_each(|row| feature.row_mut(row).fill(Lanes::splat(f32::NAN)));
            }
        }
    }

    pub(crate) fn feature(&self, index: usize) -> &Matrix {
        &self.features[index]
    }

    /// The level's input and the set of its changed rows, to write.
    pub(crate) fn input_mut(&mut self) -> (&mut Matrix, &mut RowSet) {
        (&mut self.features[0], &mut self.changed[0])
    }

    /// Rows of a feature that changed since `finish`.
    pub(crate) fn changed(&self, index: usize) -> &RowSet {
        &self.changed[index]
    }

    /// Registers `row` as new: the old content of its slot is ignored, and its next computed values are stored.
    pub(crate) fn enter(&mut self, row: u32) {
        if self.tolerance > 0.0 {
            for feature in &mut self.features[1..] {
                // NaN is beyond every tolerance.
                feature.row_mut(row as usize).fill(Lanes::splat(f32::NAN));
            }
        }
    }

    /// Stored values of a row; none for a row that entered under a tolerance and has not been computed yet.
    pub(crate) fn stored(&self, feature: usize, row: u32) -> Option<&[f32]> {
        let values = self.features[feature].slice(row as usize);
        (!values.iter().all(|v| v.is_nan())).then_some(values)
    }

    /// A row of a feature, to restore its stored values.
    pub(crate) fn stored_mut(&mut self, feature: usize, row: u32) -> &mut [f32] {
        let row = row as usize;
        self.features[feature].row_mut(row).fill(Lanes::ZERO);
        self.features[feature].slice_mut(row)
    }

    /// Marks `row`: its neighbourhood changed.
    #[inline]
    pub(crate) fn rewire(&mut self, row: u32) {
        self.rewired.insert(row);
    }

    /// Removes `row`; with `poison`, fills it with NaN.
    pub(crate) fn leave(&mut self, row: u32, poison: bool) {
        self.rewired.remove(row);
        for (feature, (changed, nan)) in
            self.features.iter_mut().zip(self.changed.iter_mut().zip(&mut self.nan))
        {
            changed.remove(row);
            nan.remove(row);
            if poison {
                feature.row_mut(row as usize).fill(Lanes::splat(f32::NAN));
            }
        }
    }

    /// Recomputes the rows that the marked changes affect.
    pub(crate) fn run(&mut self, level: &Level, graph: &impl Adjacency, isa: Isa, log: &mut [LayerLog]) {
        let mut before = None;
        for ((b, block), log) in level.blocks.iter().enumerate().zip(log) {
            self.collect(block, before.replace(block), graph);
            let dirty = std::mem::take(&mut self.dirty);
            for rows in dirty.as_slice().chunks(GraphConvolution::GROUP) {
                self.compute(block, b + 1, rows, graph, isa, log);
            }
            self.dirty = dirty;
        }
    }

    /// Computes every block of `rows`, block by block. Rows that they read and that are not among them are final.
    pub(crate) fn run_rows(
        &mut self,
        level: &Level,
        rows: &[u32],
        graph: &impl Adjacency,
        isa: Isa,
        log: &mut [LayerLog],
    ) {
        for ((b, block), log) in level.blocks.iter().enumerate().zip(log) {
            for rows in rows.chunks(GraphConvolution::GROUP) {
                self.compute(block, b + 1, rows, graph, isa, log);
            }
        }
    }

    /// Collects the rows of `block` that a change reaches; `dirty` holds those of the block `before` it.
    fn collect(&mut self, block: &Block, before: Option<&Block>, graph: &impl Adjacency) {
        let Self { dirty, rewired, changed, .. } = self;
        let input = &changed[block.input];
        // Changes spread: the rows that the block before read are mostly among the rows that this block reads, and its
        // dirty rows are then dirty in this block too.
        let spread = before.filter(|before| {
            let read = changed[before.input].as_slice();
            before.skip.is_none()
                && !before.conv.reads_itself()
                && read.iter().all(|&row| input.contains(row))
        });
        if spread.is_none() {
            dirty.clear();
            dirty.insert(rewired.as_slice());
        }
        let fresh = |row: &u32| spread.is_none_or(|before| !changed[before.input].contains(*row));
        let rows = input.as_slice().iter().copied().filter(fresh);
        graph.for_readers(rows, |readers| dirty.insert(readers));
        if block.conv.reads_itself() {
            dirty.insert(input.as_slice());
        }
        if let Some(skip) = block.skip {
            dirty.insert(changed[skip].as_slice());
        }
    }

    /// Recomputes rows of feature `to`, at most one group.
    #[inline]
    fn compute(
        &mut self,
        block: &Block,
        to: usize,
        rows: &[u32],
        graph: &impl Adjacency,
        isa: Isa,
        log: &mut LayerLog,
    ) {
        let (read, written) = self.features.split_at_mut(to);
        let input = &read[block.input];
        let lanes = Lanes::count(block.conv.outputs());
        let out = &mut self.rows[..rows.len() * lanes];
        let mut group = [GraphRow::default(); GraphConvolution::GROUP];
        for (to, &row) in group.iter_mut().zip(rows) {
            *to = GraphRow {
                own: input.row(row as usize),
                skip: block.skip.map(|skip| read[skip].row(row as usize)),
                ..graph.edges(row)
            };
        }
        block.conv.rows(isa, input, &group[..rows.len()], &mut self.scratch, out);
        let replaced = if self.tolerance > 0.0 {
            replace_rows_beyond(isa, self.tolerance, out, &mut written[0], rows)
        } else {
            replace_rows(isa, out, &mut written[0], rows)
        };
        log.counters.within_tolerance += u64::from(replaced.within.count_ones());
        for (i, &row) in rows.iter().enumerate() {
            if replaced.nan >> i & 1 != 0 {
                self.nan[to].insert(row);
            } else {
                self.nan[to].remove(row);
            }
            let changed = replaced.changed >> i & 1 != 0;
            log.note(row, (replaced.changed | replaced.within) >> i & 1 == 0);
            if changed {
                self.changed[to].insert(row);
            }
        }
    }

    /// Index of the first block with rows that hold NaN, and the number of these rows.
    pub(crate) fn not_a_number(&self) -> Option<(usize, usize)> {
        let nan = self.nan.iter().enumerate().skip(1).find(|(_, nan)| nan.len() > 0);
        nan.map(|(feature, nan)| (feature - 1, nan.len()))
    }

    /// Clears the sets of changes, after everything downstream has processed them.
    pub(crate) fn finish(&mut self) {
        self.changed.iter_mut().for_each(RowSet::clear);
        self.rewired.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poison_is_left_where_rows_were_and_nowhere_else() {
        let held = |activations: &Activations| -> Vec<bool> {
            let feature = activations.feature(1);
            (0..feature.rows()).map(|row| feature.values(row).all(f32::is_nan)).collect()
        };
        let level = Level { scale: 1.0, blocks: Vec::new() };
        let mut activations = Activations::new(3, &level, &[1, 2], 1, 0.0, &mut Memory::default());
        activations.grow(3);
        activations.leave(0, false);
        activations.leave(1, true);
        assert_eq!(held(&activations), [false, true, false]);
        activations.clear(false);
        assert_eq!(held(&activations), [false, true, false]);
        activations.clear(true);
        assert_eq!(held(&activations), [true; 3]);
    }
}
