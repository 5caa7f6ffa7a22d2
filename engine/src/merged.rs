//! Merged edges: the in-edges of each row in one store, and the readers of each row.
//!
//! A row's in-edges are contiguous, with some free space after them. A row that has used it up
//! moves to the end of the store; at the end, rows are compacted. There is room for the maximum
//! number of edges plus one row, so a row can always move.
//!
//! A row is *altered* from a change of one of its edges until its attributes are updated.

use std::ops::Range;

use meissner_kernels::{GraphRow, Lanes, Neighbour, attribute, offset, spline_basis};

use crate::convolution::EdgeReads;
use crate::memory::Memory;
use crate::readers::Readers;

const NONE: u32 = u32::MAX;
/// Maximum number of in-edges of a row whose basis is stored; a block computes the basis of longer
/// rows.
const BASES: usize = 24;

/// Maximum sizes of merged edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Extent {
    pub(crate) rows: usize,
    /// Maximum number of in-edges of a row.
    pub(crate) most: usize,
    /// Maximum number of edges in total.
    pub(crate) edges: usize,
}

impl Extent {
    /// Sizes for `rows` rows, at most `alive` with edges, which merge at most `below` edges.
    pub(crate) fn new(rows: usize, alive: usize, below: usize) -> Self {
        let most = alive.saturating_sub(1).min(below);
        Self { rows, most, edges: below.min(alive.saturating_mul(alive.saturating_sub(1))) }
    }

    fn stored(self) -> usize {
        self.edges.saturating_add(self.most)
    }

    fn bases(self) -> usize {
        self.most.min(BASES)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Run {
    start: usize,
    len: u32,
    /// Number of edges that fit before the row must move; 0 if the store does not contain the row.
    room: u32,
    /// Links between the rows in the store, in its order.
    before: u32,
    after: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct Merged {
    extent: Extent,
    runs: Vec<Run>,
    /// First and last row in the store, and the start of the free space.
    first: u32,
    last: u32,
    end: usize,
    len: usize,
    neighbours: Vec<Neighbour>,
    /// Number of edges of the level below that each edge merges.
    counts: Vec<u32>,
    /// Offset of each edge, if blocks read it.
    offsets: Vec<[f32; 3]>,
    /// Basis of each edge of rows that are not too long, if blocks read it.
    basis: Vec<Lanes>,
    altered: Vec<bool>,
    readers: ReadBy,
}

impl Merged {
    pub(crate) fn new(extent: Extent, reads: EdgeReads, memory: &mut Memory) -> Self {
        let (rows, stored) = (extent.rows, extent.stored());
        Self {
            runs: memory.copies(Run::default(), rows),
            first: NONE,
            last: NONE,
            end: 0,
            len: 0,
            neighbours: memory.copies(Neighbour { row: 0, u: [0.0; 3] }, stored),
            counts: memory.copies(0, stored),
            offsets: memory.copies([0.0; 3], if reads.offsets { stored } else { 0 }),
            basis: memory.copies(Lanes::ZERO, if reads.basis { rows * extent.bases() } else { 0 }),
            altered: memory.copies(false, rows),
            readers: ReadBy::new(extent, memory),
            extent,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.runs.fill(Run::default());
        (self.first, self.last, self.end, self.len) = (NONE, NONE, 0, 0);
        self.altered.fill(false);
        self.readers.clear(self.extent);
    }

    pub(crate) fn has_room(&self, more: usize) -> bool {
        self.len + more <= self.extent.edges
    }

    #[inline]
    fn span(&self, row: u32) -> Range<usize> {
        let Run { start, len, .. } = self.runs[row as usize];
        start..start + len as usize
    }

    /// In-edges of a row; attributes are those of its last [`Self::update_attributes`].
    #[inline]
    pub(crate) fn neighbours(&self, row: u32) -> &[Neighbour] {
        &self.neighbours[self.span(row)]
    }

    /// In-edges of a row with their stored data; without a basis if the row is too long.
    #[inline]
    pub(crate) fn edges(&self, row: u32) -> GraphRow<'_> {
        let (span, bases) = (self.span(row), self.extent.bases());
        let start = row as usize * bases;
        let basis = if span.len() <= bases { self.basis.get(start..start + span.len()) } else { None };
        GraphRow {
            neighbours: &self.neighbours[span.clone()],
            basis: basis.unwrap_or_default(),
            offsets: self.offsets.get(span).unwrap_or_default(),
            ..GraphRow::default()
        }
    }

    fn shift(&mut self, from: Range<usize>, to: usize) {
        self.neighbours.copy_within(from.clone(), to);
        self.counts.copy_within(from.clone(), to);
        if !self.offsets.is_empty() {
            self.offsets.copy_within(from, to);
        }
    }

    /// Calls `visit` with batches, in any order, of the rows that have an in-edge from one of
    /// `rows`; a row may come once per in-edge.
    #[inline]
    pub(crate) fn for_readers(&self, rows: impl Iterator<Item = u32>, visit: impl FnMut(&[u32])) {
        self.readers.for_blocks(rows, visit);
    }

    /// Counts one more edge of the level below for in-edge `at` of `row`.
    pub(crate) fn count_up(&mut self, row: u32, at: usize) {
        self.counts[self.runs[row as usize].start + at] += 1;
    }

    /// Counts one edge of the level below less. The last one removes the in-edge; returns whether
    /// it does.
    pub(crate) fn count_down(&mut self, row: u32, at: usize) -> bool {
        let span = self.span(row);
        let count = &mut self.counts[span.start + at];
        *count -= 1;
        let gone = *count == 0;
        if gone {
            let source = self.neighbours[span.start + at].row;
            self.shift(span.start + at + 1..span.end, span.start + at);
            self.runs[row as usize].len -= 1;
            self.len -= 1;
            self.altered[row as usize] = true;
            self.readers.remove(source, row);
        }
        gone
    }

    /// Inserts an in-edge of `row` from `source` at index `at`, for one edge of the level below.
    /// Panics if there are more edges than the store is made for.
    pub(crate) fn insert(&mut self, row: u32, at: usize, source: u32) {
        assert!(self.has_room(1), "merged edges are at most as many as the edges that they merge");
        let Run { len, room, .. } = self.runs[row as usize];
        if len == room {
            self.enlarge(row);
        }
        let span = self.span(row);
        self.shift(span.start + at..span.end, span.start + at + 1);
        self.neighbours[span.start + at] = Neighbour { row: source, u: [0.0; 3] };
        self.counts[span.start + at] = 1;
        self.runs[row as usize].len += 1;
        self.len += 1;
        self.altered[row as usize] = true;
        self.readers.push(source, row);
    }

    /// Makes free space for a row that has none.
    fn enlarge(&mut self, row: u32) {
        let len = self.runs[row as usize].len as usize;
        let wanted = len + 1 + (len / 2).max(3);
        let needed =
            if self.last == row { self.runs[row as usize].start + len + 1 } else { self.end + wanted };
        if needed > self.neighbours.len() {
            self.close_up();
        }
        if self.last == row {
            let start = self.runs[row as usize].start;
            self.end = (start + wanted).min(self.neighbours.len());
        } else {
            let to = self.end;
            self.shift(self.span(row), to);
            self.unlink(row);
            let run = &mut self.runs[row as usize];
            (run.start, run.before, run.after) = (to, self.last, NONE);
            match self.last {
                NONE => self.first = row,
                last => self.runs[last as usize].after = row,
            }
            self.last = row;
            self.end = (to + wanted).min(self.neighbours.len());
        }
        self.runs[row as usize].room = (self.end - self.runs[row as usize].start) as u32;
    }

    fn unlink(&mut self, row: u32) {
        let Run { room, before, after, .. } = self.runs[row as usize];
        if room == 0 {
            return;
        }
        match before {
            NONE => self.first = after,
            before => self.runs[before as usize].after = after,
        }
        match after {
            NONE => self.last = before,
            after => self.runs[after as usize].before = before,
        }
        self.runs[row as usize].room = 0;
    }

    /// Compacts all rows at the store's front, without free space between them. Rows without edges
    /// leave the store.
    fn close_up(&mut self) {
        let (mut row, mut to) = (self.first, 0);
        while row != NONE {
            let Run { start, len, after, .. } = self.runs[row as usize];
            if len == 0 {
                self.unlink(row);
            } else {
                self.shift(start..start + len as usize, to);
                let run = &mut self.runs[row as usize];
                (run.start, run.room) = (to, len);
                to += len as usize;
            }
            row = after;
        }
        self.end = to;
    }

    /// Sets attributes and offsets of the in-edges of `row` from the sources that `moved`, or from
    /// all sources if it was altered; `difference` gives the difference to a source. Returns
    /// whether it was altered or a value that blocks read differs.
    pub(crate) fn update_attributes(
        &mut self,
        row: u32,
        scale: f32,
        moved: impl Fn(u32) -> bool,
        difference: impl Fn(u32) -> [f64; 3],
    ) -> bool {
        let altered = std::mem::take(&mut self.altered[row as usize]);
        let mut changed = altered;
        let span = self.span(row);
        let first = row as usize * self.extent.bases();
        let basis = if span.len() <= self.extent.bases() { self.basis.get_mut(first..) } else { None };
        let basis = basis.unwrap_or_default();
        let offsets = self.offsets.get_mut(span.clone()).unwrap_or_default();
        for (i, neighbour) in self.neighbours[span].iter_mut().enumerate() {
            if !altered && !moved(neighbour.row) {
                continue;
            }
            let difference = difference(neighbour.row);
            if let Some(stored) = offsets.get_mut(i) {
                let offsets = difference.map(|d| offset(d, scale));
                changed |= *stored != offsets;
                *stored = offsets;
            }
            let u = difference.map(|d| attribute(d, scale));
            if altered || neighbour.u != u {
                neighbour.u = u;
                changed = true;
                if let Some(basis) = basis.get_mut(i) {
                    *basis = spline_basis(u);
                }
            }
        }
        changed
    }
}

/// Readers of each row: bits if there are few rows and bits need less memory, otherwise lists.
#[derive(Clone, Debug)]
enum ReadBy {
    Bits(Bits),
    Lists(Box<Readers>),
}

impl ReadBy {
    fn new(Extent { rows, edges, .. }: Extent, memory: &mut Memory) -> Self {
        let words = rows.div_ceil(WORD);
        let [bits, lists] = [
            Memory::needed(|memory| Bits::new(rows, words, memory)),
            Memory::needed(|memory| Readers::new(rows, edges, memory)),
        ];
        if words <= WORD && bits <= lists {
            return Self::Bits(Bits::new(rows, words, memory));
        }
        memory.add(size_of::<Readers>() as u128);
        Self::Lists(Box::new(Readers::new(rows, edges, memory)))
    }

    fn clear(&mut self, extent: Extent) {
        match self {
            Self::Bits(bits) => bits.clear(),
            Self::Lists(lists) => (0..extent.rows as u32).for_each(|row| lists.clear(row)),
        }
    }

    fn push(&mut self, source: u32, reader: u32) {
        match self {
            Self::Bits(bits) => bits.set(source, reader),
            Self::Lists(lists) => lists.push(source, reader),
        }
    }

    fn remove(&mut self, source: u32, reader: u32) {
        match self {
            Self::Bits(bits) => bits.unset(source, reader),
            Self::Lists(lists) => lists.remove(source, reader),
        }
    }

    #[inline]
    fn for_blocks(&self, sources: impl Iterator<Item = u32>, mut visit: impl FnMut(&[u32])) {
        match self {
            Self::Bits(bits) => bits.for_blocks(sources, visit),
            Self::Lists(lists) => sources.for_each(|source| lists.for_blocks(source, &mut visit)),
        }
    }
}

const WORD: usize = u64::BITS as usize;

#[derive(Clone, Debug)]
struct Bits {
    words: usize,
    pairs: Vec<u64>,
}

impl Bits {
    fn new(rows: usize, words: usize, memory: &mut Memory) -> Self {
        Self { words, pairs: memory.copies(0, rows * words) }
    }

    fn clear(&mut self) {
        self.pairs.fill(0);
    }

    fn set(&mut self, source: u32, reader: u32) {
        let word = reader as usize / WORD;
        self.pairs[source as usize * self.words + word] |= 1 << (reader as usize % WORD);
    }

    fn unset(&mut self, source: u32, reader: u32) {
        let word = reader as usize / WORD;
        self.pairs[source as usize * self.words + word] &= !(1 << (reader as usize % WORD));
    }

    /// Visits each reader once: rows mostly share their readers.
    #[inline]
    fn for_blocks(&self, sources: impl Iterator<Item = u32>, mut visit: impl FnMut(&[u32])) {
        let mut readers = [0; WORD];
        let readers = &mut readers[..self.words];
        for source in sources {
            let of_source = &self.pairs[source as usize * self.words..][..self.words];
            readers.iter_mut().zip(of_source).for_each(|(readers, bits)| *readers |= bits);
        }
        let (mut rows, mut count) = ([0; WORD], 0);
        for (word, bits) in readers.iter_mut().enumerate() {
            while *bits != 0 {
                rows[count] = (word * WORD) as u32 + bits.trailing_zeros();
                *bits &= *bits - 1;
                count += 1;
            }
            visit(&rows[..std::mem::take(&mut count)]);
        }
    }
}
