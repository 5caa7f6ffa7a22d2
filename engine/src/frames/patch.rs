//! Recomputes the parts of a map that a change reaches, except pixels that equal those for zeros.
//!
//! Input: the pixels that a change reaches, and a kernel whose bits do not depend on the region.
//! Output: the map as if it was computed completely, and the pixels that changed.

use meissner_kernels::{FeatureMap, Planes, Region};

use super::changes::Changes;
use crate::counters::FrameLayerCounters;

/// Largest share of a map that is recomputed in parts; above it, the whole map is computed.
const WHOLE: f64 = 0.75;

pub(super) trait Pixels {
    /// Appends the values of `region` to `out`.
    fn save(&self, region: Region, out: &mut Vec<f32>);
    /// Compares `region` with what [`Self::save`] stored. A pixel that changed by more than
    /// `tolerance` in a channel (`None`: in a bit) is marked in `changed`; others get their old
    /// values back.
    fn compare(&mut self, region: Region, old: &[f32], tolerance: Option<f32>, changed: &mut Changes);
    /// A map of the same layout.
    type Whole;
    /// Copies the values of a pixel from `other`; returns whether they differed.
    fn take(&mut self, other: &Self::Whole, y: usize, x: usize) -> bool;
}

fn moved(old: f32, new: f32, tolerance: Option<f32>) -> bool {
    match tolerance {
        None => old.to_bits() != new.to_bits(),
        Some(tolerance) => (new - old).abs() > tolerance || new.is_nan(),
    }
}

/// Some channels of a map with channels last.
pub(super) struct MapPixels<'a> {
    pub(super) map: &'a mut FeatureMap,
    pub(super) first: usize,
    pub(super) channels: usize,
}

impl MapPixels<'_> {
    fn pixel(&mut self, y: usize, x: usize) -> &mut [f32] {
        &mut self.map.pixel_mut(y, x)[self.first..self.first + self.channels]
    }
}

impl Pixels for MapPixels<'_> {
    fn save(&self, region: Region, out: &mut Vec<f32>) {
        for y in region.y..region.y + region.height {
            for x in region.x..region.x + region.width {
                out.extend_from_slice(&self.map.pixel(y, x)[self.first..self.first + self.channels]);
            }
        }
    }

    fn compare(&mut self, region: Region, old: &[f32], tolerance: Option<f32>, changed: &mut Changes) {
        let channels = self.channels;
        for (i, old) in old.chunks_exact(channels).enumerate() {
            let (y, x) = (region.y + i / region.width, region.x + i % region.width);
            let new = self.pixel(y, x);
            let differs = match tolerance {
                None => new.iter().zip(old).fold(0, |bits, (a, b)| bits | (a.to_bits() ^ b.to_bits())) != 0,
                Some(_) => new.iter().zip(old).any(|(&new, &old)| moved(old, new, tolerance)),
            };
            if differs {
                changed.set(y, x);
            } else if tolerance.is_some() {
                new.copy_from_slice(old);
            }
        }
    }

    type Whole = FeatureMap;

    fn take(&mut self, other: &FeatureMap, y: usize, x: usize) -> bool {
        let from = &other.pixel(y, x)[self.first..self.first + self.channels];
        let to = self.pixel(y, x);
        let differs = to.iter().zip(from).any(|(a, b)| a.to_bits() != b.to_bits());
        to.copy_from_slice(from);
        differs
    }
}

impl Pixels for Planes {
    fn save(&self, region: Region, out: &mut Vec<f32>) {
        for channel in 0..self.channels() {
            for y in region.y..region.y + region.height {
                out.extend_from_slice(&self.row(channel, y)[region.x..region.x + region.width]);
            }
        }
    }

    fn compare(&mut self, region: Region, old: &[f32], tolerance: Option<f32>, changed: &mut Changes) {
        let (channels, plane) = (self.channels(), region.height * region.width);
        for y in region.y..region.y + region.height {
            for x in region.x..region.x + region.width {
                let at = (y - region.y) * region.width + x - region.x;
                let differs = (0..channels).any(|c| moved(old[c * plane + at], self.row(c, y)[x], tolerance));
                if differs {
                    changed.set(y, x);
                } else if tolerance.is_some() {
                    (0..channels).for_each(|c| self.row_mut(c, y)[x] = old[c * plane + at]);
                }
            }
        }
    }

    type Whole = Planes;

    fn take(&mut self, other: &Planes, y: usize, x: usize) -> bool {
        let mut differs = false;
        for channel in 0..self.channels() {
            let from = other.row(channel, y)[x];
            let to = &mut self.row_mut(channel, y)[x];
            differs |= to.to_bits() != from.to_bits();
            *to = from;
        }
        differs
    }
}

pub(super) struct Patch<'a, W> {
    pub(super) size: [usize; 2],
    /// Pixels that a change reaches; `None` recomputes everything and compares nothing.
    pub(super) dirty: Option<&'a Changes>,
    /// The output for a frame of zeros, and the pixels that other values may reach.
    pub(super) background: Option<(&'a W, &'a Changes)>,
    pub(super) tolerance: Option<f32>,
    /// Rows and columns of the recomputed blocks.
    pub(super) block: [usize; 2],
    /// Whether a small rectangle of changes, such as that of one changed pixel, is recomputed at
    /// once instead of in blocks: the weights are then read once.
    pub(super) rectangles: bool,
}

#[derive(Clone, Debug)]
pub(super) struct PatchScratch {
    todo: Changes,
    old: Vec<f32>,
}

impl PatchScratch {
    /// Room for these numbers of bytes of marks, and of the values of a row of blocks.
    pub(super) fn with_bytes(marks: u128, compared: u128) -> Self {
        let old = Vec::with_capacity(compared as usize / size_of::<f32>());
        Self { todo: Changes::with_bytes(marks), old }
    }
}

impl<W> Patch<'_, W> {
    /// Brings `pixels` up to date; sets `changed` to the pixels that changed or may have changed.
    pub(super) fn apply<P: Pixels<Whole = W>>(
        self,
        pixels: &mut P,
        scratch: &mut PatchScratch,
        changed: &mut Changes,
        counters: &mut FrameLayerCounters,
        mut compute: impl FnMut(&mut P, Region),
    ) {
        let [height, width] = self.size;
        let all = height * width;
        let Some(dirty) = self.dirty else {
            compute(pixels, Region::all(height, width));
            counters.computed += all as u64;
            changed.set_all();
            return;
        };
        changed.clear();
        let PatchScratch { todo, old } = scratch;
        todo.clone_from(dirty);
        if let Some((background, reached)) = self.background {
            todo.keep(reached);
            dirty.for_each(|y, x| {
                if !reached.contains(y, x) {
                    counters.absorbed += 1;
                    if pixels.take(background, y, x) {
                        changed.set(y, x);
                    }
                }
            });
        }
        let count = todo.count();
        let before = counters.computed;
        let others = (all - (dirty.count() - count)) as u64;
        if count as f64 > WHOLE * all as f64 && self.tolerance.is_none() {
            compute(pixels, Region::all(height, width));
            counters.computed += others;
            changed.include(todo);
            return;
        }
        let mut patch = |region: Region| {
            old.clear();
            pixels.save(region, old);
            compute(pixels, region);
            counters.computed += (region.height * region.width) as u64;
            pixels.compare(region, old, self.tolerance, changed);
        };
        match todo.rectangle().filter(|_| self.rectangles) {
            Some(rectangle) => patch(rectangle),
            None => todo.for_each_region(self.block[0], self.block[1], patch),
        }
        // Blocks may contain absorbed pixels as well as those that had to be computed.
        counters.skipped += others.saturating_sub(counters.computed - before);
    }
}
