//! Dense layers: y = activation(W x + b).
//!
//! The sum over inputs runs in 32 partial sums, input i into sum i mod 32, each in ascending order; they are added as
//! four groups of eight, (a0 + a1) + (a2 + a3), and the eight that remain as ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)).
//! Inputs are the rows of a matrix one after the other, each padded to whole lanes; i counts the padding.

use crate::elementary::elu;
use crate::error::{KernelError, check};
use crate::isa::{Isa, Task};
use crate::lanes::{LANES, Lanes};

/// What follows a dense layer's sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    /// Nothing.
    #[default]
    Identity,
    /// max(x, 0).
    Relu,
    /// x for x > 0, else e^x - 1.
    Elu,
}

/// A dense layer over (segments, channels) inputs.
#[derive(Clone, Debug)]
pub struct Dense {
    inputs: usize,
    outputs: usize,
    /// Lanes of one output's weights.
    stride: usize,
    /// (O, lanes of segments x channels).
    weight: Vec<Lanes>,
    bias: Vec<f32>,
    activation: Activation,
}

impl Dense {
    /// A layer that reads `segments` rows of `channels` values and writes `outputs` values. `weight` is (outputs,
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
        let inputs = segments * channels;
        for (what, found) in [("inputs", inputs), ("outputs", outputs)] {
            if found == 0 {
                return Err(KernelError::Size { what, expected: "at least 1", found });
            }
        }
        check("weight", weight, inputs * outputs)?;
        let bias = bias.map_or_else(|| vec![0.0; outputs], <[f32]>::to_vec);
        check("bias", &bias, outputs)?;
        let stride = segments * Lanes::count(channels);
        let weight = weight.chunks_exact(channels).flat_map(Lanes::pack).collect();
        Ok(Self { inputs, outputs, stride, weight, bias, activation })
    }

    /// Values read.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Values written.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Computes every output. `inputs` is what [`crate::Matrix::lanes`] gives; `out` is packed in lanes, its padding
    /// becomes zero.
    ///
    /// # Panics
    /// If a slice does not have the sizes of this layer.
    pub fn run(&self, isa: Isa, inputs: &[Lanes], out: &mut [Lanes]) {
        assert_eq!(inputs.len(), self.stride, "the input must have the layer's size");
        assert_eq!(out.len(), Lanes::count(self.outputs), "the output must have the layer's size");
        isa.run(Run { dense: self, inputs, out });
    }
}

struct Run<'a> {
    dense: &'a Dense,
    inputs: &'a [Lanes],
    out: &'a mut [Lanes],
}

impl Task for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { dense, inputs, out } = self;
        out.fill(Lanes::ZERO);
        for (o, weight) in dense.weight.chunks_exact(dense.stride).enumerate() {
            let y = dot(inputs, weight) + dense.bias[o];
            out[o / LANES].0[o % LANES] = match dense.activation {
                Activation::Identity => y,
                Activation::Relu => {
                    if y > 0.0 {
                        y
                    } else {
                        0.0
                    }
                }
                Activation::Elu => elu(y),
            };
        }
    }
}

/// The sum of products in the order of the module's header.
#[inline(always)]
fn dot(a: &[Lanes], b: &[Lanes]) -> f32 {
    let mut acc = [Lanes::ZERO; 4];
    let (mut fours_a, mut fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    for (a, b) in (&mut fours_a).zip(&mut fours_b) {
        for i in 0..4 {
            acc[i] = acc[i] + a[i] * b[i];
        }
    }
    for (acc, (&a, &b)) in acc.iter_mut().zip(fours_a.remainder().iter().zip(fours_b.remainder())) {
        *acc = *acc + a * b;
    }
    total(&acc)
}

/// The last sums of a dot product. Not inlined: seen together with the loop, the compiler splits the loop's
/// accumulators into the pieces that are added here, and the loop takes twice as long.
#[inline(never)]
fn total(acc: &[Lanes; 4]) -> f32 {
    let v = ((acc[0] + acc[1]) + (acc[2] + acc[3])).0;
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}
