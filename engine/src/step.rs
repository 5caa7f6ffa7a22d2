//! The execution order of the stages, which is defined only here.
//!
//! An insertion or expiry runs the structural stages at once: window, event graph, pooled graphs,
//! readout membership. Rows are computed when a prediction is read, level by level: blocks, maxima,
//! positions and attributes, ..., readout, dense layers, over all changes. With `frozen` in-edges
//! the event level runs on arrival: its rows never change, and their inputs may leave. The rows of
//! a slice of events wait ([`Arrivals`]) and are computed together, layer by layer.

use std::sync::Arc;

use meissner_kernels::{Isa, Matrix};

use crate::activations::Activations;
use crate::counters::{Log, Stage, Stopwatch};
use crate::graph::{EventGraph, WAVE};
use crate::memory::{FixedVec, Memory};
use crate::metric::{Input, Node};
use crate::network::Network;
use crate::options::Options;
use crate::pooled::{Below, PooledGraph, Shape};
use crate::readout::{LastLevel, ReadoutState};
use crate::rows::{Delta, PART};
use crate::unlikeness::{WindowStatistics, WindowSums};
use crate::window::Window;
use crate::{EngineError, Sensor};

/// The state that a stream of events has produced in an engine.
#[derive(Clone, Debug)]
pub(crate) struct StageState {
    network: Arc<Network>,
    isa: Isa,
    poison: bool,
    pub(crate) window: Window,
    /// Present if the network has statistics of its training.
    sums: Option<WindowSums>,
    input: Input,
    pub(crate) graph: EventGraph,
    pub(crate) pooled: Vec<PooledGraph>,
    pub(crate) activations: Vec<Activations>,
    readout: ReadoutState,
    arrivals: Arrivals,
    delta: Delta,
    downstream: Delta,
    pub(crate) stopwatch: Stopwatch,
}

/// At most [`WAVE`] rows with `frozen` in-edges that are not computed yet. A layer reads only the
/// layer below, so they can be computed together, before a node that one of them reads leaves.
#[derive(Clone, Debug)]
struct Arrivals {
    rows: FixedVec<u32>,
    /// Index in the window of the earliest node that a waiting row belongs to or reads; undefined
    /// if no row waits.
    earliest: u32,
}

impl Arrivals {
    /// Contains no rows yet, and never contains rows if `waits` is false.
    fn new(waits: bool, memory: &mut Memory) -> Self {
        Self { rows: memory.room(if waits { WAVE } else { 0 }), earliest: 0 }
    }

    /// Adds `row`; `earliest` is the index in the window of its earliest in-edge or of its own
    /// node.
    fn push(&mut self, row: u32, earliest: u32) {
        self.earliest = if self.rows.is_empty() { earliest } else { self.earliest.min(earliest) };
        self.rows.push(row);
    }

    /// Whether some of them read one of the oldest `leaving` nodes.
    fn read_any_of(&self, leaving: u32) -> bool {
        !self.rows.is_empty() && self.earliest < leaving
    }

    /// Records that the oldest `leaving` nodes, which no waiting row reads, have left the window.
    fn left(&mut self, leaving: u32) {
        self.earliest = self.earliest.saturating_sub(leaving);
    }
}

impl StageState {
    /// The state before the first event. If rows are too many to number, `memory` counts
    /// [`u128::MAX`] bytes.
    pub(crate) fn new(network: Arc<Network>, sensor: Sensor, options: &Options, memory: &mut Memory) -> Self {
        let parts = network.parts();
        let (span_us, slots) = (parts.span_us, Window::slots_for(parts.capacity));
        let most = parts.graph.reach.most();
        let follows_edges = parts.pooled.iter().any(|(_, level)| !level.blocks.is_empty());
        let graph =
            EventGraph::new(parts.graph, sensor, span_us, &parts.events, slots, follows_edges, memory);
        // Rows that never change need no tolerance.
        let of_events = if parts.graph.is_frozen() { 0.0 } else { options.tolerance };
        let channels = network.channels(0);
        let mut activations = Vec::with_capacity(network.levels());
        activations.push(Activations::new(slots, &parts.events, channels, most, of_events, options, memory));
        let mut pooled = Vec::with_capacity(parts.pooled.len());
        let mut rows = slots;
        let (shapes, all) = Shape::all(&network, sensor);
        if !all {
            memory.add(u128::MAX);
        }
        for (i, (shape, (_, level))) in shapes.into_iter().zip(&parts.pooled).enumerate() {
            let channels = network.channels(i + 1);
            rows = shape.slots();
            let mut own =
                Activations::new(rows, level, channels, shape.most(), options.tolerance, options, memory);
            if !memory.counts_only {
                own.grow(rows);
            }
            activations.push(own);
            pooled.push(PooledGraph::new(shape, level, memory));
        }
        let tells_edges = graph.tells_edges();
        Self {
            readout: ReadoutState::new(&network, sensor, rows, options.isa, memory),
            window: Window::new(parts.capacity, memory),
            sums: network.training_windows().map(|_| WindowSums::new(sensor, memory)),
            input: Input::new(parts.place, sensor, memory),
            arrivals: Arrivals::new(parts.graph.is_frozen(), memory),
            graph,
            pooled,
            activations,
            isa: options.isa,
            poison: options.hooks.poison,
            downstream: Delta::new(slots, most, tells_edges, memory),
            delta: Delta::new(slots, most, tells_edges, memory),
            stopwatch: Stopwatch::new(options.stage_times),
            network,
        }
    }

    /// Copies the settings that do not affect results: instruction set, poison, measured times.
    pub(crate) fn run_as(&mut self, own: &Self) {
        self.network = Arc::clone(&own.network);
        self.isa = own.isa;
        self.poison = own.poison;
        self.stopwatch = own.stopwatch.clone();
        self.readout.set_isa(own.isa);
        // The same network without statistics of its training has the same fingerprint.
        if self.sums.is_some() != own.sums.is_some() {
            self.sums = own.sums.as_ref().map(|own| own.of(&self.window));
        }
    }

    pub(crate) fn clear(&mut self) {
        if let Some(sums) = &mut self.sums {
            self.window.slots().for_each(|slot| sums.leave(self.window.node(slot)));
        }
        self.graph.clear(&self.window);
        for (pooled, activations) in self.pooled.iter_mut().zip(&mut self.activations[1..]) {
            pooled.clear(activations.input_mut().0);
        }
        self.activations.iter_mut().for_each(|level| level.clear(self.poison));
        self.readout.clear();
        self.window.clear();
        self.arrivals.rows.clear();
    }

    /// Inserts `node`, the newest; the window must have room. With `frozen` in-edges, its row waits
    /// for [`Self::compute_arrivals`].
    pub(crate) fn enter(&mut self, node: Node, log: &mut Log) {
        if self.arrivals.rows.len() == WAVE {
            self.compute_arrivals(log);
        }
        self.stopwatch.start();
        let slot = self.connect(node, usize::MAX);
        if self.network.parts().graph.is_frozen() {
            let earliest =
                self.graph.sources(slot).chain([slot]).map(|slot| self.window.age_rank(slot)).min();
            self.arrivals.push(slot, earliest.unwrap_or(0));
        }
        self.stopwatch.lap(Stage::EventGraph);
        self.propagate();
        self.stopwatch.lap(Stage::PooledGraphs);
    }

    /// Computes the waiting rows.
    pub(crate) fn compute_arrivals(&mut self, log: &mut Log) {
        if self.arrivals.rows.is_empty() {
            return;
        }
        self.stopwatch.start();
        let (level, rows) = (&self.network.parts().events, &self.arrivals.rows);
        self.activations[0].run_rows(level, rows, &self.graph, self.isa, &mut log.layers);
        self.arrivals.rows.clear();
        self.stopwatch.lap(Stage::EventLayers);
    }

    /// Inserts `node` from a snapshot: it reads the first `known` nodes of its neighbourhood, and
    /// no row is computed on arrival. Returns its number of in-edges.
    pub(crate) fn enter_known(&mut self, node: Node, known: usize) -> usize {
        let slot = self.connect(node, known);
        self.propagate();
        self.graph.degree(slot)
    }

    /// Runs the structural stages of the event level and sets its input.
    fn connect(&mut self, node: Node, known: usize) -> u32 {
        let slot = self.window.push(node);
        if let Some(sums) = &mut self.sums {
            sums.enter(node);
        }
        self.delta.clear();
        self.delta.entered.push(slot);
        self.activations[0].prefetch_row(slot);
        self.graph.insert(&self.window, slot, known, self.isa, &mut self.delta);
        let events = &mut self.activations[0];
        if events.feature(0).rows() < self.window.slots_used() {
            events.grow(self.window.slots_used());
        }
        events.enter(slot);
        events.input_mut().0.row_mut(slot as usize)[0] = self.input.row(node);
        self.delta.rewired.iter().for_each(|&row| events.rewire(row));
        slot
    }

    pub(crate) fn leave(&mut self, leaving: u32, log: &mut Log) {
        if self.arrivals.read_any_of(leaving) {
            self.compute_arrivals(log);
        }
        self.arrivals.left(leaving);
        if leaving as usize == self.window.len() {
            self.clear();
            return;
        }
        self.stopwatch.start();
        self.delta.clear();
        self.graph.hide(&self.window, leaving);
        for place in 0..leaving {
            let slot = self.window.slot_of(place);
            if let Some(sums) = &mut self.sums {
                sums.leave(self.window.node(slot));
            }
            self.graph.disconnect(&self.window, leaving, slot, self.isa, &mut self.delta);
            // In parts: edges must be removed before either of their nodes.
            if self.delta.removed.len() >= PART {
                self.follow();
                self.delta.clear();
            }
        }
        self.delta.left.extend(self.window.slots().take(leaving as usize));
        self.follow();
        self.window.pop(leaving);
        self.stopwatch.lap(Stage::PooledGraphs);
    }

    /// Passes the expired parts of the event graph to all levels.
    fn follow(&mut self) {
        let events = &mut self.activations[0];
        self.delta.rewired.iter().for_each(|&row| events.rewire(row));
        self.stopwatch.lap(Stage::EventGraph);
        self.propagate();
        self.stopwatch.lap(Stage::PooledGraphs);
    }

    /// Passes `delta` through the levels; then removes the rows that left.
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
        let level = LastLevel { activations: &self.activations[last], pooled: self.pooled.last() };
        self.readout.apply(&self.window, &level, &self.delta);
        self.delta.left.iter().for_each(|&row| self.activations[last].leave(row, self.poison));
    }

    /// Recomputes the effects of all steps since the last call, up to the prediction at `now`.
    pub(crate) fn compute_changes(&mut self, now: i64, log: &mut Log) {
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
            graph.maxima.update(self.isa, features, changed, values, &mut layers[0], |cell, alive| {
                if alive {
                    moved.insert(cell);
                }
            });
            self.stopwatch.lap(Stage::PooledMaxima);
            if let Some(lower) = lower.last() {
                lower.shifted.as_slice().iter().for_each(|&row| graph.member_shifted(row));
            }
            let below = lower.last().map_or(Below::Events(&self.window), Below::Cells);
            graph.update_positions(below, &mut log.predictions, |cell| own.rewire(cell));
            self.stopwatch.lap(Stage::PooledAttributes);
            own.run(level, graph, self.isa, &mut layers[1..]);
            self.stopwatch.lap(Stage::PooledLayers);
            layers = &mut layers[1 + level.blocks.len()..];
        }
        let last = self.activations.len() - 1;
        let level = LastLevel { activations: &self.activations[last], pooled: self.pooled.last() };
        let moved = self.readout.update(&level, now, self.isa, &mut log.predictions);
        self.stopwatch.lap(Stage::Readout);
        if moved {
            self.readout.run(&self.network, self.isa);
            self.stopwatch.lap(Stage::Dense);
        }
        self.activations.iter_mut().for_each(Activations::finish);
        self.pooled.iter_mut().for_each(PooledGraph::finish);
    }

    pub(crate) fn prediction(&self) -> Result<&[f32], EngineError> {
        match self.not_a_number() {
            Some(error) => Err(error),
            None => Ok(&self.readout.prediction),
        }
    }

    /// Statistics of the window at `now`, if they are kept.
    pub(crate) fn statistics(&self, now: i64) -> Option<WindowStatistics> {
        self.sums.as_ref().map(|sums| sums.at(now))
    }

    pub(crate) fn readout(&self) -> &Matrix {
        self.readout.values()
    }

    /// Slots of a level's rows, in batch order.
    pub(crate) fn rows(&self, level: usize) -> Vec<u32> {
        if level == 0 { self.window.slots().collect() } else { self.pooled[level - 1].cells() }
    }

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
        self.readout.failure(&self.network)
    }
}
