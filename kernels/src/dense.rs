//! Dense layers: y = activation(W x + b).
//!
//! Inputs are the rows (segments) of a matrix. A segment is summed in 32 partial sums, input i into
//! sum i mod 32, each ascending, each product rounded once with its sum. The partial sums are added
//! as four groups of eight, (a0 + a1) + (a2 + a3), and the resulting eight as ((0 + 4) + (2 + 6)) +
//! ((1 + 5) + (3 + 7)). A step of 32 inputs that are all +0 is skipped: it changes no sum. Over
//! several segments the sum is a tree, so that a changed segment costs little (`segments.rs`).

mod segments;

use segments::Segments;

use crate::elementary::{elu, elus, sigmoid, tanh};
use crate::error::{KernelError, check, check_sizes};
use crate::isa::{Isa, Simd, Task, Vector, flat};
use crate::lanes::{LANES, Lanes};

/// Activation applied to a dense layer's sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    /// No function.
    #[default]
    Identity,
    /// max(x, 0); NaN stays NaN, so that it is detected.
    Relu,
    /// x for x > 0, else e^x - 1.
    Elu,
    /// 1 / (1 + e^-x).
    Sigmoid,
    /// The hyperbolic tangent.
    Tanh,
}

/// A dense layer over (segments, channels) inputs.
#[derive(Clone, Debug)]
pub struct Dense {
    inputs: usize,
    channels: usize,
    outputs: usize,
    weight: Weight,
    bias: Vec<Lanes>,
    activation: Activation,
}

#[derive(Clone, Debug)]
enum Weight {
    /// Weights of one segment, (O, lanes of channels).
    One(Vec<Lanes>),
    Several(Segments),
}

impl Dense {
    /// A layer from `segments` rows of `channels` values to `outputs`. `weight` is (outputs,
    /// segments x channels), `bias` (outputs).
    ///
    /// # Errors
    /// A size of zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(
        segments: usize,
        channels: usize,
        outputs: usize,
        weight: &[f32],
        bias: Option<&[f32]>,
        activation: Activation,
    ) -> Result<Self, KernelError> {
        // No tensor has the length of a product that saturates.
        let inputs = segments.saturating_mul(channels);
        check_sizes([("inputs", inputs), ("outputs", outputs)])?;
        check("weight", weight, inputs.saturating_mul(outputs))?;
        let bias = bias.map_or_else(|| vec![0.0; outputs], <[f32]>::to_vec);
        check("bias", &bias, outputs)?;
        let bias = Lanes::pack(&bias);
        let weight = if segments == 1 {
            Weight::One(weight.chunks_exact(channels).flat_map(Lanes::pack).collect())
        } else {
            Weight::Several(Segments::new(segments, channels, outputs, weight))
        };
        Ok(Self { inputs, channels, outputs, weight, bias, activation })
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Values of one row of the input; there are [`Self::inputs`] / channels rows.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The weights, (outputs, inputs). O(weights).
    pub fn weight(&self) -> Vec<f32> {
        match &self.weight {
            Weight::One(weight) => {
                let mut values = Vec::with_capacity(self.outputs * self.inputs);
                for row in weight.chunks_exact(Lanes::count(self.channels)) {
                    let end = values.len() + self.channels;
                    row.iter().for_each(|lanes| values.extend_from_slice(&lanes.0));
                    // The padding of the last lanes contains no weights.
                    values.truncate(end);
                }
                values
            }
            Weight::Several(segments) => segments.weight(self.outputs),
        }
    }

    /// The biases, (outputs).
    pub fn bias(&self) -> &[f32] {
        &flat(&self.bias)[..self.outputs]
    }

    /// The activation.
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// Computes every output. `inputs` is laid out as [`crate::Matrix::lanes`]; `out` is in lanes,
    /// its padding zero. O(inputs x outputs); allocates for several segments.
    ///
    /// # Panics
    /// If a slice does not have the sizes of this layer.
    pub fn run(&self, isa: Isa, inputs: &[Lanes], out: &mut [Lanes]) {
        match &self.weight {
            Weight::One(_) => self.update(isa, inputs, &[], &mut [], out),
            Weight::Several(segments) => {
                let all: Vec<u32> = (0..(self.inputs / self.channels) as u32).collect();
                self.update(isa, inputs, &all, &mut vec![Lanes::ZERO; segments.sums()], out);
            }
        }
    }

    /// Size in lanes of [`Self::update`]'s sums: about 2 segments a lane of outputs, 0 for one.
    pub fn sums(&self) -> usize {
        match &self.weight {
            Weight::One(_) => 0,
            Weight::Several(segments) => segments.sums(),
        }
    }

    /// As [`Self::run`], with the same bits, from the last call's `sums` and the `changed`
    /// segments; at first `sums` are zeros, and all segments that are not all +0 count as changed.
    /// O(changed x (channels + log segments) x outputs); a single segment is computed completely.
    ///
    /// # Panics
    /// If a slice does not have the sizes of this layer.
    pub fn update(&self, isa: Isa, inputs: &[Lanes], changed: &[u32], sums: &mut [Lanes], out: &mut [Lanes]) {
        let stride = self.inputs / self.channels * Lanes::count(self.channels);
        assert_eq!(inputs.len(), stride, "the input must have the layer's size");
        assert_eq!(sums.len(), self.sums(), "the sums must have the layer's size");
        assert_eq!(out.len(), Lanes::count(self.outputs), "the output must have the layer's size");
        isa.run(Run { dense: self, inputs, changed, sums, out });
    }
}

struct Run<'a> {
    dense: &'a Dense,
    inputs: &'a [Lanes],
    changed: &'a [u32],
    sums: &'a mut [Lanes],
    out: &'a mut [Lanes],
}

impl Task for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { dense, inputs, changed, sums, out } = self;
        out.fill(Lanes::ZERO);
        let weight = match &dense.weight {
            Weight::One(weight) => weight,
            Weight::Several(segments) => {
                let sums = segments.update(simd, inputs, changed, sums);
                return dense.write_all(simd, sums, out);
            }
        };
        let inputs = flat(inputs);
        let weight = |o: usize| &flat(weight)[o * inputs.len()..][..inputs.len()];
        let mut o = 0;
        // Several outputs share the loaded inputs: as many as there are registers for their sums.
        while S::WIDE && o + 4 <= dense.outputs {
            dots::<S, 4>(simd, inputs, std::array::from_fn(|i| weight(o + i)), |i, y| {
                dense.write(o + i, y, out);
            });
            o += 4;
        }
        while o + 2 <= dense.outputs {
            dots::<S, 2>(simd, inputs, std::array::from_fn(|i| weight(o + i)), |i, y| {
                dense.write(o + i, y, out);
            });
            o += 2;
        }
        if o < dense.outputs {
            dots::<S, 1>(simd, inputs, [weight(o)], |_, y| dense.write(o, y, out));
        }
    }
}

impl Dense {
    /// Writes every output as [`Self::write`] does; the padding of `sums` is zero.
    #[inline(always)]
    fn write_all<S: Simd>(&self, simd: S, sums: &[Lanes], out: &mut [Lanes]) {
        if self.activation != Activation::Elu {
            return (0..self.outputs).for_each(|o| self.write(o, flat(sums)[o], out));
        }
        let mut lane = 0;
        while lane + 4 <= out.len() {
            // Not `map`: the compiler may call its closure once for each element.
            let mut ys = [S::V8::splat(simd, 0.0); 4];
            for (more, y) in ys.iter_mut().enumerate() {
                *y = self.biased(simd, sums, lane + more);
            }
            out[lane..].iter_mut().zip(elus(simd, ys)).for_each(|(out, y)| y.store(out));
            lane += 4;
        }
        for (lane, out) in out.iter_mut().enumerate().skip(lane) {
            elus(simd, [self.biased(simd, sums, lane)])[0].store(out);
        }
    }

    /// Eight sums and their biases.
    #[inline(always)]
    fn biased<S: Simd>(&self, simd: S, sums: &[Lanes], lane: usize) -> S::V8 {
        S::V8::load(simd, &sums[lane]).add(S::V8::load(simd, &self.bias[lane]))
    }

    /// Writes output `o`, whose sum is `sum`.
    #[inline(always)]
    fn write(&self, o: usize, sum: f32, out: &mut [Lanes]) {
        let y = sum + flat(&self.bias)[o];
        out[o / LANES].0[o % LANES] = match self.activation {
            Activation::Identity => y,
            Activation::Relu => {
                if y < 0.0 {
                    0.0
                } else {
                    y
                }
            }
            Activation::Elu => elu(y),
            Activation::Sigmoid => sigmoid(y),
            Activation::Tanh => tanh(y),
        };
    }
}

/// Dot products of one input with O rows of weights, in the order of the module's header.
#[inline(always)]
fn dots<S: Simd, const O: usize>(
    simd: S,
    inputs: &[f32],
    weight: [&[f32]; O],
    mut write: impl FnMut(usize, f32),
) {
    const STEP: usize = 4 * LANES;
    let zero = S::V16::splat(simd, 0.0);
    let mut acc = [[zero; 2]; O];
    let whole = inputs.len() / STEP * STEP;
    let mut i = 0;
    while i < whole {
        // Not `map`: the compiler may call its closure once for each element.
        let x = [S::V16::load_slice(simd, &inputs[i..]), S::V16::load_slice(simd, &inputs[i + 2 * LANES..])];
        if x[0].differs(zero) | x[1].differs(zero) != 0 {
            for (half, x) in x.into_iter().enumerate() {
                for (acc, weight) in acc.iter_mut().zip(weight) {
                    let w = S::V16::load_slice(simd, &weight[i + half * 2 * LANES..]);
                    acc[half] = acc[half].add_product(x, w);
                }
            }
        }
        i += STEP;
    }
    for (o, (acc, weight)) in acc.into_iter().zip(weight).enumerate() {
        let mut sums = [0.0; STEP];
        acc[0].store_slice(&mut sums[..2 * LANES]);
        acc[1].store_slice(&mut sums[2 * LANES..]);
        // The remainder is whole lanes.
        for (sum, (x, w)) in
            sums.chunks_mut(LANES).zip(inputs[whole..].chunks(LANES).zip(weight[whole..].chunks(LANES)))
        {
            let rest = S::V8::load_slice(simd, sum);
            rest.add_product(S::V8::load_slice(simd, x), S::V8::load_slice(simd, w)).store_slice(sum);
        }
        write(o, total(&sums));
    }
}

/// The last sums of a dot product. Not inlined: if the compiler sees the loop, it splits its
/// accumulators into the pieces added here, and the loop takes twice as long.
#[inline(never)]
fn total(sums: &[f32; 4 * LANES]) -> f32 {
    let v: [f32; LANES] =
        std::array::from_fn(|i| (sums[i] + sums[i + LANES]) + (sums[i + 2 * LANES] + sums[i + 3 * LANES]));
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}
