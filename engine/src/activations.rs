//! Features of one level, and the propagation of changes through its blocks.
//!
//! Keeps features with the bits of full recomputation, and the rows that changed. A row is
//! recomputed as a whole; if its bits stay equal, propagation stops there.
//!
//! With a tolerance, a recomputed row within it of the stored row in every channel keeps the stored
//! values. It is recomputed whenever its inputs change, so every stored row is within the tolerance
//! of what its stored inputs give.

use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, prefetch, replace_rows, replace_rows_beyond};

use crate::convolution::{ConvolutionScratch, GraphConvolution};
use crate::counters::LayerLog;
use crate::graph::Adjacency;
use crate::memory::Memory;
use crate::network::{Block, Level};
use crate::options::Options;
use crate::rows::{FewRows, GrowingSet, RowSet};

/// Multiply-adds of a level's first block from which two threads share its blocks. Waking a thread
/// takes tens of microseconds; it stays awake from one block to the next.
const LARGE: usize = 1_600_000;
/// Part of these multiply-adds from which two threads share one block.
const PART: usize = 8;
/// Bytes of a feature from which most of its rows are in no cache near the processor.
const FAR: usize = 1 << 17;
/// Rows of a block that a thread computes before they are compared with the stored ones.
const SHARE: usize = 32 * GraphConvolution::GROUP;

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
    /// Largest difference of a value that does not count as a change; 0 if every bit counts.
    tolerance: f32,
    /// Largest number of in-edges of a row.
    most: usize,
    /// [`LARGE`], or 0 if everything is shared.
    large: usize,
    /// Whether threads share the blocks that are being computed.
    shared: bool,
    threads: Vec<Thread>,
}

/// Working space of a thread.
#[derive(Clone, Debug)]
struct Thread {
    scratch: ConvolutionScratch,
    /// Computed outputs.
    rows: Vec<Lanes>,
}

impl Thread {
    /// Computes `rows` of a block, one after the other, from the features that it may `read`.
    #[inline]
    fn compute(&mut self, read: &[Matrix], block: &Block, rows: &[u32], graph: &impl Adjacency, isa: Isa) {
        let input = &read[block.input];
        let lanes = Lanes::count(block.conv.outputs());
        let groups = rows.chunks(GraphConvolution::GROUP);
        for (rows, out) in groups.zip(self.rows.chunks_mut(GraphConvolution::GROUP * lanes)) {
            let mut group = [GraphRow::default(); GraphConvolution::GROUP];
            for (to, &row) in group.iter_mut().zip(rows) {
                *to = GraphRow {
                    own: input.row(row as usize),
                    skip: block.skip.map(|skip| read[skip].row(row as usize)),
                    ..graph.edges(row)
                };
            }
            let out = &mut out[..rows.len() * lanes];
            block.conv.rows(isa, input, &group[..rows.len()], &mut self.scratch, out);
        }
    }
}

impl Activations {
    /// Features of `rows` rows with at most `most` in-edges; `channels` has the channels of each.
    /// There are no rows before [`Self::grow`], and no memory is touched for them.
    pub(crate) fn new(
        rows: usize,
        level: &Level,
        channels: &[usize],
        most: usize,
        tolerance: f32,
        options: &Options,
        memory: &mut Memory,
    ) -> Self {
        let (threads, together) = if options.two_threads { (2, SHARE) } else { (1, GraphConvolution::GROUP) };
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
            most,
            large: if options.hooks.share_all { 0 } else { LARGE },
            shared: false,
            threads: memory.each(threads, |memory, _| Thread {
                scratch: ConvolutionScratch::new(convs.clone(), most, memory),
                rows: memory.copies(Lanes::ZERO, widest * together),
            }),
        }
    }

    /// Adds rows of zeros, up to `rows` rows in total.
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

    /// Asks for the values of `row` in every feature.
    pub(crate) fn prefetch_row(&self, row: u32) {
        self.features.iter().for_each(|feature| feature.prefetch(row as usize));
    }

    /// Registers `row` as new: the old content of its slot is ignored, and its next values are
    /// stored.
    pub(crate) fn enter(&mut self, row: u32) {
        if self.tolerance > 0.0 {
            for feature in &mut self.features[1..] {
                // NaN is beyond every tolerance.
                feature.row_mut(row as usize).fill(Lanes::splat(f32::NAN));
            }
        }
    }

    /// Stored values of a row; `None` if it entered under a tolerance and is not computed yet.
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
    pub(crate) fn run(
        &mut self,
        level: &Level,
        graph: &(impl Adjacency + Sync),
        isa: Isa,
        log: &mut [LayerLog],
    ) {
        let mut before = None;
        for ((b, block), log) in level.blocks.iter().enumerate().zip(log) {
            self.collect(block, before.replace(block), graph);
            let dirty = std::mem::take(&mut self.dirty);
            if b == 0 {
                let of_row =
                    level.blocks.iter().map(|block| block.conv.multiply_adds(self.most)).sum::<usize>();
                self.shared = dirty.as_slice().len() * of_row >= self.large;
            }
            self.compute(block, b + 1, dirty.as_slice(), graph, isa, log);
            self.dirty = dirty;
        }
    }

    /// Computes every block of `rows`. Other rows that they read are final.
    pub(crate) fn run_rows(
        &mut self,
        level: &Level,
        rows: &[u32],
        graph: &(impl Adjacency + Sync),
        isa: Isa,
        log: &mut [LayerLog],
    ) {
        self.shared = false;
        for ((b, block), log) in level.blocks.iter().enumerate().zip(log) {
            self.compute(block, b + 1, rows, graph, isa, log);
        }
    }

    /// Collects the rows of `block` that a change reaches; `dirty` has those of block `before`.
    fn collect(&mut self, block: &Block, before: Option<&Block>, graph: &impl Adjacency) {
        let Self { dirty, rewired, changed, .. } = self;
        let input = &changed[block.input];
        // Changes spread: both blocks read mostly the same rows, so rows that are dirty in the
        // block before are dirty here.
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

    /// Recomputes rows of feature `to`; two threads share them if they share a level with many.
    #[inline]
    fn compute(
        &mut self,
        block: &Block,
        to: usize,
        rows: &[u32],
        graph: &(impl Adjacency + Sync),
        isa: Isa,
        log: &mut LayerLog,
    ) {
        let mut threads = std::mem::take(&mut self.threads);
        match &mut threads[..] {
            [first, second]
                if self.shared && rows.len() * block.conv.multiply_adds(self.most) >= self.large / PART =>
            {
                for rows in rows.chunks(2 * SHARE) {
                    let (upper, lower) = rows.split_at(rows.len() / 2);
                    let read = &self.features[..to];
                    rayon::join(
                        || first.compute(read, block, upper, graph, isa),
                        || second.compute(read, block, lower, graph, isa),
                    );
                    self.store(to, upper, &first.rows, isa, log);
                    self.store(to, lower, &second.rows, isa, log);
                }
            }
            [only, ..] => {
                let far = size_of_val(self.features[block.input].lanes()) >= FAR;
                let mut after = rows;
                for rows in rows.chunks(GraphConvolution::GROUP) {
                    after = &after[rows.len()..];
                    if far {
                        self.prefetch(block, to, after, graph);
                    }
                    only.compute(&self.features[..to], block, rows, graph, isa);
                    self.store(to, rows, &only.rows, isa, log);
                }
            }
            [] => unreachable!("there is a thread"),
        }
        self.threads = threads;
    }

    /// Prepares the next groups of `rows`. They are in no order of memory, and to wait for values
    /// from a distant cache takes longer than to compute a row.
    #[inline]
    fn prefetch(&self, block: &Block, to: usize, rows: &[u32], graph: &impl Adjacency) {
        let input = &self.features[block.input];
        let mut groups = rows.chunks(GraphConvolution::GROUP);
        for &row in groups.next().unwrap_or_default() {
            for source in graph.edges(row).neighbours {
                input.prefetch(source.row as usize);
            }
            self.features[to].prefetch(row as usize);
        }
        for &row in groups.next().unwrap_or_default() {
            let GraphRow { neighbours, basis, .. } = graph.edges(row);
            prefetch(neighbours);
            prefetch(basis);
        }
    }

    /// Replaces stored rows of feature `to` by the `computed` ones where they differ.
    #[inline]
    fn store(&mut self, to: usize, rows: &[u32], computed: &[Lanes], isa: Isa, log: &mut LayerLog) {
        let written = &mut self.features[to];
        let lanes = Lanes::count(written.columns());
        let groups = rows.chunks(GraphConvolution::GROUP);
        for (rows, computed) in groups.zip(computed.chunks(GraphConvolution::GROUP * lanes)) {
            let computed = &computed[..rows.len() * lanes];
            let replaced = if self.tolerance > 0.0 {
                replace_rows_beyond(isa, self.tolerance, computed, written, rows)
            } else {
                replace_rows(isa, computed, written, rows)
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
