//! The convolution of a block: the kernels, and the one place where engine and batch choose one.
//!
//! Each property of a convolution that they need is a method of [`GraphConvolution`] with a `match`
//! over its variants. The choice is made once for a group of rows.

use meissner_kernels::{
    GraphRow, Isa, KernelError, Lanes, Matrix, PointNetConv, PointNetParts, PointNetScratch, SplineConv,
    SplineParts, SplineScratch,
};

use crate::fingerprint::Fingerprint;
use crate::memory::Memory;

/// A graph convolution with its activation, batch norm and skip addition.
#[derive(Clone, Debug)]
pub enum GraphConvolution {
    /// Spline convolution, mean over the in-edges, then ELU.
    Spline(SplineConv),
    /// `PointNet` convolution, maximum over the in-edges and the row itself, then `ReLU`.
    PointNet(PointNetConv),
}

impl From<SplineConv> for GraphConvolution {
    fn from(conv: SplineConv) -> Self {
        Self::Spline(conv)
    }
}

impl From<PointNetConv> for GraphConvolution {
    fn from(conv: PointNetConv) -> Self {
        Self::PointNet(conv)
    }
}

/// Edge data that a level's blocks read besides source and attributes, stored with the edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EdgeReads {
    pub(crate) basis: bool,
    pub(crate) offsets: bool,
}

impl EdgeReads {
    pub(crate) fn or(self, other: Self) -> Self {
        Self { basis: self.basis || other.basis, offsets: self.offsets || other.offsets }
    }
}

/// Working space of [`GraphConvolution::rows`]; grows to the largest rows seen and is reused.
#[derive(Clone, Debug, Default)]
pub struct ConvolutionScratch {
    spline: SplineScratch,
    pointnet: PointNetScratch,
}

impl ConvolutionScratch {
    /// Working space for all of `convs` and at most `most` in-edges: nothing is allocated later.
    pub(crate) fn new<'a>(
        convs: impl Iterator<Item = &'a GraphConvolution> + Clone,
        most: usize,
        memory: &mut Memory,
    ) -> Self {
        let spline = convs.clone().filter_map(GraphConvolution::spline);
        let pointnet = convs.filter_map(GraphConvolution::pointnet);
        let bytes = SplineScratch::bytes(spline.clone(), most) + PointNetScratch::bytes(pointnet.clone());
        memory.add(bytes as u128);
        if memory.counts_only {
            return Self::default();
        }
        Self { spline: SplineScratch::new(spline, most), pointnet: PointNetScratch::new(pointnet) }
    }
}

impl GraphConvolution {
    /// Best number of rows to compute together.
    pub const GROUP: usize = SplineConv::GROUP;

    /// The spline convolution, if it is one.
    pub fn spline(&self) -> Option<&SplineConv> {
        if let Self::Spline(conv) = self { Some(conv) } else { None }
    }

    /// The `PointNet` convolution, if it is one.
    pub fn pointnet(&self) -> Option<&PointNetConv> {
        if let Self::PointNet(conv) = self { Some(conv) } else { None }
    }

    /// Input channels.
    pub fn inputs(&self) -> usize {
        match self {
            Self::Spline(conv) => conv.inputs(),
            Self::PointNet(conv) => conv.inputs(),
        }
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        match self {
            Self::Spline(conv) => conv.outputs(),
            Self::PointNet(conv) => conv.outputs(),
        }
    }

    /// Whether a row reads its own input as well as that of its in-edges.
    pub fn reads_itself(&self) -> bool {
        match self {
            Self::Spline(conv) => conv.has_root(),
            Self::PointNet(_) => true,
        }
    }

    pub(crate) fn edge_reads(&self) -> EdgeReads {
        match self {
            Self::Spline(conv) => EdgeReads { basis: conv.reads_basis(), offsets: false },
            Self::PointNet(_) => EdgeReads { basis: false, offsets: true },
        }
    }

    /// Multiply-adds of one row with `degree` in-edges.
    pub fn multiply_adds(&self, degree: usize) -> usize {
        match self {
            Self::Spline(conv) => conv.multiply_adds(degree),
            Self::PointNet(conv) => conv.multiply_adds(degree),
        }
    }

    /// Computes rows, each as if it were alone; fastest in groups of [`Self::GROUP`].
    ///
    /// `features` is (rows, inputs); `out` holds the rows' outputs in lanes, row after row.
    ///
    /// # Panics
    /// If a row or a slice does not have the sizes of this convolution.
    #[inline]
    pub fn rows(
        &self,
        isa: Isa,
        features: &Matrix,
        rows: &[GraphRow<'_>],
        scratch: &mut ConvolutionScratch,
        out: &mut [Lanes],
    ) {
        match self {
            Self::Spline(conv) => conv.rows(isa, features, rows, &mut scratch.spline, out),
            Self::PointNet(conv) => conv.rows(isa, features, rows, &mut scratch.pointnet, out),
        }
    }

    /// Scales weights by `weights`, and biases and batch norm's shifts by `added`.
    ///
    /// # Errors
    /// [`KernelError::NotFinite`] if a product overflows.
    pub fn scaled(&self, weights: f32, added: f32) -> Result<Self, KernelError> {
        let scaled = |values: Vec<f32>, factor: f32| values.into_iter().map(|v| v * factor).collect();
        let norm =
            |norm: Option<(Vec<f32>, Vec<f32>)>| norm.map(|(scale, shift)| (scale, scaled(shift, added)));
        Ok(match self {
            Self::Spline(conv) => {
                let parts = conv.parts();
                Self::Spline(SplineConv::new(&SplineParts {
                    weight: scaled(parts.weight, weights),
                    root: parts.root.map(|root| scaled(root, weights)),
                    bias: parts.bias.map(|bias| scaled(bias, added)),
                    norm: norm(parts.norm),
                    ..parts
                })?)
            }
            Self::PointNet(conv) => {
                let parts = conv.parts();
                Self::PointNet(PointNetConv::new(&PointNetParts {
                    weight: scaled(parts.weight, weights),
                    bias: scaled(parts.bias, added),
                    norm: norm(parts.norm),
                    ..parts
                })?)
            }
        })
    }

    pub(crate) fn fingerprint(&self, to: &mut Fingerprint) {
        // The third word is the kind; for a spline convolution, whether there is an ELU.
        let (sizes, parameters, norm) = match self {
            Self::Spline(conv) => {
                let SplineParts { inputs, outputs, kernel: [x, y, t], weight, root, bias, norm, elu } =
                    conv.parts();
                let parameters = vec![weight, root.unwrap_or_default(), bias.unwrap_or_default()];
                (vec![inputs, outputs, usize::from(elu), x, y, t], parameters, norm)
            }
            Self::PointNet(conv) => {
                let PointNetParts { inputs, outputs, weight, bias, norm } = conv.parts();
                (vec![inputs, outputs, 2], vec![weight, bias], norm)
            }
        };
        let (scale, shift) = norm.unwrap_or_default();
        to.sizes(sizes);
        parameters.iter().chain([&scale, &shift]).for_each(|values| to.values(values));
    }
}
