//! The order of the stages: the one place that knows it.
//!
//! An insertion or an expiry runs the structural stages at once, downstream along the levels: window, event graph,
//! pooled graphs, readout membership. Rows are computed when a prediction is read, each level before the next: blocks,
//! maxima, positions and attributes, blocks, ..., readout, dense layers; the changes of several events meet in one
//! wave. With `frozen` in-edges the event level alone runs on arrival: its rows never change, and by the time of a
//! prediction what they read may have left.

use std::sync::Arc;

use meissner_kernels::{Isa, Lanes};

use crate::activations::Activations;
use crate::cells::CellGrid;
use crate::counters::Log;
use crate::delta::Delta;
use crate::engine::Options;
use crate::graph::{Adjacency, EventGraph};
use crate::metric::Node;
use crate::network::Network;
use crate::pooled::{Below, PooledGraph};
use crate::readout::{Head, Top};
use crate::stages::{Stage, Stopwatch};
use crate::window::Window;
use crate::{EngineError, Sensor};

/// Everything that a stream of events has made of an engine.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    network: Arc<Network>,
    isa: Isa,
    poison: bool,
    pub(crate) window: Window,
    pub(crate) graph: EventGraph,
    pub(crate) pooled: Vec<PooledGraph>,
    /// One per level.
    pub(crate) activations: Vec<Activations>,
    head: Head,
    delta: Delta,
    downstream: Delta,
    pub(crate) stopwatch: Stopwatch,
}

impl Step {
    pub(crate) fn new(network: Arc<Network>, sensor: Sensor, options: &Options) -> Self {
        let parts = network.parts();
        let (span_us, capacity) = (parts.span_us, parts.capacity);
        let follows_edges = parts.pooled.iter().any(|(_, level)| !level.blocks.is_empty());
        let graph = EventGraph::new(parts.graph, sensor, span_us, &parts.events, capacity, follows_edges);
        // Rows that never change have nothing to be compared with.
        let of_events = if parts.graph.is_frozen() { 0.0 } else { options.tolerance };
        let mut activations = vec![Activations::new(capacity, network.channels(0), of_events)];
        let mut pooled: Vec<PooledGraph> = Vec::new();
        let mut rows = capacity;
        for (i, (pooling, level)) in parts.pooled.iter().enumerate() {
            let grid = CellGrid::new(pooling.clone(), pooled.last().map(PooledGraph::grid), sensor, span_us);
            let slots = grid.slots();
            let queues = i == 0 && parts.graph.is_frozen();
            pooled.push(PooledGraph::new(grid, level, rows, network.channels(i + 1)[0], queues));
            activations.push(Activations::new(slots, network.channels(i + 1), options.tolerance));
            rows = slots;
        }
        Self {
            head: Head::new(&network, sensor, rows, options.isa),
            window: Window::new(capacity),
            graph,
            pooled,
            activations,
            isa: options.isa,
            poison: options.poison,
            delta: Delta::default(),
            downstream: Delta::default(),
            stopwatch: Stopwatch::new(options.stage_times),
            network,
        }
    }

    /// Bytes that `new` would take, about; [`u128::MAX`] where rows are too many to be counted.
    pub(crate) fn bytes(network: &Network, sensor: Sensor) -> u128 {
        let parts = network.parts();
        let capacity = parts.capacity;
        let mut bytes = Window::bytes(capacity) as u128
            + EventGraph::bytes(parts.graph, sensor, &parts.events, capacity) as u128
            + Activations::bytes(capacity, network.channels(0)) as u128;
        let (mut rows, mut below) = (capacity, None);
        for (i, (pooling, _)) in parts.pooled.iter().enumerate() {
            let grid = CellGrid::new(pooling.clone(), below.as_ref(), sensor, parts.span_us);
            let slots = grid.slots();
            // Rows are counted in 32 bits.
            if u32::try_from(slots).is_err() {
                return u128::MAX;
            }
            let queues = i == 0 && parts.graph.is_frozen();
            bytes += PooledGraph::bytes(slots, rows, network.channels(i + 1)[0], queues) as u128
                + Activations::bytes(slots, network.channels(i + 1)) as u128;
            (rows, below) = (slots, Some(grid));
        }
        bytes + Head::bytes(network, rows)
    }

    /// Takes from `own`, of an equal network, everything that reaches no result: the instruction set, poison, measured times.
    pub(crate) fn run_as(&mut self, own: &Self) {
        self.network = Arc::clone(&own.network);
        self.isa = own.isa;
        self.poison = own.poison;
        self.stopwatch = own.stopwatch.clone();
        self.head.set_isa(own.isa);
    }

    /// Every node leaves.
    pub(crate) fn clear(&mut self) {
        if self.poison {
            for level in 0..self.activations.len() {
                let rows = self.rows(level);
                rows.into_iter().for_each(|row| self.activations[level].leave(row, true));
            }
        }
        self.graph.clear(&self.window);
        for (pooled, activations) in self.pooled.iter_mut().zip(&mut self.activations[1..]) {
            pooled.clear(activations.input_mut().0);
        }
        self.activations.iter_mut().for_each(Activations::clear);
        self.head.clear();
        self.window.clear();
    }

    /// `node` enters, not earlier than any other; the window must have room.
    pub(crate) fn enter(&mut self, node: Node, log: &mut Log) {
        self.stopwatch.start();
        let slot = self.connect(node, usize::MAX);
        self.stopwatch.lap(Stage::EventGraph);
        if self.network.parts().graph.is_frozen() {
            let level = &self.network.parts().events;
            self.activations[0].run_row(level, slot, &self.graph, self.isa, &mut log.layers);
            self.stopwatch.lap(Stage::EventLayers);
        }
        self.propagate();
        self.stopwatch.lap(Stage::PooledGraphs);
    }

    /// `node` enters as it once did: of its neighbourhood it reads the first `known`, and rows that are computed on arrival
    /// are not; how many in-edges it has now.
    pub(crate) fn enter_known(&mut self, node: Node, known: usize) -> usize {
        let slot = self.connect(node, known);
        self.propagate();
        self.graph.neighbours(slot).len()
    }

    /// The structural stages of the event level, and its input.
    fn connect(&mut self, node: Node, known: usize) -> u32 {
        let slot = self.window.push(node);
        self.delta.clear();
        self.delta.entered.push(slot);
        self.graph.insert(&self.window, slot, known, &mut self.delta);
        let events = &mut self.activations[0];
        events.enter(slot);
        events.input_mut().0.row_mut(slot as usize)[0] = first_lane(node.sign());
        if !self.network.parts().graph.is_frozen() {
            self.delta.rewired.iter().for_each(|&row| events.rewire(row));
        }
        slot
    }

    /// The oldest `leaving` nodes leave.
    pub(crate) fn leave(&mut self, leaving: u32) {
        if leaving as usize == self.window.len() {
            self.clear();
            return;
        }
        self.stopwatch.start();
        self.delta.clear();
        self.delta.left.extend(self.window.slots().take(leaving as usize));
        self.graph.expire(&self.window, leaving, &mut self.delta);
        let events = &mut self.activations[0];
        self.delta.rewired.iter().for_each(|&row| events.rewire(row));
        self.stopwatch.lap(Stage::EventGraph);
        self.propagate();
        self.window.pop(leaving);
        self.stopwatch.lap(Stage::PooledGraphs);
    }

    /// Hands `delta` down the levels; what left is forgotten behind it.
    fn propagate(&mut self) {
        for p in 0..self.pooled.len() {
            let (lower, upper) = self.pooled.split_at_mut(p);
            let below = lower.last().map_or(Below::Events(&self.window), Below::Cells);
            let (features, own) = self.activations.split_at_mut(p + 1);
            let from = self.network.parts().pooled[p].0.from;
            let values = own[0].feature(0);
            upper[0].apply(below, features[p].feature(from), values, &self.delta, &mut self.downstream);
            self.downstream.entered.iter().for_each(|&row| own[0].enter(row));
            self.downstream.rewired.iter().for_each(|&row| own[0].rewire(row));
            self.delta.left.iter().for_each(|&row| features[p].leave(row, self.poison));
            std::mem::swap(&mut self.delta, &mut self.downstream);
        }
        let last = self.activations.len() - 1;
        let top = Top { activations: &self.activations[last], pooled: self.pooled.last() };
        self.head.apply(&self.window, &top, &self.delta);
        self.delta.left.iter().for_each(|&row| self.activations[last].leave(row, self.poison));
    }

    /// Computes what the steps since the last call affect, up to the prediction at `now`, in microseconds since the epoch.
    pub(crate) fn settle(&mut self, now: i64, log: &mut Log) {
        self.stopwatch.start();
        let parts = self.network.parts();
        let mut layers = &mut log.layers[..];
        if !parts.graph.is_frozen() {
            self.activations[0].run(&parts.events, &self.graph, self.isa, layers);
        }
        self.stopwatch.lap(Stage::EventLayers);
        layers = &mut layers[parts.events.blocks.len()..];
        for (p, (pooling, level)) in parts.pooled.iter().enumerate() {
            let (lower, upper) = self.pooled.split_at_mut(p);
            let (below, own) = self.activations.split_at_mut(p + 1);
            let (graph, own, below) = (&mut upper[0], &mut own[0], &below[p]);
            let (features, changed) = (below.feature(pooling.from), below.changed(pooling.from));
            let (values, moved) = own.input_mut();
            graph.maxima.settle(self.isa, features, changed, values, &mut layers[0], |cell, alive| {
                if alive {
                    moved.insert(cell);
                }
            });
            self.stopwatch.lap(Stage::PooledMaxima);
            if let Some(lower) = lower.last() {
                lower.shifted().as_slice().iter().for_each(|&row| graph.member_shifted(row));
            }
            let below = lower.last().map_or(Below::Events(&self.window), Below::Cells);
            graph.settle(below, &mut log.predictions, |cell| own.rewire(cell));
            self.stopwatch.lap(Stage::PooledAttributes);
            own.run(level, graph, self.isa, &mut layers[1..]);
            self.stopwatch.lap(Stage::PooledLayers);
            layers = &mut layers[1 + level.blocks.len()..];
        }
        let last = self.activations.len() - 1;
        let top = Top { activations: &self.activations[last], pooled: self.pooled.last() };
        let moved = self.head.settle(&top, now, self.isa, &mut log.predictions);
        self.stopwatch.lap(Stage::Readout);
        if moved {
            self.head.run(&self.network, self.isa);
            self.stopwatch.lap(Stage::Dense);
        }
        self.activations.iter_mut().for_each(Activations::finish);
        self.pooled.iter_mut().for_each(PooledGraph::finish);
    }

    /// The prediction as of the last `settle`.
    pub(crate) fn prediction(&self) -> Result<&[f32], EngineError> {
        match self.not_a_number() {
            Some(error) => Err(error),
            None => Ok(self.head.prediction()),
        }
    }

    /// Slots of a level's rows, in the order of a batch.
    pub(crate) fn rows(&self, level: usize) -> Vec<u32> {
        if level == 0 { self.window.slots().collect() } else { self.pooled[level - 1].cells() }
    }

    /// Number of rows in use at a level.
    pub(crate) fn nodes(&self, level: usize) -> usize {
        if level == 0 { self.window.len() } else { self.pooled[level - 1].nodes() }
    }

    fn not_a_number(&self) -> Option<EngineError> {
        let error = |layer: &str, rows| EngineError::NotANumber { layer: layer.to_owned(), rows };
        for (level, activations) in self.activations.iter().enumerate() {
            if let Some((block, rows)) = activations.not_a_number() {
                return Some(error(&self.network.level(level).blocks[block].name, rows));
            }
        }
        self.head.failure(&self.network)
    }
}

/// `value` and zeros.
fn first_lane(value: f32) -> Lanes {
    let mut lanes = Lanes::ZERO;
    lanes.0[0] = value;
    lanes
}
