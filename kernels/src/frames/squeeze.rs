//! Squeeze-and-excitation (Hu et al. 2018): y(p, c) = x(p, c) sigmoid(W2 relu(W1 mean))(c).
//!
//! The mean is [`global_average`]'s, the layers are [`Dense`]; products with s are rounded.

use super::pool::global_average;
use super::shape::Region;
use super::view::{Band, View};
use crate::dense::{Activation, Dense};
use crate::error::KernelError;
use crate::isa::{Isa, Simd, Task, Vector, flat, flat_mut};
use crate::lanes::{LANES, Lanes};

/// The two dense layers.
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

    /// Bytes of scratch that the layer needs.
    pub fn scratch_bytes(&self) -> u128 {
        let lanes = 2 * Lanes::count(self.down.inputs()) + Lanes::count(self.down.outputs());
        lanes as u128 * size_of::<Lanes>() as u128
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
        // Cleared, so that the padding is zero whatever layer used the scratch before.
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
