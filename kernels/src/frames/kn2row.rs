//! A 3 x 3 convolution as nine 1 x 1 convolutions whose products are kept: kn2row (Vasudevan et al.
//! 2017, "Parallel multi channel convolution using general matrix multiplication").
//!
//! Input pixel p has nine products for each output channel, P(p, place, o) = sum over i of x(p, i)
//! W(o, i, place), a chain from +0, i ascending. y(p, o) = relu(b(o) + P(p + place, place, o) for
//! each place), rows before columns. A changed pixel costs its own products and nine additions for
//! each of nine outputs, instead of all products of nine outputs.

use super::conv::{Conv1x1, check_inputs};
use super::feature_map::{Band, FeatureMap, Target, View};
use super::layer::{Tiles, in_tiles, store_some};
use super::shape::Region;
use super::weights::{BLOCK, ConvParts, Layout, Packed};
use crate::error::{KernelError, MAX_CHANNELS};
use crate::frames::room;
use crate::isa::{Isa, Simd, Task, Vector, accumulate};
use crate::lanes::Wide;

const PLACES: usize = 9;

/// A convolution of one map with a 3 x 3 kernel and padding 1, whose products are kept.
#[derive(Clone, Debug)]
pub struct Kn2rowConv3x3 {
    /// The nine products of a pixel, (C, 9 O).
    products: Conv1x1,
    outputs: usize,
    bias: Vec<Wide>,
    relu: bool,
}

/// Working space for the pixels whose products are computed; grows to the largest number of them.
#[derive(Clone, Debug, Default)]
pub struct Kn2rowScratch {
    /// The channels of each pixel.
    inputs: Vec<f32>,
    /// Start index of the products of each pixel.
    starts: Vec<usize>,
}

impl Kn2rowScratch {
    /// Room for the layers that need no more bytes of each part: their runs allocate nothing.
    pub fn with_bytes([inputs, starts]: [u128; 2]) -> Self {
        Self { inputs: room(inputs), starts: room(starts) }
    }
}

impl Kn2rowConv3x3 {
    /// Largest number of output channels.
    pub const MAX_OUTPUTS: usize = MAX_CHANNELS / PLACES;

    /// Packs a layer's parameters.
    ///
    /// # Errors
    /// A size of zero, more than [`Self::MAX_OUTPUTS`] outputs or one input map, a tensor of the
    /// wrong length, or a value that is not finite.
    pub fn new(parts: &ConvParts) -> Result<Self, KernelError> {
        parts.check(PLACES)?;
        let outputs = parts.outputs;
        let &[channels] = &parts.inputs[..] else {
            let found = parts.inputs.len();
            return Err(KernelError::Size { what: "input maps", expected: "1", found });
        };
        if outputs > Self::MAX_OUTPUTS {
            let expected = "at most 7281 output channels";
            return Err(KernelError::Size { what: "outputs", expected, found: outputs });
        }
        // The weights of (place, output) for each channel.
        let weights = (0..PLACES * outputs * channels).map(|n| {
            let (row, i) = (n / channels, n % channels);
            parts.weight(Layout::OutputsFirst, PLACES, [i, row / outputs, row % outputs])
        });
        let products = Conv1x1::new(&ConvParts {
            inputs: vec![channels],
            outputs: PLACES * outputs,
            weight: weights.collect(),
            ..ConvParts::default()
        })?;
        Ok(Self { products, outputs, bias: parts.biases(), relu: parts.relu })
    }

    /// Output channels O.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Channels of the map of products, 9 O. The map has a halo of 1.
    pub fn products(&self) -> usize {
        PLACES * self.outputs
    }

    /// Largest number of bytes of scratch for `pixels` changed pixels: their inputs, and the start
    /// indices of their products.
    pub fn scratch_bytes(&self, pixels: usize) -> [u128; 2] {
        [self.products.inputs[0] * size_of::<f32>(), size_of::<usize>()]
            .map(|bytes| bytes as u128 * pixels as u128)
    }

    /// Computes only the products of `pixels`, each (y, x). O(pixels x 9 x C x O).
    ///
    /// # Errors
    /// [`KernelError::Shape`] or [`KernelError::Size`] for a map not of the output's size.
    ///
    /// # Panics
    /// If a pixel is not on the map.
    pub fn update(
        &self,
        isa: Isa,
        input: View<'_>,
        pixels: impl IntoIterator<Item = [usize; 2]>,
        products: &mut FeatureMap,
        scratch: &mut Kn2rowScratch,
    ) -> Result<(), KernelError> {
        let [height, width, _] = input.size();
        check_inputs(&self.products.inputs, &[input], [height, width], 0)?;
        products.view().check([height, width, self.products()], 1)?;
        let Kn2rowScratch { inputs, starts } = scratch;
        inputs.clear();
        starts.clear();
        let mut out = products.band();
        let Target { values, row, pixel } = out.target(0, 0);
        for [y, x] in pixels {
            inputs.extend_from_slice(input.pixel(y, x));
            starts.push(y * row + x * pixel);
        }
        self.multiply(isa, inputs, starts, values);
        Ok(())
    }

    /// Separate, because [`Self::update`] is compiled again for each kind of iterator.
    fn multiply(&self, isa: Isa, inputs: &[f32], starts: &[usize], out: &mut [f32]) {
        isa.run(Products { packed: &self.products.packed, inputs, starts, out });
    }

    /// Adds the products of `region`'s outputs; other outputs are unchanged. O(region x 9 x O).
    ///
    /// # Errors
    /// [`KernelError::Shape`] or [`KernelError::Size`] for products that do not fit,
    /// [`KernelError::Region`] for a region beyond the band.
    pub fn sum(
        &self,
        isa: Isa,
        products: View<'_>,
        region: Region,
        mut out: Band<'_>,
    ) -> Result<(), KernelError> {
        let [height, width, _] = out.size();
        out.check([height, width, self.outputs], region)?;
        products.check([height, width, self.products()], 1)?;
        if region.is_empty() {
            return Ok(());
        }
        let target = out.target(region.y, region.x);
        isa.run(Sum { conv: self, products, region, target });
        Ok(())
    }
}

struct Products<'a> {
    packed: &'a Packed,
    inputs: &'a [f32],
    starts: &'a [usize],
    out: &'a mut [f32],
}

impl Task for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let mut block = 0;
        while S::WIDE && block + 2 <= self.packed.blocks() {
            self.blocks::<S, 2>(simd, block);
            block += 2;
        }
        while block < self.packed.blocks() {
            self.blocks::<S, 1>(simd, block);
            block += 1;
        }
    }
}

impl Products<'_> {
    /// B blocks of products of every pixel.
    #[inline(always)]
    fn blocks<S: Simd, const B: usize>(&mut self, simd: S, block: usize) {
        let Self { packed, inputs, starts, .. } = *self;
        let weights = std::array::from_fn(|b| packed.block(block + b));
        let mut blocks = Blocks::<S, B> { simd, packed, weights, block, inputs, starts, out: self.out };
        in_tiles::<S, _>(starts.len(), &mut blocks);
    }
}

struct Blocks<'a, S, const B: usize> {
    simd: S,
    packed: &'a Packed,
    weights: [&'a [Wide]; B],
    block: usize,
    inputs: &'a [f32],
    starts: &'a [usize],
    out: &'a mut [f32],
}

impl<S: Simd, const B: usize> Tiles for Blocks<'_, S, B> {
    #[inline(always)]
    fn tile<const R: usize>(&mut self, first: usize) {
        let zero = S::V16::splat(self.simd, 0.0);
        let mut acc = [[zero; B]; R];
        let channels = self.packed.rows;
        let inputs = &self.inputs[first * channels..];
        accumulate::<_, _, R, B, 0, 1>(self.simd, &mut acc, inputs, channels, self.weights);
        for (sums, &start) in acc.into_iter().zip(&self.starts[first..]) {
            for (b, sum) in sums.into_iter().enumerate() {
                let block = self.block + b;
                store_some(sum, &mut self.out[start + block * BLOCK..][..self.packed.real(block)]);
            }
        }
    }
}

struct Sum<'a> {
    conv: &'a Kn2rowConv3x3,
    products: View<'a>,
    region: Region,
    target: Target<'a>,
}

impl Task for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { conv, products: View { shape, values, first, .. }, region, target } = self;
        let zero = S::V16::splat(simd, 0.0);
        // The first place of output (y, x) is the stored pixel (y, x): the halo is the padding.
        let places: [usize; PLACES] =
            std::array::from_fn(|place| shape.stored(place / 3, place % 3) + place * conv.outputs);
        for y in 0..region.height {
            for x in 0..region.width {
                let from = &values[shape.stored(region.y + y, region.x + x) + first..];
                let out = &mut target.values[y * target.row + x * target.pixel..][..conv.outputs];
                for ((out, bias), at) in out.chunks_mut(BLOCK).zip(&conv.bias).zip((0..).step_by(BLOCK)) {
                    let mut sum = S::V16::load(simd, bias);
                    for place in places {
                        sum = sum.add(S::V16::load_slice(simd, &from[place + at..]));
                    }
                    // No output is -0.
                    let sum = sum.add(zero);
                    store_some(if conv.relu { sum.max(zero) } else { sum }, out);
                }
            }
        }
    }
}
