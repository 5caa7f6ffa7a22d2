//! The convolutions of blocks in f64, with batch norm and skip.
//!
//! Spline (`SplineCNN`, Fey et al. 2018, Eq. 2 and 5): the basis is a tensor product of hat
//! functions, and every in-edge contributes to all slots. `PointNet` (`PointNet++`, Qi et al.
//! 2017): the maximum of a linear layer over channels and offset of every in-edge and of the row
//! itself.

use meissner_engine::GraphConvolution;
use meissner_kernels::{PointNetParts, SplineParts};

use crate::frames::elu;

/// Batch norm with running statistics, as trained: one value per channel.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchNorm {
    /// Factor after the normalisation.
    pub gamma: Vec<f32>,
    /// Shift after the factor.
    pub beta: Vec<f32>,
    /// Running mean.
    pub mean: Vec<f32>,
    /// Running variance.
    pub variance: Vec<f32>,
    /// Constant added to the variance.
    pub epsilon: f64,
}

impl BatchNorm {
    /// The norm that multiplies by `scale` and adds `shift`, exactly.
    fn folded((scale, shift): (Vec<f32>, Vec<f32>)) -> Self {
        let (mean, variance) = (vec![0.0; scale.len()], vec![1.0; scale.len()]);
        Self { gamma: scale, beta: shift, mean, variance, epsilon: 0.0 }
    }

    /// (x - mean) / sqrt(variance + epsilon) gamma + beta, for channel `o`.
    fn of(&self, x: f64, o: usize) -> f64 {
        let [gamma, beta, mean, variance] =
            [&self.gamma, &self.beta, &self.mean, &self.variance].map(|v| f64::from(v[o]));
        (x - mean) / (variance + self.epsilon).sqrt() * gamma + beta
    }
}

/// A convolution with batch norm and skip.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    kind: Kind,
    /// Batch norm after the activation.
    pub(crate) norm: BatchNorm,
}

/// The part before batch norm.
#[derive(Clone, Debug)]
enum Kind {
    Spline(SplineParts),
    PointNet(PointNetParts),
}

/// An in-edge: the source row, and (`p_j` - `p_i`) / s along x, y and t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    pub(crate) row: usize,
    pub(crate) offset: [f64; 3],
}

impl Edge {
    /// An in-edge from `row`, at a distance of `difference`, on a level of scale `scale`.
    pub(crate) fn new(row: usize, difference: [f64; 3], scale: f32) -> Self {
        Self { row, offset: difference.map(|d| d / f64::from(scale)) }
    }

    /// Edge attribute: clamp((`p_j` - `p_i`) / (2 s) + 0.5, 0, 1).
    fn attributes(&self) -> [f64; 3] {
        self.offset.map(|offset| (offset / 2.0 + 0.5).clamp(0.0, 1.0))
    }
}

/// Weight of slot `i` of `size` on one axis at attribute `u`: a hat of width 1 to each side.
pub(crate) fn hat(u: f64, i: usize, size: usize) -> f64 {
    if size == 1 { 1.0 } else { (1.0 - (u * (size - 1) as f64 - i as f64).abs()).max(0.0) }
}

impl Convolution {
    /// The convolution with the parameters of `conv`.
    pub(crate) fn new(conv: &GraphConvolution) -> Self {
        let kind = match conv {
            GraphConvolution::Spline(conv) => Kind::Spline(conv.parts()),
            GraphConvolution::PointNet(conv) => Kind::PointNet(conv.parts()),
        };
        let (Kind::Spline(SplineParts { norm, .. }) | Kind::PointNet(PointNetParts { norm, .. })) = &kind;
        let norm = BatchNorm::folded(norm.clone().unwrap_or_default());
        Self { kind, norm }
    }

    /// Row `own` of the block over `features`, plus `skip`.
    pub(crate) fn row(
        &self,
        features: &[Vec<f64>],
        own: usize,
        edges: &[Edge],
        skip: Option<&[f64]>,
    ) -> Vec<f64> {
        let mut out = match &self.kind {
            Kind::Spline(parts) => spline(parts, features, own, edges),
            Kind::PointNet(parts) => pointnet(parts, features, own, edges),
        };
        for (o, y) in out.iter_mut().enumerate() {
            *y = self.norm.of(*y, o) + skip.map_or(0.0, |skip| skip[o]);
        }
        out
    }
}

/// Mean over the in-edges, root weight, bias, ELU.
fn spline(parts: &SplineParts, features: &[Vec<f64>], own: usize, edges: &[Edge]) -> Vec<f64> {
    let SplineParts { inputs, outputs, kernel: [kx, ky, kt], .. } = *parts;
    let mut out = vec![0.0; outputs];
    for edge in edges {
        let u = edge.attributes();
        for slot in 0..kx * ky * kt {
            let (ix, iy, it) = (slot % kx, slot / kx % ky, slot / kx / ky);
            let basis = hat(u[0], ix, kx) * hat(u[1], iy, ky) * hat(u[2], it, kt);
            if basis == 0.0 {
                continue;
            }
            for (c, value) in features[edge.row].iter().enumerate() {
                let x = basis * value;
                let weights = &parts.weight[(slot * inputs + c) * outputs..][..outputs];
                out.iter_mut().zip(weights).for_each(|(out, &w)| *out += x * f64::from(w));
            }
        }
    }
    for (o, y) in out.iter_mut().enumerate() {
        if !edges.is_empty() {
            *y /= edges.len() as f64;
        }
        if let Some(root) = &parts.root {
            let weights = &root[o * inputs..][..inputs];
            *y += features[own].iter().zip(weights).map(|(x, &w)| x * f64::from(w)).sum::<f64>();
        }
        *y += parts.bias.as_ref().map_or(0.0, |bias| f64::from(bias[o]));
        if parts.elu {
            *y = elu(*y);
        }
    }
    out
}

/// Maximum over the in-edges and the row itself of a linear layer, `ReLU`.
fn pointnet(parts: &PointNetParts, features: &[Vec<f64>], own: usize, edges: &[Edge]) -> Vec<f64> {
    let itself = Edge { row: own, offset: [0.0; 3] };
    let messages: Vec<Vec<f64>> = std::iter::once(&itself)
        .chain(edges)
        .map(|edge| {
            let read: Vec<f64> = features[edge.row].iter().chain(&edge.offset).copied().collect();
            let message = |(weights, &bias): (&[f32], &f32)| {
                read.iter().zip(weights).map(|(x, &w)| x * f64::from(w)).sum::<f64>() + f64::from(bias)
            };
            parts.weight.chunks_exact(read.len()).zip(&parts.bias).map(message).collect()
        })
        .collect();
    let most = |o: usize| messages.iter().fold(0.0, |most: f64, message| most.max(message[o]));
    (0..parts.outputs).map(most).collect()
}
