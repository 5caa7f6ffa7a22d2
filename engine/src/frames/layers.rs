//! Execution of one layer: its inputs, its memory, its output.

use meissner_kernels::{
    Band, ConvScratch, FeatureMap, Kn2rowScratch, LANES, LstmState, Matrix, Occupancy, PlanarConvLstmState,
    Planes, PooledScratch, Region, SqueezeScratch, TileRegion, average_pool, global_average,
    lstm_update_rows, max_pool_2x2, planar_average_pool, planar_max_pool,
};

use super::buffer::Buffer;
use super::changes::{Changes, Pending};
use super::compile::{CompiledLayer, ConvLstm, FrameNetwork, Kernel, Value};
use super::network::FrameShape;
use super::options::{FrameOptions, Skip};
use super::patch::{MapPixels, Patch, PatchScratch};
use crate::counters::FrameLayerCounters;

/// Sizes are checked when a network is made.
const FITS: &str = "the network's shapes fit its kernels";

/// The memory of a layer from frame to frame.
#[derive(Clone, Debug)]
pub(super) enum Memory {
    Nothing,
    Lstm(LstmState),
    ConvLstm(MapState),
    PlanarConvLstm(PlanarConvLstmState, Occupancy),
    /// The last vectors, oldest first.
    Delay(Vec<f32>),
    Products(KeptProducts),
}

/// Cells of a [`ConvLstm`]; its hidden state is the layer's output.
#[derive(Clone, Debug)]
pub(super) struct MapState {
    /// Whether there was no step yet; the output is then zeros.
    pub(super) new: bool,
    pub(super) cell: Vec<f32>,
    gates: FeatureMap,
}

/// Products of a convolution's input: they depend only on the stored input, and are not a state.
#[derive(Clone, Debug)]
pub(super) struct KeptProducts {
    /// Whether none of them is known.
    pub(super) stale: bool,
    map: FeatureMap,
}

impl Memory {
    pub(super) fn new(unit: &CompiledLayer, network: &FrameNetwork) -> Self {
        let from = network.values[unit.from].shape;
        match (&unit.kernel, from) {
            (Kernel::Lstm(lstm), _) => Self::Lstm(lstm.state()),
            (Kernel::PlanarConvLstm(lstm), FrameShape::Image { height, width, .. }) => {
                Self::PlanarConvLstm(lstm.state(height, width), Occupancy::empty(height, width))
            }
            (Kernel::ConvLstm(lstm), FrameShape::Image { height, width, .. }) => Self::ConvLstm(MapState {
                new: true,
                cell: vec![0.0; height * width * lstm.hidden],
                gates: FeatureMap::zeros(height, width, 4 * lstm.hidden, 0).expect(FITS),
            }),
            (Kernel::Delay(frames), shape) => Self::Delay(vec![0.0; frames * shape.values()]),
            (Kernel::Kn2row(conv), FrameShape::Image { height, width, .. }) => Self::Products(KeptProducts {
                stale: true,
                map: FeatureMap::zeros(height, width, conv.products(), 1).expect(FITS),
            }),
            _ => Self::Nothing,
        }
    }

    /// Whether the layer's output depends on earlier inputs.
    pub(super) fn is_state(&self) -> bool {
        !matches!(self, Self::Nothing | Self::Products(_))
    }

    pub(super) fn reset(&mut self) {
        match self {
            Self::Nothing | Self::Products(_) => {}
            Self::Lstm(state) => state.reset(),
            Self::PlanarConvLstm(state, _) => state.reset(),
            Self::ConvLstm(state) => {
                state.cell.fill(0.0);
                state.new = true;
            }
            Self::Delay(vectors) => vectors.fill(0.0),
        }
    }
}

/// Bytes of the working space that all layers share: for each part, the maximum over the layers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScratchBytes {
    pub(super) winograd: [u128; 3],
    /// On each of two threads.
    pub(super) pooled: [u128; 2],
    pub(super) squeeze: [u128; 2],
    pub(super) kn2row: [u128; 2],
    /// Values of an image, or of a row of it.
    pub(super) values: u128,
    /// Values that a layer's result is compared with.
    pub(super) compared: u128,
    /// One set of marks.
    pub(super) marks: u128,
}

/// Working space that all layers share. It keeps nothing from one run to the next.
#[derive(Debug)]
pub(super) struct Scratch {
    bytes: ScratchBytes,
    conv: ConvScratch,
    kn2row: Kn2rowScratch,
    pooled: [PooledScratch; 2],
    squeeze: SqueezeScratch,
    patch: PatchScratch,
    dirty: Changes,
    tiles: Changes,
    values: Vec<f32>,
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::new(self.bytes)
    }
}

impl Scratch {
    /// Allocates enough for every layer: no frame needs more.
    pub(super) fn new(bytes: ScratchBytes) -> Self {
        Self {
            bytes,
            conv: ConvScratch::with_bytes(bytes.winograd),
            kn2row: Kn2rowScratch::with_bytes(bytes.kn2row),
            pooled: bytes.pooled.map(PooledScratch::with_bytes),
            squeeze: SqueezeScratch::with_bytes(bytes.squeeze),
            patch: PatchScratch::with_bytes(bytes.marks, bytes.compared),
            dirty: Changes::with_bytes(bytes.marks),
            tiles: Changes::with_bytes(bytes.marks),
            values: Vec::with_capacity(bytes.values as usize / size_of::<f32>()),
        }
    }
}

pub(super) struct Run<'a> {
    pub(super) unit: &'a CompiledLayer,
    pub(super) options: FrameOptions,
    pub(super) input: &'a Buffer,
    pub(super) with: Option<&'a Buffer>,
    pub(super) from: Value,
    pub(super) to: Value,
    pub(super) pending: &'a Pending,
    /// The layer's output for a frame of zeros, and the pixels that other values may reach.
    pub(super) background: Option<(&'a Buffer, &'a Changes)>,
    pub(super) memory: &'a mut Memory,
    pub(super) scratch: &'a mut Scratch,
    pub(super) counters: &'a mut FrameLayerCounters,
}

impl Run<'_> {
    /// Updates `out` and marks the pixels that changed; returns whether any value may have changed.
    pub(super) fn run(self, out: &mut Buffer, changed: &mut Changes) -> bool {
        match &self.unit.kernel {
            Kernel::Conv3(_)
            | Kernel::Winograd(_)
            | Kernel::Kn2row(_)
            | Kernel::Conv1(_)
            | Kernel::UpConv(_)
            | Kernel::PlanarConv(_)
            | Kernel::PooledConv(_)
            | Kernel::MaxPool
            | Kernel::AveragePool(_) => match out {
                Buffer::Planes(planes) => self.planes(planes, changed),
                _ => self.map(out.map_mut(), changed),
            },
            Kernel::Alias => {
                changed.clone_from(&self.pending.pixels);
                true
            }
            Kernel::SqueezeExcite(_) => self.squeeze(out.map_mut(), changed),
            Kernel::ConvLstm(lstm) => self.conv_lstm(lstm, out.map_mut(), changed),
            Kernel::PlanarConvLstm(_) => self.planar_conv_lstm(out.planes_mut(), changed),
            _ => self.vector(out.vector_mut()),
        }
    }

    fn tolerance(&self) -> Option<f32> {
        match self.options.skip {
            Skip::Tolerance(tolerance) => Some(tolerance),
            Skip::Exact | Skip::Nothing => None,
        }
    }

    /// Runs a layer with a small receptive field over maps with channels last.
    fn map(self, out: &mut FeatureMap, changed: &mut Changes) -> bool {
        let (tolerance, [channels, height, width]) = (self.tolerance(), self.to.shape.sides());
        let Self { unit, options, input, from, to, pending, background, memory, scratch, counters, .. } =
            self;
        let Scratch {
            conv: conv_scratch,
            kn2row: kn2row_scratch,
            pooled: pooled_scratch,
            patch: patch_scratch,
            dirty,
            tiles,
            ..
        } = scratch;
        let read = match (&unit.kernel, from.shape) {
            (Kernel::PooledConv(conv), _) => conv.reads(),
            (_, FrameShape::Image { channels, .. }) => channels,
            (_, FrameShape::Vector(_)) => unreachable!("{FITS}"),
        };
        let view = input.map().view().channels(from.first, read).expect(FITS);
        let isa = options.isa;
        let all = options.skip == Skip::Nothing;
        let mut products = None;
        if let (Kernel::Kn2row(conv), Memory::Products(KeptProducts { stale, map })) = (&unit.kernel, memory)
        {
            dirty.clone_from(&pending.pixels);
            if std::mem::take(stale) || all {
                dirty.set_all();
            }
            conv.update(isa, view, dirty.pixels(), map, kn2row_scratch).expect(FITS);
            products = Some(map.view());
        }
        let compute = |pixels: &mut MapPixels<'_>, region: Region| {
            let MapPixels { map, first, channels } = pixels;
            let band = map.band().channels(*first, *channels).expect(FITS);
            let direct = |region: Region, band: Band<'_>, scratch: &mut PooledScratch| match &unit.kernel {
                Kernel::Conv3(conv) => conv.run(isa, &[view], region, band),
                Kernel::PooledConv(conv) => conv.run(isa, &[view], region, band, scratch),
                _ => unreachable!("layers of other kinds are not shared by threads"),
            };
            match &unit.kernel {
                Kernel::Conv3(_) | Kernel::PooledConv(_) => {
                    let [first, second] = &mut *pooled_scratch;
                    if options.two_threads && region.height * region.width >= LARGE {
                        let (upper, lower) = split(region);
                        let (above, below) = band.split_at_row(lower.y).expect(FITS);
                        let halves =
                            rayon::join(|| direct(upper, above, first), || direct(lower, below, second));
                        halves.0.and(halves.1)
                    } else {
                        direct(region, band, first)
                    }
                }
                Kernel::Winograd(conv) => conv.run(isa, &[view], region, band, conv_scratch),
                Kernel::Kn2row(conv) => conv.sum(isa, products.expect(FITS), region, band),
                Kernel::Conv1(conv) => conv.run(isa, &[view], region, band),
                Kernel::UpConv(conv) => {
                    // Blocks have even sides, and so has a doubled map.
                    let Region { y, x, height, width } = region;
                    let read = Region { y: y / 2, x: x / 2, height: height / 2, width: width / 2 };
                    conv.run(isa, &[view], read, band)
                }
                Kernel::MaxPool => max_pool_2x2(isa, view, region, band),
                Kernel::AveragePool(size) => average_pool(isa, *size, view, region, band),
                _ => unreachable!("layers of other kinds run elsewhere"),
            }
            .expect(FITS);
        };
        if !all {
            dirty.become_none([height, width]);
            spread(&unit.kernel, &pending.pixels, dirty, tiles);
        }
        let patch = Patch {
            size: [height, width],
            dirty: (!all).then_some(&*dirty),
            background: background.filter(|_| !all).map(|(b, reached)| (b.map(), reached)),
            tolerance,
            // Small, as a call costs little; even, for transposed convolutions; tiles for Winograd.
            block: if matches!(unit.kernel, Kernel::Winograd(_)) { [4, 8] } else { [2, 2] },
            rectangles: matches!(unit.kernel, Kernel::Conv3(_) | Kernel::PooledConv(_) | Kernel::Kn2row(_)),
        };
        let mut pixels = MapPixels { map: out, first: to.first, channels };
        patch.apply(&mut pixels, patch_scratch, changed, counters, compute);
        !changed.is_empty()
    }

    /// Runs the same over planes.
    fn planes(self, out: &mut Planes, changed: &mut Changes) -> bool {
        let (tolerance, [_, height, width]) = (self.tolerance(), self.to.shape.sides());
        let Self { unit, options, input, pending, background, scratch, counters, .. } = self;
        let Scratch { patch: patch_scratch, dirty, tiles, values, .. } = scratch;
        let input = input.planes();
        let compute = |out: &mut Planes, region: Region| match &unit.kernel {
            Kernel::PlanarConv(conv) => {
                let tiles = region.x / TILE..(region.x + region.width).div_ceil(TILE);
                let region = TileRegion { rows: region.y..region.y + region.height, tiles };
                conv.run(options.isa, [Some(input), None], None, &region, out);
            }
            // A pooling costs less than finding its changed pixels.
            Kernel::MaxPool => planar_max_pool(input, out),
            Kernel::AveragePool(size) => planar_average_pool(input, *size, values, out),
            _ => unreachable!("layers of other kinds run elsewhere"),
        };
        let all = options.skip == Skip::Nothing || !matches!(unit.kernel, Kernel::PlanarConv(_));
        if !all {
            dirty.become_none([height, width]);
            spread(&unit.kernel, &pending.pixels, dirty, tiles);
        }
        let patch = Patch {
            size: [height, width],
            dirty: (!all).then_some(&*dirty),
            background: background.filter(|_| !all).map(|(b, reached)| (b.planes(), reached)),
            tolerance,
            block: [4, TILE],
            rectangles: false,
        };
        patch.apply(out, patch_scratch, changed, counters, compute);
        if all && options.skip != Skip::Nothing {
            changed.clear();
            spread(&unit.kernel, &pending.pixels, changed, tiles);
        }
        !changed.is_empty()
    }

    /// Squeeze-and-excitation couples every pixel: one changed value changes all.
    fn squeeze(self, out: &mut FeatureMap, changed: &mut Changes) -> bool {
        let Kernel::SqueezeExcite(squeeze) = &self.unit.kernel else { unreachable!("{FITS}") };
        let [channels, height, width] = self.to.shape.sides();
        let isa = self.options.isa;
        let view = self.input.map().view().channels(self.from.first, channels).expect(FITS);
        let band = out.band().channels(self.to.first, channels).expect(FITS);
        squeeze.run(isa, view, band, &mut self.scratch.squeeze).expect(FITS);
        changed.set_all();
        self.counters.computed += (height * width) as u64;
        true
    }

    fn conv_lstm(self, lstm: &ConvLstm, out: &mut FeatureMap, changed: &mut Changes) -> bool {
        let [hidden, height, width] = self.to.shape.sides();
        let Memory::ConvLstm(MapState { new, cell, gates }) = self.memory else { unreachable!("{FITS}") };
        let FrameShape::Image { channels, .. } = self.from.shape else { unreachable!("{FITS}") };
        let x = self.input.map().view().channels(self.from.first, channels).expect(FITS);
        let region = Region::all(height, width);
        let inputs = [x, out.view()];
        let inputs = if std::mem::take(new) { &inputs[..1] } else { &inputs[..] };
        lstm.gates.run(self.options.isa, inputs, region, gates.band()).expect(FITS);
        let row = width * hidden;
        for (y, cell) in cell.chunks_exact_mut(row).enumerate() {
            let peepholes = lstm
                .peepholes
                .as_ref()
                .map(|gates| std::array::from_fn(|gate| &gates[gate][y * row..][..row]));
            let (gates, h) = (gates.row_mut(y), out.row_mut(y));
            lstm_update_rows(self.options.isa, hidden, gates, peepholes, lstm.squash, cell, h);
        }
        changed.set_all();
        self.counters.computed += (height * width) as u64;
        true
    }

    fn planar_conv_lstm(self, out: &mut Planes, changed: &mut Changes) -> bool {
        let [_, height, width] = self.to.shape.sides();
        let Memory::PlanarConvLstm(state, occupancy) = self.memory else { unreachable!("{FITS}") };
        let Kernel::PlanarConvLstm(lstm) = &self.unit.kernel else { unreachable!("{FITS}") };
        let x = self.input.planes();
        // Only a frame has empty pixels: a layer with a state writes none.
        let occupied = (self.unit.from == 0 && self.options.skip != Skip::Nothing).then(|| {
            occupancy.update(x);
            &*occupancy
        });
        lstm.step(self.options.isa, Some(x), occupied, state, out);
        changed.set_all();
        let all = (height * width) as u64;
        let empty = occupied.map_or(0, |o| all.saturating_sub((o.occupied() * TILE) as u64));
        self.counters.computed += all - empty;
        self.counters.absorbed += empty;
        true
    }

    fn vector(self, out: &mut Matrix) -> bool {
        self.counters.computed += 1;
        let Self { unit, options, input, with, from, memory, scratch, .. } = self;
        match (&unit.kernel, memory) {
            (Kernel::Lstm(lstm), Memory::Lstm(state)) => {
                lstm.step(options.isa, input.vector().slice(0), state);
                out.slice_mut(0).copy_from_slice(state.hidden());
            }
            (Kernel::Delay(frames), Memory::Delay(vectors)) => {
                let now = input.vector().slice(0);
                vectors.copy_within(now.len().., 0);
                let last = vectors.len() - now.len();
                vectors[last..].copy_from_slice(now);
                for (value, series) in out.slice_mut(0).chunks_exact_mut(*frames).enumerate() {
                    for (frame, to) in series.iter_mut().enumerate() {
                        *to = vectors[frame * now.len() + value];
                    }
                }
            }
            (Kernel::Append, _) => {
                let (now, with) = (input.vector().slice(0), with.expect(FITS).vector().slice(0));
                let (first, second) = out.slice_mut(0).split_at_mut(now.len());
                first.copy_from_slice(now);
                second.copy_from_slice(with);
            }
            (Kernel::Dense(dense), _) => dense.run(options.isa, input.vector().lanes(), out.row_mut(0)),
            (kernel, _) => {
                let FrameShape::Image { channels, height, width } = from.shape else {
                    unreachable!("{FITS}")
                };
                let out = out.slice_mut(0);
                match kernel {
                    Kernel::Flatten => input.flatten(from.first, channels, out),
                    Kernel::GlobalAverage => {
                        let view = input.map().view().channels(from.first, channels).expect(FITS);
                        global_average(options.isa, view, out).expect(FITS);
                    }
                    Kernel::Sum => {
                        scratch.values.resize(channels * height * width, 0.0);
                        input.flatten(from.first, channels, &mut scratch.values);
                        // In f64, in which sums of counts are exact.
                        for (sum, plane) in out.iter_mut().zip(scratch.values.chunks_exact(height * width)) {
                            *sum = plane.iter().map(|&v| f64::from(v)).sum::<f64>() as f32;
                        }
                    }
                    _ => unreachable!("layers of other kinds run elsewhere"),
                }
            }
        }
        true
    }
}

pub(super) const TILE: usize = 2 * LANES;
/// Number of pixels from which two threads share a map.
const LARGE: usize = 4096;

fn split(region: Region) -> (Region, Region) {
    let upper = Region { height: region.height / 2, ..region };
    (upper, Region { y: region.y + upper.height, height: region.height - upper.height, ..region })
}

/// Propagates the marks `from` through a kernel into `to`; `scratch` is overwritten.
pub(super) fn spread(kernel: &Kernel, from: &Changes, to: &mut Changes, scratch: &mut Changes) {
    match kernel {
        Kernel::Conv3(_) | Kernel::Kn2row(_) | Kernel::PlanarConv(_) => to.spread_of(from),
        // The rounding of an output depends on the whole input of its tile.
        Kernel::Winograd(conv) => {
            to.spread_of(from);
            to.fill_tiles(conv.tile().size(), scratch);
        }
        Kernel::MaxPool => to.shrunk_from(from, 2),
        Kernel::AveragePool(size) => to.shrunk_from(from, *size),
        Kernel::UpConv(_) => to.doubled_from(from),
        Kernel::PooledConv(_) => {
            scratch.become_none(from.size());
            scratch.spread_of(from);
            to.shrunk_from(scratch, 2);
        }
        Kernel::Conv1(_) | Kernel::Alias => to.clone_from(from),
        // A global mean couples every pixel.
        _ if from.is_empty() => to.clear(),
        _ => to.set_all(),
    }
}
