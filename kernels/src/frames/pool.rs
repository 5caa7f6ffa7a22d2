//! Poolings of maps, channel by channel.
//!
//! Maximum: row by row; a later pixel replaces an earlier one only if larger or NaN, so a window
//! with NaN gives NaN. Averages: sums from +0 in a stated order, times the inverse of the number of
//! pixels rounded to f32.

use crate::dense::{Activation, Dense};
use crate::error::{KernelError, check_sizes};
use crate::frames::feature_map::{Band, View};
use crate::frames::layer::store_some;
use crate::frames::room;
use crate::frames::shape::Region;
use crate::isa::{Isa, Simd, Task, Vector, flat, flat_mut, prefetch};
use crate::lanes::{LANES, Lanes};

const WIDE: usize = 2 * LANES;

/// Number of outputs by which inputs are prefetched.
const AHEAD: usize = 8;

/// Maximum of 2 x 2 pixels, stride 2, for the outputs in `region`; odd last rows are dropped.
///
/// # Errors
/// [`KernelError::Shape`] if the output is not half as high and wide (rounded down) with as many
/// channels; [`KernelError::Region`] for a region beyond the band.
pub fn max_pool_2x2(isa: Isa, input: View<'_>, region: Region, out: Band<'_>) -> Result<(), KernelError> {
    let [height, width, channels] = input.size();
    let mut out = out;
    out.check([height / 2, width / 2, channels], region)?;
    isa.run(Pool::<true> { input, size: 2, region, out: &mut out });
    Ok(())
}

/// Average of `size` x `size` pixels with that stride for the outputs in `region`, row by row;
/// pixels that do not fill a window are dropped.
///
/// # Errors
/// [`KernelError::Size`] for a size of zero; otherwise as [`max_pool_2x2`].
pub fn average_pool(
    isa: Isa,
    size: usize,
    input: View<'_>,
    region: Region,
    out: Band<'_>,
) -> Result<(), KernelError> {
    check_sizes([("pooling window", size)])?;
    let [height, width, channels] = input.size();
    let mut out = out;
    out.check([height / size, width / size, channels], region)?;
    isa.run(Pool::<false> { input, size, region, out: &mut out });
    Ok(())
}

/// Average of all pixels: the sum of each row from the left, then the sum of these sums from the
/// top.
///
/// # Errors
/// [`KernelError::Length`] if `out` does not have one value per channel.
pub fn global_average(isa: Isa, input: View<'_>, out: &mut [f32]) -> Result<(), KernelError> {
    let [_, _, expected] = input.size();
    if out.len() != expected {
        return Err(KernelError::Length { tensor: "global average", expected, found: out.len() });
    }
    isa.run(Global { input, out });
    Ok(())
}

/// 1 / count, rounded to f32.
#[inline(always)]
fn inverse(count: usize) -> f32 {
    (1.0 / count as f64) as f32
}

struct Pool<'a, 'b, const MAXIMUM: bool> {
    input: View<'a>,
    size: usize,
    region: Region,
    out: &'a mut Band<'b>,
}

impl<const MAXIMUM: bool> Task for Pool<'_, '_, MAXIMUM> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { input, size, region, out } = self;
        let scale = S::V16::splat(simd, inverse(size * size));
        for y in region.y..region.y + region.height {
            for x in region.x..region.x + region.width {
                let target = out.target(y, x).values;
                for row in 0..size {
                    let ahead = input.shape.pixel(y * size + row, (x + AHEAD) * size);
                    let pixels = ahead..ahead + size * input.shape.channels;
                    prefetch(input.values.get(pixels).unwrap_or_default());
                }
                for c in (0..input.channels).step_by(WIDE) {
                    let at = |i: usize| {
                        let pixel = input.shape.pixel(y * size + i / size, x * size + i % size);
                        S::V16::load_slice(simd, &input.values[pixel + input.first + c..])
                    };
                    let mut acc = if MAXIMUM { at(0) } else { S::V16::splat(simd, 0.0) };
                    for i in usize::from(MAXIMUM)..size * size {
                        acc = if MAXIMUM { acc.max_or_nan(simd, at(i)) } else { acc.add(at(i)) };
                    }
                    let y = if MAXIMUM { acc } else { acc.mul(scale) };
                    store_some(y, &mut target[c..input.channels.min(c + WIDE)]);
                }
            }
        }
    }
}

struct Global<'a> {
    input: View<'a>,
    out: &'a mut [f32],
}

impl Task for Global<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        // Up to four registers of channels at once: a large map is then read once.
        for first in (0..self.out.len()).step_by(4 * WIDE) {
            match (self.out.len() - first).div_ceil(WIDE) {
                1 => self.sum::<S, 1>(simd, first),
                2 => self.sum::<S, 2>(simd, first),
                3 => self.sum::<S, 3>(simd, first),
                _ => self.sum::<S, 4>(simd, first),
            }
        }
    }
}

impl Global<'_> {
    /// The averages of B registers of channels from `first` on.
    #[inline(always)]
    fn sum<S: Simd, const B: usize>(&mut self, simd: S, first: usize) {
        let input = self.input;
        let [height, width, channels] = input.size();
        let zero = S::V16::splat(simd, 0.0);
        let mut total = [zero; B];
        for y in 0..height {
            let mut row = [zero; B];
            for x in 0..width {
                let pixel = &input.values[input.shape.pixel(y, x) + input.first + first..];
                for (b, sum) in row.iter_mut().enumerate() {
                    *sum = sum.add(S::V16::load_slice(simd, &pixel[b * WIDE..]));
                }
            }
            for (total, row) in total.iter_mut().zip(row) {
                *total = total.add(row);
            }
        }
        let scale = S::V16::splat(simd, inverse(height * width));
        for (b, sum) in total.into_iter().enumerate() {
            let first = first + b * WIDE;
            store_some(sum.mul(scale), &mut self.out[first..channels.min(first + WIDE)]);
        }
    }
}

/// Squeeze-and-excitation (Hu et al. 2018): y(p, c) = x(p, c) sigmoid(W2 relu(W1 mean))(c).
///
/// The mean is [`global_average`]'s, the layers are [`Dense`]; products are rounded.
#[derive(Clone, Debug)]
pub struct SqueezeExcite {
    down: Dense,
    up: Dense,
}

/// Working space for the means and factors of one image.
#[derive(Clone, Debug, Default)]
pub struct SqueezeScratch {
    mean: Vec<Lanes>,
    middle: Vec<Lanes>,
    scale: Vec<Lanes>,
}

impl SqueezeScratch {
    /// Room for the layers that need no more bytes of each part: their runs allocate nothing.
    pub fn with_bytes([mean, middle]: [u128; 2]) -> Self {
        Self { mean: room(mean), middle: room(middle), scale: room(mean) }
    }
}

impl SqueezeExcite {
    /// A layer for `channels` channels. `down` is (reduced, channels), `up` (channels, reduced).
    ///
    /// # Errors
    /// A size of zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(channels: usize, reduced: usize, down: &[f32], up: &[f32]) -> Result<Self, KernelError> {
        let down = Dense::new(1, channels, reduced, down, None, Activation::Relu)?;
        let up = Dense::new(1, reduced, channels, up, None, Activation::Sigmoid)?;
        Ok(Self { down, up })
    }

    /// Bytes of scratch that the layer needs: for the means (the factors need as many), and for the
    /// values between the layers.
    pub fn scratch_bytes(&self) -> [u128; 2] {
        [self.down.inputs(), self.down.outputs()]
            .map(|values| Lanes::count(values) as u128 * size_of::<Lanes>() as u128)
    }

    /// Scales every channel of `input` into `out`. O(values).
    ///
    /// # Errors
    /// [`KernelError::Shape`] for maps with other channels than the layer's, or of two sizes.
    pub fn run(
        &self,
        isa: Isa,
        input: View<'_>,
        mut out: Band<'_>,
        scratch: &mut SqueezeScratch,
    ) -> Result<(), KernelError> {
        let [height, width, _] = input.size();
        let channels = self.down.inputs();
        input.check([height, width, channels], 0)?;
        out.check([height, width, channels], Region::all(height, width))?;
        let SqueezeScratch { mean, middle, scale } = scratch;
        // Cleared, so that the padding is zero even if another layer used the scratch before.
        mean.clear();
        mean.resize(Lanes::count(channels), Lanes::ZERO);
        global_average(isa, input, &mut flat_mut(mean)[..channels])?;
        middle.resize(Lanes::count(self.down.outputs()), Lanes::ZERO);
        scale.resize(Lanes::count(channels), Lanes::ZERO);
        self.down.run(isa, mean, middle);
        self.up.run(isa, middle, scale);
        isa.run(Apply { input, scale: &flat(scale)[..channels], out: &mut out });
        Ok(())
    }
}

struct Apply<'a, 'b> {
    input: View<'a>,
    scale: &'a [f32],
    out: &'a mut Band<'b>,
}

impl Task for Apply<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { input, scale, out } = self;
        let [height, width, channels] = input.size();
        for y in 0..height {
            for x in 0..width {
                let from = &input.values[input.shape.pixel(y, x) + input.first..][..channels];
                let to = &mut out.target(y, x).values[..channels];
                let (vectors, rest) = to.as_chunks_mut::<LANES>();
                for (i, to) in vectors.iter_mut().enumerate() {
                    let value = S::V8::load_slice(simd, &from[i * LANES..]);
                    value.mul(S::V8::load_slice(simd, &scale[i * LANES..])).store_slice(to);
                }
                let first = channels - rest.len();
                for (to, (from, scale)) in rest.iter_mut().zip(from[first..].iter().zip(&scale[first..])) {
                    *to = from * scale;
                }
            }
        }
    }
}
