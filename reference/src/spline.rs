//! A spline block in f64 (`SplineCNN`, Fey et al. 2018, Eq. 2 and 5): the basis of degree 1 is a tensor product of hat
//! functions, and every in-edge takes part with all slots of the kernel.

use meissner_kernels::{SplineConv, SplineParts};

use crate::activation::elu;

/// Batch norm with running statistics, as it was trained: one value a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchNorm {
    /// Factor behind the normalisation.
    pub gamma: Vec<f32>,
    /// What is added behind it.
    pub beta: Vec<f32>,
    /// Running mean.
    pub mean: Vec<f32>,
    /// Running variance.
    pub variance: Vec<f32>,
    /// What is added to the variance.
    pub epsilon: f64,
}

/// What follows ELU.
#[derive(Clone, Debug, PartialEq)]
pub enum Norm {
    /// A factor and what is added, as the engine has them.
    Folded(Vec<f32>, Vec<f32>),
    /// (x - mean) / sqrt(variance + epsilon) gamma + beta.
    Full(BatchNorm),
}

impl Norm {
    fn of(&self, x: f64, o: usize) -> f64 {
        match self {
            Self::Folded(scale, shift) => x * f64::from(scale[o]) + f64::from(shift[o]),
            Self::Full(norm) => {
                let [gamma, beta, mean, variance] =
                    [&norm.gamma, &norm.beta, &norm.mean, &norm.variance].map(|v| f64::from(v[o]));
                (x - mean) / (variance + norm.epsilon).sqrt() * gamma + beta
            }
        }
    }
}

/// A spline block.
#[derive(Clone, Debug)]
pub(crate) struct Spline {
    parts: SplineParts,
    pub(crate) norm: Norm,
}

/// An in-edge: the row that is read, and the attribute along x, y and t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    pub(crate) row: usize,
    pub(crate) u: [f64; 3],
}

/// Edge attribute of a coordinate difference `p_j - p_i`: clamp(difference / (2 scale) + 0.5, 0, 1).
pub(crate) fn attribute(difference: f64, scale: f32) -> f64 {
    (difference / (2.0 * f64::from(scale)) + 0.5).clamp(0.0, 1.0)
}

/// Weight of place `i` of `size` on one axis at attribute `u`: a hat of width 1 to each side.
fn hat(u: f64, i: usize, size: usize) -> f64 {
    if size == 1 { 1.0 } else { (1.0 - (u * (size - 1) as f64 - i as f64).abs()).max(0.0) }
}

impl Spline {
    pub(crate) fn new(conv: &SplineConv) -> Self {
        let mut parts = conv.parts();
        let (scale, shift) = parts.norm.take().unwrap_or_default();
        Self { parts, norm: Norm::Folded(scale, shift) }
    }

    /// Row `own` of the block over `features`, plus `skip`.
    pub(crate) fn row(
        &self,
        features: &[Vec<f64>],
        own: usize,
        edges: &[Edge],
        skip: Option<&[f64]>,
    ) -> Vec<f64> {
        let SplineParts { inputs, outputs, kernel: [kx, ky, kt], .. } = self.parts;
        let mut out = vec![0.0; outputs];
        for edge in edges {
            for slot in 0..kx * ky * kt {
                let (ix, iy, it) = (slot % kx, slot / kx % ky, slot / kx / ky);
                let basis = hat(edge.u[0], ix, kx) * hat(edge.u[1], iy, ky) * hat(edge.u[2], it, kt);
                if basis == 0.0 {
                    continue;
                }
                for (c, value) in features[edge.row].iter().enumerate() {
                    let x = basis * value;
                    let weights = &self.parts.weight[(slot * inputs + c) * outputs..][..outputs];
                    out.iter_mut().zip(weights).for_each(|(out, &w)| *out += x * f64::from(w));
                }
            }
        }
        for (o, y) in out.iter_mut().enumerate() {
            if !edges.is_empty() {
                *y /= edges.len() as f64;
            }
            if let Some(root) = &self.parts.root {
                let weights = &root[o * inputs..][..inputs];
                *y += features[own].iter().zip(weights).map(|(x, &w)| x * f64::from(w)).sum::<f64>();
            }
            *y += self.parts.bias.as_ref().map_or(0.0, |bias| f64::from(bias[o]));
            if self.parts.elu {
                *y = elu(*y);
            }
            *y = self.norm.of(*y, o) + skip.map_or(0.0, |skip| skip[o]);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(kernel: [usize; 3], weight: Vec<f32>, elu: bool) -> Spline {
        let parts = SplineParts {
            inputs: 1,
            outputs: 1,
            kernel,
            weight,
            root: None,
            bias: Some(vec![0.25]),
            norm: Some((vec![2.0], vec![1.0])),
            elu,
        };
        Spline::new(&SplineConv::new(&parts).expect("sizes fit"))
    }

    #[test]
    fn a_row_of_two_edges_is_what_a_hand_computes() {
        let spline = block([2, 1, 1], vec![1.0, 3.0], false);
        let edges = [Edge { row: 0, u: [0.25, 0.0, 0.0] }, Edge { row: 1, u: [1.0, 0.0, 0.0] }];
        // (2 (0.75 + 0.25 3) + 4 3) / 2 + 0.25 = 7.75, times 2, plus 1, plus the skip.
        let row = spline.row(&[vec![2.0], vec![4.0]], 0, &edges, Some(&[0.5]));
        assert_eq!(row, [17.0]);
    }

    #[test]
    fn a_row_without_edges_is_its_bias() {
        assert_eq!(block([2, 1, 1], vec![1.0, 3.0], false).row(&[vec![2.0]], 0, &[], None), [1.5]);
    }

    #[test]
    fn the_hats_of_an_axis_sum_to_one() {
        for size in 1..6 {
            for u in [0.0, 0.1, 0.25, 0.5, 0.99, 1.0] {
                let sum: f64 = (0..size).map(|i| hat(u, i, size)).sum();
                assert!((sum - 1.0).abs() < 1e-15, "size {size} at {u}: {sum}");
            }
        }
    }

    #[test]
    fn unfolded_batch_norm_is_the_folded_one() {
        let mut spline = block([1, 1, 1], vec![1.0], true);
        let edge = Edge { row: 0, u: [0.5; 3] };
        let folded = spline.row(&[vec![0.75]], 0, &[edge], None);
        let norm = |gamma, beta, mean, variance| BatchNorm {
            gamma: vec![gamma],
            beta: vec![beta],
            mean: vec![mean],
            variance: vec![variance],
            epsilon: 0.0,
        };
        // (x - 1) / sqrt(0.25) + 3 = 2 x + 1.
        spline.norm = Norm::Full(norm(1.0, 3.0, 1.0, 0.25));
        assert_eq!(spline.row(&[vec![0.75]], 0, &[edge], None), folded);
        assert_eq!(folded, [3.0]);
    }
}
