//! Changed pixels of a map, as bits, and their propagation from one layer to the next.

use std::iter;

use meissner_kernels::Region;

use super::network::FrameShape;

const WORD: usize = 64;

/// Maximum number of pixels of a rectangle that is recomputed at once.
pub(super) const RECTANGLE: usize = 64;

/// One bit for each pixel of a map of `height` x `width`.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Changes {
    pub(crate) height: usize,
    pub(crate) width: usize,
    words: usize,
    bits: Vec<u64>,
}

impl Clone for Changes {
    /// A clone has the same room.
    fn clone(&self) -> Self {
        let mut bits = Vec::with_capacity(self.bits.capacity());
        bits.extend_from_slice(&self.bits);
        Self { bits, ..*self }
    }

    /// Allocates only if there is no room; the derived implementation always allocates.
    fn clone_from(&mut self, other: &Self) {
        self.bits.clone_from(&other.bits);
        (self.height, self.width, self.words) = (other.height, other.width, other.words);
    }
}

impl Changes {
    pub(crate) fn none(height: usize, width: usize) -> Self {
        let words = width.div_ceil(WORD);
        Self { height, width, words, bits: vec![0; height * words] }
    }

    /// Room for `bytes` of marks.
    pub(super) fn with_bytes(bytes: u128) -> Self {
        Self { bits: Vec::with_capacity(bytes as usize / size_of::<u64>()), ..Self::default() }
    }

    /// No marks on an image; empty for a vector.
    pub(super) fn of(shape: FrameShape) -> Self {
        let [height, width] = shape.marks();
        Self::none(height, width)
    }

    /// Changes the size and removes all marks. Allocates only for the largest size so far.
    pub(crate) fn become_none(&mut self, [height, width]: [usize; 2]) {
        let words = width.div_ceil(WORD);
        self.bits.clear();
        self.bits.resize(height * words, 0);
        (self.height, self.width, self.words) = (height, width, words);
    }

    pub(crate) fn size(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    pub(crate) fn words(&self) -> &[u64] {
        &self.bits
    }

    /// Replaces the bits of one word if all of them are pixels; returns whether they are.
    pub(crate) fn set_word(&mut self, at: usize, word: u64) -> bool {
        let fits = word & !self.mask(at % self.words) == 0;
        if fits {
            self.bits[at] = word;
        }
        fits
    }

    /// Mask of the bits in word `i` of a row that are pixels.
    fn mask(&self, i: usize) -> u64 {
        match self.width - i * WORD {
            rest if rest < WORD => (1 << rest) - 1,
            _ => u64::MAX,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.bits.fill(0);
    }

    pub(crate) fn set_all(&mut self) {
        for y in 0..self.height {
            for i in 0..self.words {
                self.bits[y * self.words + i] = self.mask(i);
            }
        }
    }

    #[inline]
    pub(crate) fn set(&mut self, y: usize, x: usize) {
        self.bits[y * self.words + x / WORD] |= 1 << (x % WORD);
    }

    #[inline]
    pub(crate) fn contains(&self, y: usize, x: usize) -> bool {
        self.bits[y * self.words + x / WORD] >> (x % WORD) & 1 == 1
    }

    pub(crate) fn set_region(&mut self, region: Region) {
        for y in region.y..region.y + region.height {
            (region.x..region.x + region.width).for_each(|x| self.set(y, x));
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bits.iter().all(|&word| word == 0)
    }

    pub(crate) fn count(&self) -> usize {
        self.bits.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The rectangle of the marked pixels, if they form a rectangle of at most [`RECTANGLE`]
    /// pixels.
    pub(crate) fn rectangle(&self) -> Option<Region> {
        let marked = self.count();
        if !(1..=RECTANGLE).contains(&marked) {
            return None;
        }
        let [mut top, mut bottom, mut left, mut right] = [usize::MAX, 0, usize::MAX, 0];
        self.for_each(|y, x| {
            (top, bottom, left, right) = (top.min(y), bottom.max(y + 1), left.min(x), right.max(x + 1));
        });
        let rectangle = Region { y: top, x: left, height: bottom - top, width: right - left };
        (rectangle.height * rectangle.width == marked).then_some(rectangle)
    }

    pub(crate) fn any_in(&self, region: Region) -> bool {
        (region.y..region.y + region.height).any(|y| {
            let row = &self.bits[y * self.words..][..self.words];
            let (first, last) = (region.x / WORD, (region.x + region.width - 1) / WORD);
            (first..=last).any(|i| {
                let from = if i == first { u64::MAX << (region.x % WORD) } else { u64::MAX };
                let end = region.x + region.width - i * WORD;
                let to = if end < WORD { (1 << end) - 1 } else { u64::MAX };
                row[i] & from & to != 0
            })
        })
    }

    /// Adds the marks of `other`, of the same size.
    pub(crate) fn include(&mut self, other: &Self) {
        for (word, other) in self.bits.iter_mut().zip(&other.bits) {
            *word |= other;
        }
    }

    /// Removes the marks that `other`, of the same size, does not have.
    pub(crate) fn keep(&mut self, other: &Self) {
        for (word, other) in self.bits.iter_mut().zip(&other.bits) {
            *word &= other;
        }
    }

    /// Sets the marks to those of `other`, of the same size, and their eight neighbours.
    pub(crate) fn spread_of(&mut self, other: &Self) {
        self.clear();
        for y in 0..self.height {
            for i in 0..self.words {
                let at = y * self.words + i;
                let word = other.bits[at];
                if word == 0
                    && (i == 0 || other.bits[at - 1] >> (WORD - 1) == 0)
                    && (i + 1 == self.words || other.bits[at + 1] & 1 == 0)
                {
                    continue;
                }
                let before = if i > 0 { other.bits[at - 1] >> (WORD - 1) } else { 0 };
                let after = if i + 1 < self.words { other.bits[at + 1] << (WORD - 1) } else { 0 };
                let wide = (word | word << 1 | word >> 1 | before | after) & self.mask(i);
                for row in y.saturating_sub(1)..=(y + 1).min(self.height - 1) {
                    self.bits[row * self.words + i] |= wide;
                }
            }
        }
    }

    /// Marks every pixel of each `size` x `size` tile with a mark; `scratch` is overwritten.
    pub(crate) fn fill_tiles(&mut self, size: usize, scratch: &mut Self) {
        scratch.clone_from(self);
        scratch.for_each_region(size, size, |tile| self.set_region(tile));
    }

    /// Sets the marks to those of `other`, reduced by `size` x `size` windows of that stride.
    pub(crate) fn shrunk_from(&mut self, other: &Self, size: usize) {
        self.clear();
        other.for_each(|y, x| {
            if y / size < self.height && x / size < self.width {
                self.set(y / size, x / size);
            }
        });
    }

    /// Sets the marks to those of `other` scaled by two.
    pub(crate) fn doubled_from(&mut self, other: &Self) {
        self.clear();
        other.for_each(|y, x| self.set_region(Region { y: 2 * y, x: 2 * x, height: 2, width: 2 }));
    }

    pub(crate) fn for_each(&self, mut visit: impl FnMut(usize, usize)) {
        self.pixels().for_each(|[y, x]| visit(y, x));
    }

    /// Row and column of each marked pixel, in order.
    pub(super) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> {
        self.bits.iter().enumerate().flat_map(move |(at, &word)| {
            let rests = iter::successors(Some(word), |rest| Some(rest & rest.wrapping_sub(1)));
            let marks = rests.take_while(|&rest| rest != 0);
            marks.map(move |rest| [at / self.words, at % self.words * WORD + rest.trailing_zeros() as usize])
        })
    }

    /// Calls `visit` with regions that cover every mark: whole blocks of `rows` x `columns` pixels,
    /// except at the lower and right edges; adjacent blocks of a row are one region.
    pub(crate) fn for_each_region(&self, rows: usize, columns: usize, mut visit: impl FnMut(Region)) {
        for y in (0..self.height).step_by(rows) {
            let height = rows.min(self.height - y);
            let mut start = None;
            for x in (0..self.width).step_by(columns) {
                let width = columns.min(self.width - x);
                let marked = self.any_in(Region { y, x, height, width });
                match (start, marked) {
                    (None, true) => start = Some(x),
                    (Some(first), false) => {
                        visit(Region { y, x: first, height, width: x - first });
                        start = None;
                    }
                    _ => {}
                }
            }
            if let Some(first) = start {
                visit(Region { y, x: first, height, width: self.width - first });
            }
        }
    }
}

/// Changes of a layer's input since the layer last ran.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    /// Changed pixels of an image.
    pub(super) pixels: Changes,
    pub(super) any: bool,
}
