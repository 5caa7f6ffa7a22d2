//! Memory of a frame engine, computed before it is allocated.
//!
//! An upper bound of a frame engine's memory: values and layer memories to the byte, change marks,
//! and the working space of the layer that needs the most.

use meissner_kernels::{FeatureMap, Lanes, Planes, PooledConv3x3};

use super::buffer::Buffer;
use super::changes::{Changes, Pending, RECTANGLE};
use super::compile::{CompiledLayer, FrameNetwork, Kernel};
use super::layers::{Memory, ScratchBytes, TILE};
use super::network::FrameShape;
use super::options::{FrameOptions, Skip};
use crate::counters::FrameLayerCounters;

/// Number of whole-map sets of marks that exist while a layer runs.
const MARKS: u128 = 5;

impl FrameNetwork {
    /// Upper bound in bytes of a [`FrameEngine`](super::FrameEngine)'s memory, without the shared
    /// parameters. O(layers^2).
    pub fn engine_bytes(&self, options: FrameOptions) -> u128 {
        let of_inputs = |of: &dyn Fn(&CompiledLayer, FrameShape) -> u128| -> u128 {
            self.units.iter().map(|unit| of(unit, self.read_by(unit))).sum()
        };
        let marks = of_inputs(&|unit, from| of_flags(unit, from) + of_changes(from));
        let reached: u128 = if options.stores_background() {
            self.values.iter().map(|value| of_changes(value.shape)).sum()
        } else {
            0
        };
        let records = size_of::<(Pending, Memory, [Buffer; 2], Option<Changes>, FrameLayerCounters)>();
        let each = (self.values.len() * records) as u128;
        let statistics = self.statistics().map_or(0, |statistics| statistics.bytes() as u128);
        self.state_bytes(options) + marks + reached + self.scratch_bytes(options) + each + statistics
    }

    /// Bytes of all activations and of the memories of the layers.
    pub(super) fn state_bytes(&self, options: FrameOptions) -> u128 {
        let kept = (0..self.buffers.len()).filter(|&buffer| self.is_kept(buffer));
        let buffers: u128 = kept.map(|buffer| of_buffer(self.buffers[buffer], self.planar)).sum();
        let memories: u128 = self.units.iter().map(|unit| of_memory(unit, self.read_by(unit))).sum();
        buffers * if options.stores_background() { 2 } else { 1 } + memories
    }

    /// Whether `buffer` stores any values.
    pub(super) fn is_kept(&self, buffer: usize) -> bool {
        self.values.iter().any(|value| value.buffer == buffer)
    }

    /// Shape of the first input of `unit`.
    fn read_by(&self, unit: &CompiledLayer) -> FrameShape {
        self.values[unit.from].shape
    }

    /// Bytes of the working space, and of the prediction.
    fn scratch_bytes(&self, options: FrameOptions) -> u128 {
        let ScratchBytes { winograd, pooled, squeeze: [mean, middle], kn2row, values, compared, marks } =
            self.scratch(options);
        let parts = winograd.iter().chain(&kn2row).chain(&pooled).sum::<u128>() + 2 * mean + middle;
        MARKS * marks + parts + values + compared + of_values(self.output().values())
    }

    /// Bytes of each part of the working space.
    pub(super) fn scratch(&self, options: FrameOptions) -> ScratchBytes {
        let mut most = ScratchBytes::default();
        let raise = |part: &mut u128, needed: u128| *part = needed.max(*part);
        self.values.iter().for_each(|value| raise(&mut most.marks, of_changes(value.shape)));
        for (unit, value) in self.units.iter().zip(&self.values[1..]) {
            let from = self.read_by(unit);
            let ([_, height, width], [.., read]) = (value.shape.sides(), from.sides());
            if options.skip != Skip::Nothing {
                raise(&mut most.compared, of_values(of_block(unit, value.shape)));
            }
            match &unit.kernel {
                Kernel::Winograd(conv) => {
                    let needed = conv.scratch_bytes(height, width);
                    most.winograd.iter_mut().zip(needed).for_each(|(part, needed)| raise(part, needed));
                }
                Kernel::PooledConv(_) => {
                    let threads = if options.two_threads { 2 } else { 1 };
                    let used = most.pooled.iter_mut().take(threads);
                    used.for_each(|part| raise(part, PooledConv3x3::scratch_bytes(width)));
                }
                Kernel::SqueezeExcite(squeeze) => {
                    let needed = squeeze.scratch_bytes();
                    most.squeeze.iter_mut().zip(needed).for_each(|(part, needed)| raise(part, needed));
                }
                Kernel::Kn2row(conv) => {
                    let needed = conv.scratch_bytes(height * width);
                    most.kn2row.iter_mut().zip(needed).for_each(|(part, needed)| raise(part, needed));
                }
                Kernel::Sum => raise(&mut most.values, of_values(from.values())),
                Kernel::AveragePool(_) => raise(&mut most.values, of_values(read)),
                _ => {}
            }
        }
        most
    }
}

fn of_values(values: usize) -> u128 {
    values as u128 * size_of::<f32>() as u128
}

fn of_buffer(shape: FrameShape, planar: bool) -> u128 {
    match shape {
        FrameShape::Vector(values) => Lanes::count(values) as u128 * size_of::<Lanes>() as u128,
        FrameShape::Image { channels, height, width } if planar => Planes::bytes_of(channels, height, width),
        FrameShape::Image { channels, height, width } => FeatureMap::bytes_of(height, width, channels, 1),
    }
}

/// Bytes of the memory of a layer whose input has shape `from`.
fn of_memory(unit: &CompiledLayer, from: FrameShape) -> u128 {
    match (&unit.kernel, from) {
        (Kernel::Lstm(lstm), _) => lstm.state_bytes() as u128,
        (Kernel::PlanarConvLstm(lstm), FrameShape::Image { height, width, .. }) => {
            lstm.state_bytes(height, width)
        }
        (Kernel::ConvLstm(lstm), FrameShape::Image { height, width, .. }) => {
            of_values(height * width * lstm.hidden) + FeatureMap::bytes_of(height, width, 4 * lstm.hidden, 0)
        }
        (Kernel::Delay(frames), from) => of_values(frames * from.values()),
        (Kernel::Kn2row(conv), FrameShape::Image { height, width, .. }) => {
            FeatureMap::bytes_of(height, width, conv.products(), 1)
        }
        _ => 0,
    }
}

/// Bytes of the flags of occupied tiles, if the layer keeps them.
fn of_flags(unit: &CompiledLayer, from: FrameShape) -> u128 {
    let [_, height, width] = from.sides();
    let keeps = matches!(unit.kernel, Kernel::PlanarConvLstm(_));
    if keeps { (height as u128 + 2) * (width.div_ceil(TILE) as u128 + 2) } else { 0 }
}

fn of_changes(shape: FrameShape) -> u128 {
    let [height, width] = shape.marks();
    height as u128 * width.div_ceil(u64::BITS as usize) as u128 * size_of::<u64>() as u128
}

/// Number of values in a row of blocks, or a rectangle, that the layer's result is compared with.
fn of_block(unit: &CompiledLayer, to: FrameShape) -> usize {
    let (rows, rectangle) = match &unit.kernel {
        Kernel::PlanarConv(_) | Kernel::Winograd(_) => (4, 0),
        Kernel::Conv3(_) | Kernel::PooledConv(_) | Kernel::Kn2row(_) => (2, RECTANGLE),
        Kernel::Conv1(_) | Kernel::UpConv(_) | Kernel::MaxPool | Kernel::AveragePool(_) => (2, 0),
        _ => return 0,
    };
    let [channels, height, width] = to.sides();
    (rows.min(height) * width).max(rectangle) * channels
}
