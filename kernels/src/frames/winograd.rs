//! 3 x 3 convolution with fewer products (Winograd 1980; Lavin and Gray 2016): M x M outputs are
//! A^t [ sum over i of (G g(i) G^t) (B^t d(i) B) ] A, d(i) the (M + 2) x (M + 2) inputs.
//!
//! G g G^t is computed in f64 and rounded once, when the layer is made. Order of the other
//! operations: [`Transform`] for B and A, columns of a tile before rows; for each of (M + 2)^2
//! places a chain from +0 over maps and channels, ascending, each product rounded once with its
//! sum; then the bias. Tiles lie on a grid from the map's first pixel; inputs beyond the map are
//! +0.
//!
//! Rounding differs from that of the direct kernels, so a network states its kernel. The largest
//! difference divided by the largest magnitude, for uniform inputs and weights and 32 to 256
//! channels, is 3e-6 for 2 x 2 tiles, 2e-5 for 4 x 4. Below about 16 input channels the direct
//! kernels are faster.

mod run;

pub use self::run::ConvScratch;

use self::run::{Four, Job, Transform, Two};
use super::conv::check_inputs;
use super::feature_map::{Band, View};
use super::shape::Region;
use super::weights::{ConvParts, Layout, Packed};
use crate::error::KernelError;
use crate::isa::Isa;

/// Size of a tile of outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WinogradTile {
    /// 2 x 2: 16 products instead of 36.
    Two,
    /// 4 x 4: 36 products instead of 144, and a larger error.
    Four,
}

impl WinogradTile {
    /// Outputs along one side.
    pub fn size(self) -> usize {
        match self {
            Self::Two => Two::OUT,
            Self::Four => Four::OUT,
        }
    }
}

/// A 3 x 3 convolution with padding 1, computed by tiles.
#[derive(Clone, Debug)]
pub struct WinogradConv3x3 {
    tile: WinogradTile,
    inputs: Vec<usize>,
    /// Rows are (place, input channel).
    packed: Packed,
}

impl WinogradConv3x3 {
    /// Transforms and packs a layer's parameters.
    ///
    /// # Errors
    /// A size that is zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(parts: &ConvParts, tile: WinogradTile) -> Result<Self, KernelError> {
        parts.check(9)?;
        let packed = match tile {
            WinogradTile::Two => pack::<Two, 4>(parts),
            WinogradTile::Four => pack::<Four, 6>(parts),
        };
        Ok(Self { tile, inputs: parts.inputs.clone(), packed })
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.packed.outputs
    }

    /// The tile.
    pub fn tile(&self) -> WinogradTile {
        self.tile
    }

    /// Maximum bytes of each of a scratch's three parts for `height` x `width` outputs. Each grows
    /// to the largest need of the layers that use it.
    pub fn scratch_bytes(&self, height: usize, width: usize) -> [u128; 3] {
        let size = self.tile.size();
        let tiles = height.div_ceil(size) as u128 * width.div_ceil(size) as u128;
        run::scratch_bytes(size + 2, &self.inputs, tiles)
    }

    /// Computes only the outputs of `region`, which consists of whole tiles (the last end with the
    /// map). Input maps have the output's height and width and a halo of 1.
    ///
    /// # Errors
    /// [`KernelError::Shape`], [`KernelError::Length`] or [`KernelError::Size`] for an input that
    /// does not fit, [`KernelError::Region`] for a region beyond the band or within a tile.
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
        scratch: &mut ConvScratch,
    ) -> Result<(), KernelError> {
        let [height, width, _] = out.size();
        out.check([height, width, self.packed.outputs], region)?;
        region.check_tiles(self.tile.size(), height, width)?;
        if inputs.len() != self.inputs.len() {
            let (expected, found) = (self.inputs.len(), inputs.len());
            return Err(KernelError::Length { tensor: "input maps", expected, found });
        }
        check_inputs(&self.inputs, inputs, [height, width], 1)?;
        if region.is_empty() {
            return Ok(());
        }
        let target = out.target(region.y, region.x);
        let packed = &self.packed;
        match self.tile {
            WinogradTile::Two => {
                isa.run(Job::<Two, 4>::new(packed, inputs, region, target, scratch));
            }
            WinogradTile::Four => {
                isa.run(Job::<Four, 6>::new(packed, inputs, region, target, scratch));
            }
        }
        Ok(())
    }
}

/// G g G^t of every pair of channels.
fn pack<T: Transform<N>, const N: usize>(parts: &ConvParts) -> Packed {
    let channels = parts.channels();
    Packed::new(parts, N * N * channels, |row, o| {
        let (place, i) = (row / channels, row % channels);
        let (u, v) = (place / N, place % N);
        let mut sum = 0.0;
        for ky in 0..3 {
            for kx in 0..3 {
                let g = parts.weight_f64(Layout::OutputsFirst, 9, [i, 3 * ky + kx, o]);
                sum += T::KERNEL[u][ky] * g * T::KERNEL[v][kx];
            }
        }
        sum as f32
    })
}
