//! State of a frame engine, and the order in which its layers run.
//!
//! Each layer records its inputs' changed pixels since it last ran. Layers with a state, and their
//! inputs, run for every frame; the others at a prediction, over the changes of several frames.

mod snapshot;

use super::buffer::Buffer;
use super::changes::{Changes, Pending};
use super::compile::{FrameNetwork, Kernel};
use super::layers::{Memory, Run, Scratch, spread};
use super::network::FrameShape;
use super::options::{FrameOptions, Skip};
use super::unlikeness::FrameStatistics;
use crate::EngineError;
use crate::counters::{FrameCounters, FrameLayerCounters};

#[derive(Clone, Debug)]
pub(super) struct State {
    buffers: Vec<Buffer>,
    memories: Vec<Memory>,
    /// Changes that each layer has not processed yet.
    pending: Vec<Pending>,
    background: Option<Background>,
    scratch: Scratch,
    /// Changes of the layer that is running.
    changed: Changes,
    tiles: Changes,
    pub(super) prediction: Vec<f32>,
    /// Whether the last layer's output has changed since `prediction` was copied from it.
    stale: bool,
    pub(super) frames: u64,
    /// Statistics of the newest frames, if the network has statistics of its training.
    statistics: Option<FrameStatistics>,
    pub(super) counters: FrameCounters,
}

/// New values of adjacent channels of a pixel of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<'a> {
    /// Index of the pixel, row after row.
    pub(crate) pixel: usize,
    /// The first of the channels.
    pub(crate) first: usize,
    pub(crate) values: &'a [f32],
}

/// Outputs of all layers for a frame of zeros, and the pixels that may differ from them now.
#[derive(Clone, Debug)]
struct Background {
    buffers: Vec<Buffer>,
    /// For each value, the pixels that values other than zero may have reached; `None` if it
    /// depends on a state.
    reached: Vec<Option<Changes>>,
}

impl Background {
    /// Runs every layer on a frame of zeros and keeps the outputs.
    fn new(network: &FrameNetwork, options: FrameOptions) -> Result<Self, EngineError> {
        let mut state = State::without_background(network, options)?;
        let whole = options.with_skip(Skip::Nothing);
        state.push(network, whole, &vec![0.0; network.input().values()]);
        state.predict(network, whole);
        let mut stateful = vec![false; network.values.len()];
        for (i, unit) in network.units.iter().enumerate() {
            stateful[i + 1] = state.memories[i].is_state() || unit.reads().any(|read| stateful[read]);
        }
        let reached = |(value, &stateful): (&super::compile::Value, &bool)| {
            (!stateful && matches!(value.shape, FrameShape::Image { .. })).then(|| Changes::of(value.shape))
        };
        let reached = network.values.iter().zip(&stateful).map(reached).collect();
        Ok(Self { buffers: state.buffers, reached })
    }
}

impl State {
    pub(super) fn new(network: &FrameNetwork, options: FrameOptions) -> Result<Self, EngineError> {
        let background =
            options.stores_background().then(|| Background::new(network, options)).transpose()?;
        Ok(Self { background, ..Self::without_background(network, options)? })
    }

    fn without_background(network: &FrameNetwork, options: FrameOptions) -> Result<Self, EngineError> {
        let mut buffers = Vec::with_capacity(network.buffers.len());
        for (i, &shape) in network.buffers.iter().enumerate() {
            let buffer = if network.is_kept(i) {
                let layer = || network.value_name(i).to_owned();
                Buffer::zeros(shape, network.planar)
                    .map_err(|source| EngineError::Layer { layer: layer(), source })?
            } else {
                Buffer::Away
            };
            buffers.push(buffer);
        }
        let pending = network.units.iter().map(|unit| {
            let mut pixels = Changes::of(network.values[unit.from].shape);
            pixels.set_all();
            Pending { pixels, any: true }
        });
        let scratch = network.scratch(options);
        Ok(Self {
            memories: network.units.iter().map(|unit| Memory::new(unit, network)).collect(),
            pending: pending.collect(),
            buffers,
            background: None,
            scratch: Scratch::new(scratch),
            changed: Changes::with_bytes(scratch.marks),
            tiles: Changes::with_bytes(scratch.marks),
            prediction: vec![0.0; network.output().values()],
            stale: true,
            frames: 0,
            statistics: network.statistics(),
            counters: FrameCounters {
                layers: vec![FrameLayerCounters::default(); network.units.len()],
                ..FrameCounters::default()
            },
        })
    }

    pub(super) fn push(&mut self, network: &FrameNetwork, options: FrameOptions, frame: &[f32]) {
        if let Some(statistics) = &mut self.statistics {
            statistics.push(frame);
        }
        self.changed.become_none(network.values[0].shape.marks());
        let any = if options.skip == Skip::Nothing {
            self.changed.set_all();
            self.buffers[0].fill_from(frame);
            true
        } else {
            self.buffers[0].store(frame, &mut self.changed)
        };
        if let Some(Background { reached, .. }) = &mut self.background
            && let Some(Some(reached)) = reached.first_mut()
        {
            reached.clear();
            self.buffers[0].mark_nonzero(reached);
        }
        self.step(network, options, any);
    }

    /// Takes a frame that differs from the last only in `cells`: it marks all changes and reads
    /// nothing else. There is no tolerance and no background.
    pub(super) fn push_cells<'a>(
        &mut self,
        network: &FrameNetwork,
        options: FrameOptions,
        cells: impl Iterator<Item = Cell<'a>>,
    ) {
        let [_, width] = network.values[0].shape.marks();
        self.changed.become_none(network.values[0].shape.marks());
        let mut any = false;
        for Cell { pixel, first, values } in cells {
            let at = (pixel / width, pixel % width);
            any |= self.buffers[0].store_pixel(at, first, values, &mut self.changed);
        }
        self.step(network, options, any);
    }

    /// Runs the layers that run for every frame, after the changes of the frame are marked.
    fn step(&mut self, network: &FrameNetwork, options: FrameOptions, any: bool) {
        self.tell(network, 0, any);
        for i in 0..network.units.len() {
            if network.units[i].eager {
                self.run(network, options, i);
            }
        }
        self.frames += 1;
        self.counters.frames += 1;
    }

    pub(super) fn predict(&mut self, network: &FrameNetwork, options: FrameOptions) {
        for i in 0..network.units.len() {
            // Before the first frame, no state has made a step, and their inputs have not run.
            let waits = self.frames == 0 && !self.memories[i].is_state();
            if !network.units[i].eager || waits {
                self.run(network, options, i);
            }
        }
        if std::mem::take(&mut self.stale) {
            let value = network.values[network.units.len()];
            let [channels, ..] = value.shape.sides();
            self.buffers[value.buffer].flatten(value.first, channels, &mut self.prediction);
        }
        self.counters.predictions += 1;
    }

    /// Runs layer `i` and marks the changes for the layers that read it.
    fn run(&mut self, network: &FrameNetwork, options: FrameOptions, i: usize) {
        let unit = &network.units[i];
        let value = network.values[i + 1];
        let pending = &mut self.pending[i];
        let keeps_state = self.memories[i].is_state();
        if !pending.any && !keeps_state && options.skip != Skip::Nothing {
            self.counters.layers[i].skipped += value.shape.pixels();
            return;
        }
        // The output buffer is taken out, so that all others can be borrowed.
        let passes_on = matches!(unit.kernel, Kernel::Alias);
        let mut out = if passes_on {
            Buffer::Away
        } else {
            std::mem::replace(&mut self.buffers[value.buffer], Buffer::Away)
        };
        let mut reached = self.background.as_mut().and_then(|b| b.reached[i + 1].take());
        if let (Some(reached), Some(background)) = (&mut reached, &self.background) {
            for read in unit.reads() {
                if let Some(from) = &background.reached[read] {
                    if Some(read) == unit.with {
                        reached.include(from);
                    } else {
                        spread(&unit.kernel, from, reached, &mut self.tiles);
                    }
                }
            }
        }
        let run = Run {
            unit,
            options,
            input: &self.buffers[network.values[unit.from].buffer],
            with: unit.with.map(|with| &self.buffers[network.values[with].buffer]),
            from: network.values[unit.from],
            to: value,
            pending,
            background: self.background.as_ref().map(|b| &b.buffers[value.buffer]).zip(reached.as_ref()),
            memory: &mut self.memories[i],
            scratch: &mut self.scratch,
            counters: &mut self.counters.layers[i],
        };
        self.changed.become_none(value.shape.marks());
        let any = run.run(&mut out, &mut self.changed);
        if matches!(unit.kernel, Kernel::PooledConv(_)) {
            // Four pixels of the input per pixel of the output.
            let FrameLayerCounters { computed, skipped, absorbed } = self.counters.layers[i];
            self.counters.layers[unit.from - 1] =
                FrameLayerCounters { computed: 4 * computed, skipped: 4 * skipped, absorbed: 4 * absorbed };
        }
        if !passes_on {
            self.buffers[value.buffer] = out;
        }
        if let (Some(reached), Some(background)) = (reached, &mut self.background) {
            background.reached[i + 1] = Some(reached);
        }
        let pending = &mut self.pending[i];
        pending.pixels.clear();
        pending.any = false;
        self.tell(network, i + 1, any);
    }

    /// Marks the changes of `value` for the layers that read it.
    fn tell(&mut self, network: &FrameNetwork, value: usize, any: bool) {
        if !any {
            return;
        }
        self.stale |= value == network.units.len();
        for (unit, pending) in network.units.iter().zip(&mut self.pending) {
            if unit.from == value || unit.with == Some(value) {
                pending.any = true;
                pending.pixels.include(&self.changed);
            }
        }
    }

    pub(super) fn reset(&mut self, network: &FrameNetwork, options: FrameOptions) {
        self.memories.iter_mut().for_each(Memory::reset);
        self.frames = 0;
        self.statistics.iter_mut().for_each(FrameStatistics::reset);
        // With a tolerance, values must not be compared with those from before the reset.
        let compares = matches!(options.skip, Skip::Tolerance(_));
        // The frame and the outputs of states are zeros, as before the first frame.
        for (i, value) in network.values.iter().enumerate() {
            if i == 0 || compares || self.memories[i - 1].is_state() {
                self.changed.become_none(value.shape.marks());
                self.buffers[value.buffer].clear();
                self.changed.set_all();
                self.tell(network, i, true);
            }
        }
        if let Some(Background { reached, .. }) = &mut self.background {
            let forgotten = if compares { reached.len() } else { 1 };
            reached.iter_mut().take(forgotten).flatten().for_each(Changes::clear);
        }
    }

    pub(super) fn unlikeness(&self, network: &FrameNetwork) -> Option<f32> {
        Some(network.training()?.unlikeness(self.statistics.as_ref()?))
    }

    /// Takes the statistics of `network`, after the state of an equal network was copied, which may
    /// have other statistics.
    pub(super) fn know(&mut self, network: &FrameNetwork) {
        let mut statistics = network.statistics();
        if let Some(own) = &mut statistics {
            let sums = self.statistics.as_ref().filter(|other| other.is_like(own));
            let sums = sums.map_or(&[][..], FrameStatistics::sums);
            own.set(self.frames, sums, || self.frame(network));
        }
        self.statistics = statistics;
    }

    /// The newest frame.
    fn frame(&self, network: &FrameNetwork) -> Vec<f32> {
        let shape = network.input();
        let mut frame = vec![0.0; shape.values()];
        let value = network.values[0];
        self.buffers[value.buffer].flatten(value.first, shape.sides()[0], &mut frame);
        frame
    }

    pub(super) fn not_a_number(&self, network: &FrameNetwork) -> String {
        let nan = network.values.iter().skip(1).position(|value| self.buffers[value.buffer].has_nan());
        nan.map_or_else(String::new, |layer| network.units[layer].name.clone())
    }
}
