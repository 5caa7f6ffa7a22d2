//! The convolution of a block: the choices of a description, and their consequences.
//!
//! | `conv` | computes, for row i over its in-edges j | keys of its own |
//! |---|---|---|
//! | `spline` | mean of `x_j` times its spline weights, ELU | `kernel`, `root`, `bias`, `elu` |
//! | `pointnet` | maximum, i included, of `W [x_j, (p_j - p_i) / scale] + b`, `ReLU` | none |
//!
//! The word as a layer's `kind` is short for `kind = "block"` with this `conv`.
//! `docs/weights-from-pytorch.md` lists the tensors of each.
//!
//! A new convolution is a variant of [`ConvolutionKind`] and a row of `KINDS`.

use std::ops::RangeInclusive;

use meissner_engine::GraphConvolution;
use meissner_kernels::{
    KernelError, PointNetConv, PointNetParts, SplineConv, SplineParts, pointnet_multiply_adds,
    spline_multiply_adds,
};
use serde::Serialize;
use toml::de::DeValue;

use super::problem::ProblemKind;
use super::table::{Table, integer};
use super::tensors::{Listing, MAX_TENSOR, Values};

/// The computation of a block before batch norm and skip addition.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum ConvolutionKind {
    /// Spline convolution.
    Spline {
        /// Kernel size along x, y and t; an axis with 1 is ignored.
        kernel: [usize; 3],
        /// Whether the row itself is read through a root weight.
        root: bool,
        /// Whether there is a bias.
        bias: bool,
        /// Whether ELU follows the convolution.
        elu: bool,
    },
    /// `PointNet` convolution, with `ReLU`.
    PointNet,
}

/// Reads the keys that only one convolution has; a reported key gets a substitute value.
type Keys = fn(&mut Table<'_, '_>) -> ConvolutionKind;

/// The words of `conv`, with the functions that read their keys.
pub(super) const KINDS: [(&str, Keys); 2] = [(SPLINE, spline), ("pointnet", |_| ConvolutionKind::PointNet)];

const SPLINE: &str = "spline";

/// The sizes that the kernels accept.
const KERNELS: RangeInclusive<i64> = 1..=SplineConv::MAX_KERNEL as i64;

fn spline(table: &mut Table<'_, '_>) -> ConvolutionKind {
    let expected = "a kernel size from 1 to 64, or two or three of them along x, y (and t)";
    let kernel = table.required("kernel", expected, kernel);
    let (root, bias) = (table.boolean("root", false), table.boolean("bias", false));
    let elu = table.boolean("elu", true);
    let kernel = kernel.map_or([1; 3], |given| given.value);
    ConvolutionKind::Spline { kernel, root, bias, elu }
}

fn kernel(value: &DeValue<'_>) -> Option<[usize; 3]> {
    let size = |v: &DeValue<'_>| integer(v).filter(|v| KERNELS.contains(v)).map(|v| v as usize);
    match value {
        DeValue::Array(sizes) => {
            let sizes: Vec<usize> = sizes.iter().map(|v| size(v.get_ref())).collect::<Option<_>>()?;
            match sizes[..] {
                [x, y] => Some([x, y, 1]),
                [x, y, t] => Some([x, y, t]),
                _ => None,
            }
        }
        _ => size(value).map(|k| [k; 3]),
    }
}

impl ConvolutionKind {
    /// Its word in a file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Spline { .. } => SPLINE,
            Self::PointNet => "pointnet",
        }
    }

    /// Its options after its word, in short form; the presence of batch norm is one of them.
    pub(super) fn options(&self, norm: bool) -> String {
        let given = |options: &[(&str, bool)]| -> String {
            options.iter().filter(|(_, given)| *given).map(|(word, _)| *word).collect()
        };
        match self {
            Self::Spline { kernel: [x, y, t], root, bias, elu } => {
                let options = [(" root", *root), (" bias", *bias), (" no norm", !norm), (" no elu", !*elu)];
                format!(" {x}x{y}x{t}{}", given(&options))
            }
            Self::PointNet => given(&[(" no norm", !norm)]),
        }
    }

    /// The problem if the sizes from `inputs` to `outputs` channels are too large.
    pub(super) fn too_large(&self, inputs: usize, outputs: usize) -> Option<ProblemKind> {
        let (fits, key, expected, found) = match self {
            Self::Spline { kernel, .. } => {
                let (slots, sums) = (kernel.iter().product::<usize>(), SplineConv::MAX_SUMS);
                let fits = slots * inputs <= sums && slots * inputs * outputs <= MAX_TENSOR;
                let expected =
                    format!("at most {sums} kernel slots times input channels, and {MAX_TENSOR} weights");
                (fits, "kernel", expected, format!("{slots} slots of {inputs} x {outputs} channels"))
            }
            Self::PointNet => {
                let (fits, found) =
                    ((inputs + 3) * outputs <= MAX_TENSOR, format!("{} x {outputs}", inputs + 3));
                (fits, "channels", format!("at most {MAX_TENSOR} weights"), found)
            }
        };
        (!fits).then(|| ProblemKind::value(key, expected, found))
    }

    pub(super) fn multiply_adds(&self, inputs: usize, outputs: usize, in_edges: usize) -> usize {
        match *self {
            Self::Spline { kernel, root, .. } => {
                spline_multiply_adds(kernel, inputs, outputs, root, in_edges)
            }
            Self::PointNet => pointnet_multiply_adds(inputs, outputs, in_edges),
        }
    }

    /// Distance of slots that differ by 1 along x, y and t; `None` without a spline kernel.
    pub(crate) fn slot_strides(&self) -> Option<[usize; 3]> {
        match self {
            Self::Spline { kernel: [x, y, _], .. } => Some([1, *x, x * y]),
            Self::PointNet => None,
        }
    }

    /// Whether it reads offsets, and not only attributes, of in-edges.
    pub(crate) fn reads_offsets(&self) -> bool {
        matches!(self, Self::PointNet)
    }

    /// Adds its tensors from `c` to `o` channels to `tensors`, in the order of use. Returns the
    /// running variance expected after it.
    pub(super) fn list(&self, tensors: &mut Listing<'_>, c: usize, o: usize) -> f64 {
        const BIAS: &str = "bias: (output channel)";
        match *self {
            Self::Spline { kernel, root, bias, .. } => {
                let slots = kernel.iter().product();
                let meaning = "spline kernel: (slot, input channel, output channel)";
                tensors.weight("conv.weight", &[slots, c, o], c, meaning);
                if root {
                    let meaning = "what the row itself is read through: (output channel, input channel)";
                    tensors.weight("conv.lin.weight", &[o, c], c, meaning);
                }
                if bias {
                    tensors.shift("conv.bias", &[o], BIAS);
                }
                // Averaging over edges shrinks the variance: running variances are drawn small.
                0.25
            }
            Self::PointNet => {
                let meaning = "PointNet's linear layer: (output channel, input channel, then the offset along x, y and t)";
                tensors.weight("conv.weight", &[o, c + 3], c + 3, meaning);
                tensors.shift("conv.bias", &[o], BIAS);
                // The maximum over edges exceeds each: running variances are drawn large.
                4.0
            }
        }
    }

    /// The convolution from `inputs` to `outputs` channels with `values`, batch norm's included.
    pub(super) fn build(
        &self,
        (inputs, outputs): (usize, usize),
        values: &mut Values<'_>,
        norm: Option<(Vec<f32>, Vec<f32>)>,
    ) -> Result<GraphConvolution, KernelError> {
        let weight = values.take().to_vec();
        Ok(match *self {
            Self::Spline { kernel, root, bias, elu } => {
                let (root, bias) = (values.take_if(root), values.take_if(bias));
                let parts = SplineParts { inputs, outputs, kernel, weight, root, bias, norm, elu };
                SplineConv::new(&parts)?.into()
            }
            Self::PointNet => {
                let bias = values.take().to_vec();
                PointNetConv::new(&PointNetParts { inputs, outputs, weight, bias, norm })?.into()
            }
        })
    }
}
