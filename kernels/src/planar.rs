//! Images of few channels, stored plane after plane, with convolution and pooling.
//!
//! Lanes run over adjacent positions of a row and share each weight. For many channels,
//! channels-last is better. Poolings ignore pixels that fill no window.

mod planes;

use std::ops::Range;

use crate::error::{KernelError, check, check_sizes};
use crate::isa::{Isa, Simd, Taps, Task, Vector, accumulate_taps};

pub(crate) use planes::TILE;
pub use planes::{Occupancy, Planes, TileRegion};

/// The largest value of each 2 x 2 window. -0 becomes +0, because the order must not matter; NaN
/// gives NaN. O(values).
///
/// # Panics
/// If `out` is not (channels, height / 2, width / 2).
pub fn planar_max_pool(image: &Planes, out: &mut Planes) {
    check_pooled(image, 2, out);
    let larger = |a: f32, b: f32| if (b > a) | b.is_nan() { b } else { a };
    for channel in 0..out.channels() {
        for y in 0..out.height() {
            let (above, below) = (image.row(channel, 2 * y), image.row(channel, 2 * y + 1));
            let windows = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
            for (out, (&[a, b], &[c, d])) in out.row_mut(channel, y).iter_mut().zip(windows) {
                *out = larger(larger(a, c), larger(b, d)) + 0.0;
            }
        }
    }
}

/// The mean of each `size` x `size` window: sums of columns (rows ascending), their sum, ascending,
/// divided by the number of pixels. `columns` is scratch. O(values).
///
/// # Panics
/// If `size` is zero, or `out` is not (channels, height / size, width / size).
pub fn planar_average_pool(image: &Planes, size: usize, columns: &mut Vec<f32>, out: &mut Planes) {
    check_pooled(image, size, out);
    let pixels = size.saturating_mul(size) as f32;
    for channel in 0..out.channels() {
        for y in 0..out.height() {
            columns.clear();
            columns.extend_from_slice(image.row(channel, y * size));
            for dy in 1..size {
                for (sum, v) in columns.iter_mut().zip(image.row(channel, y * size + dy)) {
                    *sum += v;
                }
            }
            for (out, window) in out.row_mut(channel, y).iter_mut().zip(columns.chunks_exact(size)) {
                *out = window.iter().fold(0.0, |sum, v| sum + v) / pixels;
            }
        }
    }
}

fn check_pooled(image: &Planes, size: usize, out: &Planes) {
    assert_eq!(
        (out.channels(), out.height(), out.width()),
        (image.channels(), image.height() / size, image.width() / size),
        "the output must have the size of the pooled image"
    );
}

const TAPS: usize = 9;

/// A 3 x 3 convolution, padding 1, stride 1, over one image, or over the concatenation of two:
///
/// ```text
/// out(o, y, x) = b(o) + sum over c, dy, dx of w(o, c, dy, dx) in(c, y + dy - 1, x + dx - 1)
/// ```
///
/// Order of a sum: from +0; channels of the first image, then of the second, ascending; in each dy,
/// then dx; each product rounded once with the sum; then b. A tap beyond the border adds w times 0.
/// b is never -0, so a zero sum's sign affects nothing, and an image that is zero around a position
/// can be skipped there.
#[derive(Clone, Debug)]
pub struct PlanarConv3x3 {
    channels: [usize; 2],
    /// Blocks of outputs that share the loaded inputs.
    blocks: Vec<Block>,
    outputs: usize,
    relu: bool,
}

#[derive(Clone, Debug)]
struct Block {
    size: usize,
    /// For each image, (channels x 9, size).
    weights: [Vec<f32>; 2],
    bias: Vec<f32>,
}

const SIZES: [usize; 3] = [6, 3, 1];

impl PlanarConv3x3 {
    /// A layer from `channels` of a first and a second image (or 0) to `outputs` planes. `weight`
    /// is (outputs, sum of channels, 3, 3), `bias` (outputs).
    ///
    /// # Errors
    /// No channel, no output, a tensor of the wrong length, or a value that is not finite.
    pub fn new(
        channels: [usize; 2],
        outputs: usize,
        weight: &[f32],
        bias: Option<&[f32]>,
        relu: bool,
    ) -> Result<Self, KernelError> {
        // No tensor has the length of a size that saturates.
        let inputs = channels[0].saturating_add(channels[1]);
        check_sizes([("channels", inputs), ("outputs", outputs)])?;
        check("weight", weight, outputs.saturating_mul(inputs).saturating_mul(TAPS))?;
        let bias = bias.map_or_else(|| vec![0.0; outputs], <[f32]>::to_vec);
        check("bias", &bias, outputs)?;
        let mut blocks = Vec::new();
        let mut first = 0;
        while first < outputs {
            let size = SIZES.into_iter().find(|size| first + size <= outputs).unwrap_or(1);
            let pack = |taps: Range<usize>| {
                taps.flat_map(|tap| (first..first + size).map(move |o| weight[o * inputs * TAPS + tap]))
                    .collect()
            };
            blocks.push(Block {
                size,
                weights: [pack(0..channels[0] * TAPS), pack(channels[0] * TAPS..inputs * TAPS)],
                // Adding +0 turns -0 into +0.
                bias: bias[first..first + size].iter().map(|b| b + 0.0).collect(),
            });
            first += size;
        }
        Ok(Self { channels, blocks, outputs, relu })
    }

    /// Channels of the two images.
    pub fn channels(&self) -> [usize; 2] {
        self.channels
    }

    /// Planes written.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Computes `region` of every output plane. An image that is `None` counts as zeros and is not
    /// read; the same holds for tiles of the first image that are empty by `occupied`. O(region x 9
    /// x channels x outputs).
    ///
    /// # Panics
    /// If an image or `out` does not fit, or the region is out of bounds.
    pub fn run(
        &self,
        isa: Isa,
        images: [Option<&Planes>; 2],
        occupied: Option<&Occupancy>,
        region: &TileRegion,
        out: &mut Planes,
    ) {
        assert_eq!(out.channels(), self.outputs, "the output must have the layer's planes");
        self.check(images, occupied, out.height(), out.width());
        assert!(
            region.rows.end <= out.height() && region.tiles.end <= out.tiles(),
            "the region must be within the image"
        );
        isa.run(Run { conv: self, images, occupied, region, out });
    }

    pub(crate) fn check(
        &self,
        images: [Option<&Planes>; 2],
        occupied: Option<&Occupancy>,
        height: usize,
        width: usize,
    ) {
        assert!(
            occupied.is_none_or(|occupied| occupied.fits(height, width)),
            "what is occupied must be of an image of the output's size"
        );
        for (image, channels) in images.into_iter().zip(self.channels) {
            let Some(image) = image else { continue };
            assert_eq!(
                (image.channels(), image.height(), image.width()),
                (channels, height, width),
                "an image must have the layer's channels and the output's size"
            );
        }
    }
}

struct Run<'a> {
    conv: &'a PlanarConv3x3,
    images: [Option<&'a Planes>; 2],
    occupied: Option<&'a Occupancy>,
    region: &'a TileRegion,
    out: &'a mut Planes,
}

impl Task for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { conv, images, occupied, region, out } = self;
        let (width, plane) = (out.width(), out.plane());
        let end = (region.tiles.end * TILE).min(width);
        for y in region.rows.clone() {
            let row = RowOut { values: out.onward_mut(y), stride: plane };
            conv.row(simd, images, occupied, y, region.tiles.clone(), row);
            for channel in 0..conv.outputs {
                // Clears the outputs beyond the width.
                out.padded_mut(channel, y)[end..region.tiles.end * TILE].fill(0.0);
            }
        }
    }
}

/// Destination of a row of each output: tile t of output o goes to `o stride + 16 t`.
pub(crate) struct RowOut<'a> {
    pub(crate) values: &'a mut [f32],
    pub(crate) stride: usize,
}

impl PlanarConv3x3 {
    /// Computes tiles of one row of every output; whole vectors are written.
    #[inline(always)]
    pub(crate) fn row<S: Simd>(
        &self,
        simd: S,
        images: [Option<&Planes>; 2],
        occupied: Option<&Occupancy>,
        y: usize,
        tiles: Range<usize>,
        mut out: RowOut<'_>,
    ) {
        let mut first = 0;
        for block in &self.blocks {
            let mut row = Row { block, first, relu: self.relu, images, occupied, y, tiles: tiles.clone() };
            // As many tiles as registers allow: a tile needs its sums and one more register; the
            // weight needs one.
            match block.size {
                6 => {
                    if S::WIDE {
                        row.run::<S, 6, 4>(simd, &mut out);
                        row.run::<S, 6, 2>(simd, &mut out);
                    }
                    row.run::<S, 6, 1>(simd, &mut out);
                }
                3 => {
                    if S::WIDE {
                        row.run::<S, 3, 4>(simd, &mut out);
                    }
                    row.run::<S, 3, 1>(simd, &mut out);
                }
                _ => {
                    row.run::<S, 1, 4>(simd, &mut out);
                    row.run::<S, 1, 1>(simd, &mut out);
                }
            }
            first += block.size;
        }
    }
}

/// The tiles of a row of a block's outputs that are not computed yet.
struct Row<'a> {
    block: &'a Block,
    /// The block's first output.
    first: usize,
    relu: bool,
    images: [Option<&'a Planes>; 2],
    occupied: Option<&'a Occupancy>,
    y: usize,
    tiles: Range<usize>,
}

impl Row<'_> {
    /// Computes B tiles at a time, while there are B, for the O outputs of the block.
    #[inline(always)]
    fn run<S: Simd, const O: usize, const B: usize>(&mut self, simd: S, out: &mut RowOut<'_>) {
        let zero = S::V16::splat(simd, 0.0);
        while self.tiles.len() >= B {
            let tile = self.tiles.start;
            let empty = self.occupied.is_some_and(|o| o.is_empty_around(self.y, tile, B));
            let mut acc = [[zero; B]; O];
            for (image, weights) in
                [self.images[0].filter(|_| !empty), self.images[1]].into_iter().zip(&self.block.weights)
            {
                // An image without channels has no first tap.
                if let Some(image) = image.filter(|_| !weights.is_empty()) {
                    let taps = Taps {
                        values: image.above(self.y, tile * TILE),
                        stride: image.stride(),
                        plane: image.plane(),
                    };
                    accumulate_taps(simd, &mut acc, taps, weights.as_chunks::<O>().0);
                }
            }
            for (o, acc) in acc.into_iter().enumerate() {
                let bias = S::V16::splat(simd, self.block.bias[o]);
                let row = &mut out.values[(self.first + o) * out.stride + tile * TILE..][..B * TILE];
                for (sum, to) in acc.into_iter().zip(row.chunks_exact_mut(TILE)) {
                    let y = sum.add(bias);
                    (if self.relu { y.max(zero) } else { y }).store_slice(to);
                }
            }
            self.tiles.start += B;
        }
    }
}
