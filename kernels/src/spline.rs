//! Spline convolution of one row: open B-splines of degree 1, mean over in-edges, ELU, batch norm,
//! skip (`SplineCNN`, Fey et al. 2018, Eq. 2 and 5; the contact-angle paper's block).
//!
//! For a row with in-edges e = 1..n from rows j(e), with attributes u(e) in [0, 1]:
//!
//! ```text
//! v_d    = u_d (k_d - 1), i_d = min(floor(v_d), k_d - 2), f_d = v_d - i_d    if k_d > 1
//! B(e,s) = (w_x w_y) w_t, w_d = 1 - f_d at i_d, f_d at i_d + 1;     s = i_x + k_x (i_y + k_y i_t)
//! S(s,c) = sum over e of B(e,s) x(j(e), c)                          in the order of edges
//! a(p,o) = sum over touched s, then c, ascending, of S(s,c) W(s,c,o), (s C + c) mod 4 = p
//! m(o)   = ((a(0,o) + a(1,o)) + (a(2,o) + a(3,o))) (1 / n)          0 without in-edges
//! r(o)   = the same four partial sums over c of x(i,c) R(c,o)       if there is a root weight
//! y(o)   = ELU((m + r) + bias) scale + shift  (+ skip)
//! ```
//!
//! Every product that is added, in S, a, r and y, is rounded once with its sum.
//!
//! Summing inputs per kernel slot before multiplying by weights costs n s C + s C O multiply-adds
//! instead of n s C O. Four partial sums keep the adders busy; their order is part of the contract.

mod gather;
mod run;

use crate::error::{KernelError, MAX_CHANNELS, check, check_channels};
use crate::lanes::{LANES, Lanes};
use crate::packed::{Affine, Packed};

pub(crate) use gather::locate;
pub use gather::{SplineScratch, spline_basis};

/// Parameters of a spline block in `PyTorch`'s layouts.
#[derive(Clone, Debug, Default)]
pub struct SplineParts {
    /// C, input channels.
    pub inputs: usize,
    /// O, output channels.
    pub outputs: usize,
    /// Kernel size along x, y and t; with size 1 an axis is ignored.
    pub kernel: [usize; 3],
    /// (slot, C, O), slot = `i_x` + `k_x` (`i_y` + `k_y` `i_t`).
    pub weight: Vec<f32>,
    /// (O, C), as in a linear layer.
    pub root: Option<Vec<f32>>,
    /// (O).
    pub bias: Option<Vec<f32>>,
    /// Batch norm with running statistics, folded into a factor (O) and a shift (O).
    pub norm: Option<(Vec<f32>, Vec<f32>)>,
    /// Whether ELU follows the convolution.
    pub elu: bool,
}

/// A spline block, ready to run.
#[derive(Clone, Debug)]
pub struct SplineConv {
    inputs: usize,
    outputs: usize,
    kernel: [usize; 3],
    /// (slot C, O).
    weight: Packed,
    /// (C, O).
    root: Option<Packed>,
    affine: Affine,
    elu: bool,
}

impl SplineConv {
    /// Best number of rows to compute together.
    pub const GROUP: usize = 8;
    /// Maximum number of input channels, below a lane, whose sums have no gap: polarity and place.
    /// `group` has a case for each number.
    const FEW: usize = 4;
    /// Largest number of input or output channels.
    pub const MAX_CHANNELS: usize = MAX_CHANNELS;
    /// Largest kernel size of an axis.
    pub const MAX_KERNEL: usize = 64;
    /// Largest product of kernel slots and input channels: the number of sums of one row.
    pub const MAX_SUMS: usize = 1 << 22;

    /// Checks and packs `parts`.
    ///
    /// # Errors
    /// A size of zero or beyond bounds, a tensor of the wrong length, or a value not finite.
    pub fn new(parts: &SplineParts) -> Result<Self, KernelError> {
        let SplineParts { inputs, outputs, kernel, .. } = *parts;
        check_channels(&[inputs], outputs)?;
        if let Some(&size) = kernel.iter().find(|&&k| k == 0 || k > Self::MAX_KERNEL) {
            return Err(KernelError::Size {
                what: "kernel size",
                expected: "1 to 64 on each axis",
                found: size,
            });
        }
        let slots: usize = kernel.iter().product();
        if slots * inputs > Self::MAX_SUMS {
            let expected = "at most 4194304 kernel slots times input channels";
            return Err(KernelError::Size { what: "kernel", expected, found: slots * inputs });
        }
        check("weight", &parts.weight, slots * inputs * outputs)?;
        let weight = Packed::new(&parts.weight, outputs);
        if let Some(root) = &parts.root {
            check("root weight", root, outputs * inputs)?;
        }
        let root = parts.root.as_ref().map(|root| Packed::transposed(root, outputs));
        let zeros = vec![0.0; outputs];
        let bias = parts.bias.as_ref().unwrap_or(&zeros);
        let affine = Affine::new(bias, parts.norm.as_ref(), outputs)?;
        Ok(Self { inputs, outputs, kernel, weight, root, affine, elu: parts.elu })
    }

    /// The parameters in `PyTorch`'s layouts: a block made from them computes the same bits.
    /// Without a bias or norm, zeros or an identity norm. O(parameters).
    pub fn parts(&self) -> SplineParts {
        let (bias, norm) = self.affine.unpacked(self.outputs);
        SplineParts {
            inputs: self.inputs,
            outputs: self.outputs,
            kernel: self.kernel,
            weight: self.weight.unpacked(self.outputs),
            root: self.root.as_ref().map(|root| root.untransposed(self.outputs)),
            bias: Some(bias),
            norm: Some(norm),
            elu: self.elu,
        }
    }

    /// C, input channels.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// O, output channels.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Kernel size along x, y and t.
    pub fn kernel(&self) -> [usize; 3] {
        self.kernel
    }

    /// Number of kernel slots, the product of the kernel sizes.
    pub fn slots(&self) -> usize {
        self.kernel.iter().product()
    }

    /// Whether the row itself is read through a root weight.
    pub fn has_root(&self) -> bool {
        self.root.is_some()
    }

    /// Whether a stored basis of a row's in-edges saves work.
    pub fn reads_basis(&self) -> bool {
        self.is_flat() && self.inputs >= LANES
    }

    /// Multiply-adds of one row with `degree` in-edges.
    pub fn multiply_adds(&self, degree: usize) -> usize {
        spline_multiply_adds(self.kernel, self.inputs, self.outputs, self.has_root(), degree)
    }

    /// Lanes of sums held at once: those of a group of rows, or of one row with gaps.
    fn sums(&self) -> usize {
        if self.is_flat() {
            // Eight slots of each channel.
            Self::GROUP * self.inputs
        } else {
            self.slots() * Lanes::count(self.inputs)
        }
    }

    /// Whether the sums of a row are contiguous, with every slot touched.
    fn is_flat(&self) -> bool {
        self.kernel == [2; 3] && (self.inputs <= Self::FEW || self.inputs.is_multiple_of(LANES))
    }
}

/// Multiply-adds of a row of a spline block with `degree` in-edges: sums per slot, weights, root.
/// Saturates.
pub fn spline_multiply_adds(
    kernel: [usize; 3],
    inputs: usize,
    outputs: usize,
    root: bool,
    degree: usize,
) -> usize {
    let corners: usize = kernel.iter().map(|&k| k.min(2)).product();
    let slots = kernel.iter().fold(1, |slots: usize, &k| slots.saturating_mul(k));
    let summed = degree.saturating_mul(corners);
    let weighted = slots.min(summed).saturating_add(usize::from(root)).saturating_mul(outputs);
    summed.saturating_add(weighted).saturating_mul(inputs)
}
