//! Sums of a dense layer over several segments. Few segments change from one input to the next.
//!
//! Each segment has a partial sum of every output: from +0 over its channels, ascending, each
//! product rounded once with the sum. They are added in pairs, (0 + 1), (2 + 3), ..., the results
//! in pairs again; an odd last sum passes to the next level. A changed segment costs its products
//! and one addition per level and output. A segment that is all +0 needs no products: most readout
//! cells are empty.

use crate::isa::{Simd, Vector, accumulate, flat, flat_mut};
use crate::lanes::Lanes;
use crate::packed::Packed;

#[derive(Clone, Debug)]
pub(super) struct Segments {
    count: usize,
    channels: usize,
    /// Lanes of the outputs.
    lanes: usize,
    /// (S x C, O).
    weight: Packed,
}

impl Segments {
    pub(super) fn new(count: usize, channels: usize, outputs: usize, weight: &[f32]) -> Self {
        Self { count, channels, lanes: Lanes::count(outputs), weight: Packed::transposed(weight, outputs) }
    }

    pub(super) fn weight(&self, outputs: usize) -> Vec<f32> {
        self.weight.untransposed(outputs)
    }

    /// Lanes of all sums: of the segments, then of the pairs, up to the sum of all segments.
    pub(super) fn sums(&self) -> usize {
        levels(self.count).map(|(_, count)| count).sum::<usize>() * self.lanes
    }

    /// Brings `sums` up to date with the `changed` segments; returns the sums over all segments.
    #[inline(always)]
    pub(super) fn update<'a, S: Simd>(
        &self,
        simd: S,
        inputs: &[Lanes],
        changed: &[u32],
        sums: &'a mut [Lanes],
    ) -> &'a [Lanes] {
        for &segment in changed {
            self.products(simd, inputs, segment as usize, sums);
        }
        // A path to the root for each change, or all pairs, whichever is fewer.
        if changed.len() * self.count.ilog2() as usize > self.count {
            for (first, count) in levels(self.count) {
                (0..count / 2).for_each(|pair| self.add(first, count, pair, sums));
                self.pass_on(first, count, sums);
            }
        } else {
            for &segment in changed {
                let mut place = segment as usize;
                for (first, count) in levels(self.count) {
                    place /= 2;
                    if place < count / 2 {
                        self.add(first, count, place, sums);
                    } else {
                        self.pass_on(first, count, sums);
                    }
                }
            }
        }
        &sums[sums.len() - self.lanes..]
    }

    /// The partial sums of one segment.
    #[inline(always)]
    fn products<S: Simd>(&self, simd: S, inputs: &[Lanes], segment: usize, sums: &mut [Lanes]) {
        let stride = inputs.len() / self.count;
        let inputs = &inputs[segment * stride..][..stride];
        let sums = &mut sums[segment * self.lanes..][..self.lanes];
        if inputs.iter().all(|lanes| lanes.0.iter().all(|x| x.to_bits() == 0)) {
            return sums.fill(Lanes::ZERO);
        }
        let (inputs, first) = (&flat(inputs)[..self.channels], segment * self.channels);
        let mut lane = 0;
        while lane + 2 <= self.lanes {
            let weight = &self.weight.wide(lane)[first..][..self.channels];
            product::<S, S::V16>(simd, inputs, weight, &mut sums[lane..]);
            lane += 2;
        }
        if lane < self.lanes {
            let weight = &self.weight.last()[first..][..self.channels];
            product::<S, S::V8>(simd, inputs, weight, &mut sums[lane..]);
        }
    }

    /// Adds a pair of sums of the level of `count` sums from sum `first` on.
    #[inline(always)]
    fn add(&self, first: usize, count: usize, pair: usize, sums: &mut [Lanes]) {
        let (below, above) = sums.split_at_mut((first + count) * self.lanes);
        let pairs = below[(first + 2 * pair) * self.lanes..].split_at(self.lanes);
        for (sum, (&a, &b)) in above[pair * self.lanes..].iter_mut().zip(pairs.0.iter().zip(pairs.1)) {
            *sum = a + b;
        }
    }

    /// Passes on the last of an odd number of sums.
    #[inline(always)]
    fn pass_on(&self, first: usize, count: usize, sums: &mut [Lanes]) {
        if count > 1 && count % 2 == 1 {
            let last = (first + count - 1) * self.lanes;
            sums.copy_within(last..last + self.lanes, (first + count + count / 2) * self.lanes);
        }
    }
}

/// The first sum of each level and the number of its sums, from the segments to the sum of all.
fn levels(segments: usize) -> impl Iterator<Item = (usize, usize)> {
    std::iter::successors(Some((0, segments)), |&(first, count)| {
        (count > 1).then(|| (first + count, count.div_ceil(2)))
    })
}

/// The products of one vector of outputs.
#[inline(always)]
fn product<S: Simd, V: Vector<S>>(simd: S, inputs: &[f32], weight: &[V::Memory], out: &mut [Lanes]) {
    let mut sum = [[V::splat(simd, 0.0)]];
    accumulate::<S, V, 1, 1, 0, 1>(simd, &mut sum, inputs, 0, [weight]);
    sum[0][0].store_slice(flat_mut(out));
}
