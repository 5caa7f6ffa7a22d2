//! Direct convolutions.
//!
//! - Stride 1: y(p, o) = relu(b(o) + sum of x(p + place, i) W(o, i, place)).
//! - Transposed, 2 x 2 places with stride 2: each input pixel becomes four output pixels,
//!   y(2 p + d, o) = relu(b(o) + sum over i of x(p, i) W(i, o, d)).
//!
//! An output is one chain of sums from the bias, over input maps, rows and columns of the kernel,
//! and channels, all ascending. Places beyond the map add zeros. At the end +0 is added, so no
//! output is -0. A map of zeros therefore changes nothing and is not read.

use crate::error::KernelError;
use crate::frames::feature_map::{Band, Target, View};
use crate::frames::layer::{Layer, PAIR, sources};
use crate::frames::room;
use crate::frames::shape::Region;
use crate::frames::weights::{ConvParts, Layout, Packed};
use crate::isa::Isa;
use crate::lanes::Wide;

/// A convolution with a 3 x 3 kernel and padding 1.
pub type Conv3x3 = DirectConv<3>;

/// A convolution with a 1 x 1 kernel.
pub type Conv1x1 = DirectConv<1>;

/// A convolution with a K x K kernel, centred on the output.
#[derive(Clone, Debug)]
pub struct DirectConv<const K: usize> {
    pub(super) inputs: Vec<usize>,
    pub(super) packed: Packed,
}

impl<const K: usize> DirectConv<K> {
    /// Packs a layer's parameters.
    ///
    /// # Errors
    /// A size that is zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(parts: &ConvParts) -> Result<Self, KernelError> {
        parts.check(K * K)?;
        let packed = Packed::new(parts, parts.channels() * K * K, |row, o| {
            let (place, i) = place(&parts.inputs, K * K, row);
            parts.weight(Layout::OutputsFirst, K * K, [i, place, o])
        });
        Ok(Self { inputs: parts.inputs.clone(), packed })
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.packed.outputs
    }

    /// Multiply-adds of one output pixel.
    pub fn multiply_adds(&self) -> usize {
        self.packed.rows * self.packed.outputs
    }

    /// Computes only the outputs of `region`. Input maps have the output's height and width, and a
    /// halo as wide as the padding. An omitted second map counts as zeros.
    ///
    /// # Errors
    /// [`KernelError::Shape`], [`KernelError::Length`] or [`KernelError::Size`] for an input that
    /// does not fit, [`KernelError::Region`] for a region beyond the band.
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
    ) -> Result<(), KernelError> {
        let [height, width, _] = out.size();
        out.check([height, width, self.packed.outputs], region)?;
        check_inputs(&self.inputs, inputs, [height, width], K / 2)?;
        if region.is_empty() {
            return Ok(());
        }
        let sources = sources(inputs, K, K / 2, [region.y, region.x]);
        let target = out.target(region.y, region.x);
        isa.run(Layer {
            packed: &self.packed,
            sources,
            rows: region.height,
            columns: region.width,
            target,
            halves: None,
        });
        Ok(())
    }
}

/// Kernel place and input channel (counted over all maps) of a packed row.
pub(super) fn place(inputs: &[usize], places: usize, mut row: usize) -> (usize, usize) {
    let mut before = 0;
    for &channels in inputs {
        if row < places * channels {
            return (row / channels, before + row % channels);
        }
        row -= places * channels;
        before += channels;
    }
    unreachable!("a row belongs to one of the maps")
}

/// Refuses more maps than the layer reads, an empty list, and maps of another size or with other
/// channels.
pub(super) fn check_inputs(
    channels: &[usize],
    inputs: &[View<'_>],
    [height, width]: [usize; 2],
    halo: usize,
) -> Result<(), KernelError> {
    if inputs.is_empty() || inputs.len() > channels.len() {
        return Err(KernelError::Length {
            tensor: "input maps",
            expected: channels.len(),
            found: inputs.len(),
        });
    }
    inputs.iter().zip(channels).try_for_each(|(view, &c)| view.check([height, width, c], halo))
}

/// A transposed convolution with a 2 x 2 kernel and stride 2, which doubles height and width.
#[derive(Clone, Debug)]
pub struct TransposedConv2x2 {
    inputs: Vec<usize>,
    /// One per place: upper left, upper right, lower left, lower right.
    places: [Packed; 4],
}

impl TransposedConv2x2 {
    /// Packs a layer's parameters.
    ///
    /// # Errors
    /// A size that is zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(parts: &ConvParts) -> Result<Self, KernelError> {
        parts.check(4)?;
        let packed = |d: usize| {
            Packed::new(parts, parts.channels(), |row, o| {
                let (_, i) = place(&parts.inputs, 1, row);
                parts.weight(Layout::InputsFirst, 4, [i, d, o])
            })
        };
        Ok(Self { inputs: parts.inputs.clone(), places: std::array::from_fn(packed) })
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.places[0].outputs
    }

    /// Computes the four outputs of each pixel in `region`, a region of the inputs.
    ///
    /// # Errors
    /// [`KernelError::Shape`] or [`KernelError::Length`] for a map that does not fit (the output is
    /// twice as high and wide), [`KernelError::Region`] for a region beyond the band.
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
    ) -> Result<(), KernelError> {
        let [height, width] = inputs.first().map_or([0; 2], |view| [view.shape.height, view.shape.width]);
        check_inputs(&self.inputs, inputs, [height, width], 0)?;
        region.check_within(height, width)?;
        let Region { y, x, .. } = region;
        let outputs = Region { y: 2 * y, x: 2 * x, height: 2 * region.height, width: 2 * region.width };
        out.check([2 * height, 2 * width, self.outputs()], outputs)?;
        if region.is_empty() {
            return Ok(());
        }
        for (d, packed) in self.places.iter().enumerate() {
            let sources = sources(inputs, 1, 0, [y, x]);
            let Target { values, row, pixel } = out.target(2 * y + d / 2, 2 * x + d % 2);
            let target = Target { values, row: 2 * row, pixel: 2 * pixel };
            isa.run(Layer {
                packed,
                sources,
                rows: region.height,
                columns: region.width,
                target,
                halves: None,
            });
        }
        Ok(())
    }
}

/// A [`Conv3x3`] fused with the 2 x 2 maximum that is its only reader, with the same bits as both.
/// The map between them is never written: it is four times as large as the result, and memory
/// limits such layers.
#[derive(Clone, Debug)]
pub struct PooledConv3x3 {
    conv: Conv3x3,
}

/// Working space for half of a row of outputs; grows to the need of the largest layer.
#[derive(Clone, Debug, Default)]
pub struct PooledScratch {
    halves: Vec<Wide>,
}

impl PooledScratch {
    /// Room for the layers that need no more bytes: their runs allocate nothing.
    pub fn with_bytes(bytes: u128) -> Self {
        Self { halves: room(bytes) }
    }
}

impl PooledConv3x3 {
    /// `conv`, followed by the maximum.
    pub fn new(conv: Conv3x3) -> Self {
        Self { conv }
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.conv.outputs()
    }

    /// Total number of channels of the input maps.
    pub fn reads(&self) -> usize {
        self.conv.inputs.iter().sum()
    }

    /// Maximum bytes of scratch for a map whose rows have `width` pooled outputs, on one thread.
    pub fn scratch_bytes(width: usize) -> u128 {
        (PAIR * size_of::<Wide>()) as u128 * width as u128
    }

    /// Computes only the pooled outputs of `region`. Input maps have a halo of at least 1 and twice
    /// the output's height and width, or one more.
    ///
    /// # Errors
    /// As [`DirectConv::run`](crate::frames::DirectConv::run).
    pub fn run(
        &self,
        isa: Isa,
        inputs: &[View<'_>],
        region: Region,
        mut out: Band<'_>,
        scratch: &mut PooledScratch,
    ) -> Result<(), KernelError> {
        let [height, width] = inputs.first().map_or([0; 2], |view| [view.shape.height, view.shape.width]);
        let outputs = self.outputs();
        out.check([height / 2, width / 2, outputs], region)?;
        check_inputs(&self.conv.inputs, inputs, [height, width], 1)?;
        if region.is_empty() {
            return Ok(());
        }
        let halves = PAIR * region.width;
        scratch.halves.resize(scratch.halves.len().max(halves), Wide::ZERO);
        isa.run(Layer {
            packed: &self.conv.packed,
            sources: sources(inputs, 3, 1, [2 * region.y, 2 * region.x]),
            rows: 2 * region.height,
            columns: 2 * region.width,
            target: out.target(region.y, region.x),
            halves: Some(&mut scratch.halves),
        });
        Ok(())
    }
}
