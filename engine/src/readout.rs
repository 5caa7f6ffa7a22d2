//! The readout: from the last level's features to its grid and, through the head, the prediction.
//!
//! Input: the last level's delta, its changed rows and, above a pooling, its positions. Output: the
//! prediction. A node belongs to the readout cell that contains its position; the cell of an event
//! is computed in integers. Nothing is recomputed if no value of the grid changed.
//!
//! With separate time cells, the grid's rows are a ring over them: a new cell replaces the one that
//! has left, no row moves, and the head reads grids from newest to oldest.

use meissner_kernels::{Isa, Matrix};

use crate::activations::Activations;
use crate::counters::{LayerLog, PredictionCounters};
use crate::head::Head;
use crate::maxima::Maxima;
use crate::memory::Memory;
use crate::network::{Aggregation, Network, Readout};
use crate::pooled::PooledGraph;
use crate::rows::{Delta, RowSet};
use crate::sums::Sums;
use crate::window::Window;
use crate::{EngineError, Fraction, Sensor};

/// Maps nodes to cells of the readout's grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadoutGrid {
    readout: Readout,
    sensor: Sensor,
}

impl ReadoutGrid {
    pub(crate) fn new(readout: Readout, sensor: Sensor) -> Self {
        Self { readout, sensor }
    }

    pub(crate) fn cells(&self) -> usize {
        self.readout.columns * self.readout.rows
    }

    pub(crate) fn of_pixel(&self, x: u16, y: u16) -> u32 {
        let column = usize::from(x) * self.readout.columns / usize::from(self.sensor.width);
        let row = usize::from(y) * self.readout.rows / usize::from(self.sensor.height);
        (row * self.readout.columns + column) as u32
    }

    /// Cell of a pooled node's position; positions beyond the image belong to its edge.
    pub(crate) fn of_position(&self, [x, y, _]: [f64; 3]) -> u32 {
        let axis = |p: f64, cells: usize| ((p * cells as f64).floor().max(0.0) as usize).min(cells - 1);
        let (column, row) = (axis(x, self.readout.columns), axis(y, self.readout.rows));
        (row * self.readout.columns + column) as u32
    }
}

/// Aggregation of the rows that the grid reads: maxima or sums.
#[derive(Clone, Debug)]
enum Cells {
    Maxima(Maxima),
    /// Only for events.
    Sums(Sums),
}

/// The readout's grid, the head, and its last prediction.
#[derive(Clone, Debug)]
pub(crate) struct ReadoutState {
    grid: ReadoutGrid,
    cells: Cells,
    values: Matrix,
    /// Number of separate time cells; 1 if they are not separate.
    times: usize,
    /// Length of a time cell as a fraction of the span, and the span.
    time: Option<(Fraction, i64)>,
    /// The newest time cell as of the last `update`.
    newest: i64,
    /// Rows of `values` that have changed since the last prediction.
    stale: RowSet,
    /// `values` from the newest time cell to the oldest, if there are several, and its stale rows.
    by_age: Matrix,
    stale_by_age: RowSet,
    head: Head,
    /// Pooled nodes whose cell is not known yet.
    entered: RowSet,
    pub(crate) prediction: Vec<f32>,
    valid: bool,
}

pub(crate) struct LastLevel<'a> {
    pub(crate) activations: &'a Activations,
    pub(crate) pooled: Option<&'a PooledGraph>,
}

impl ReadoutState {
    pub(crate) fn new(network: &Network, sensor: Sensor, rows: usize, isa: Isa, memory: &mut Memory) -> Self {
        let grid = ReadoutGrid::new(network.parts().readout, sensor);
        let channels = network.readout_channels();
        let times = network.readout_times();
        let cells = grid.cells() * times;
        let aged = if times > 1 { cells } else { 0 };
        Self {
            cells: match grid.readout.aggregation {
                Aggregation::Max => {
                    Cells::Maxima(Maxima::new(rows, cells, channels, Self::reads_queues(network), memory))
                }
                Aggregation::Sum => {
                    Cells::Sums(Sums::new(network.sum_part_us(), rows, cells, channels, memory))
                }
            },
            values: memory.matrix(cells, channels),
            time: network.readout_time().map(|size| (size, network.parts().span_us)),
            newest: 0,
            stale: RowSet::within(cells, memory),
            by_age: memory.matrix(aged, channels),
            stale_by_age: RowSet::within(aged, memory),
            times,
            head: Head::new(network, isa, memory),
            entered: RowSet::within(rows, memory),
            prediction: memory.copies(0.0, network.outputs()),
            valid: false,
            grid,
        }
    }

    /// Whether the rows that it reads never change and leave in order of arrival.
    fn reads_queues(network: &Network) -> bool {
        network.parts().graph.is_frozen() && network.parts().pooled.is_empty()
    }

    pub(crate) fn set_isa(&mut self, isa: Isa) {
        self.head.set_isa(isa);
    }

    pub(crate) fn clear(&mut self) {
        match &mut self.cells {
            Cells::Maxima(maxima) => maxima.clear(&mut self.values),
            Cells::Sums(sums) => sums.clear(&mut self.values),
        }
        self.entered.clear();
        self.all_stale();
        self.valid = false;
    }

    fn all_stale(&mut self) {
        (0..self.values.rows() as u32).for_each(|row| self.stale.insert(row));
    }

    pub(crate) fn apply(&mut self, window: &Window, last: &LastLevel<'_>, delta: &Delta) {
        for &row in delta.entered.iter() {
            if last.pooled.is_some() {
                self.entered.insert(row);
            } else {
                let node = window.node(row);
                let cell = self.grid.of_pixel(node.x, node.y);
                match &mut self.cells {
                    Cells::Maxima(maxima) => maxima.enter(row, cell),
                    Cells::Sums(sums) => sums.enter(row, cell, node.t),
                }
            }
        }
        for &row in delta.left.iter() {
            if self.entered.contains(row) {
                self.entered.remove(row);
            } else {
                match &mut self.cells {
                    Cells::Maxima(maxima) => {
                        maxima.leave(row, last.activations.feature(self.grid.readout.from), &self.values);
                    }
                    Cells::Sums(sums) => sums.leave(row),
                }
            }
        }
    }

    /// Brings pooled nodes to their readout cells, each in the grid of its time cell.
    fn place(&mut self, pooled: &PooledGraph) {
        let Cells::Maxima(maxima) = &mut self.cells else { return };
        let cell_of = |row: u32| {
            let place = pooled.time_cell(row) as usize % self.times;
            (place * self.grid.cells()) as u32 + self.grid.of_position(pooled.position(row))
        };
        for &row in pooled.shifted.as_slice() {
            let cell = cell_of(row);
            if !self.entered.contains(row) && cell != maxima.cell_of(row) {
                maxima.relocate(row, cell);
            }
        }
        for &row in self.entered.as_slice() {
            maxima.enter(row, cell_of(row));
        }
        self.entered.clear();
    }

    /// Updates the readout at `now` (from the epoch); returns whether the prediction must be
    /// recomputed.
    pub(crate) fn update(
        &mut self,
        last: &LastLevel<'_>,
        now: i64,
        isa: Isa,
        counters: &mut PredictionCounters,
    ) -> bool {
        if let Some((size, span_us)) = self.time {
            let newest = size.cell(now.into(), span_us.into()) as i64;
            if newest != self.newest {
                self.newest = newest;
                self.all_stale();
                self.valid = false;
            }
        }
        if let Some(pooled) = last.pooled {
            self.place(pooled);
        }
        let from = self.grid.readout.from;
        let (features, changed) = (last.activations.feature(from), last.activations.changed(from));
        let (values, stale) = (&mut self.values, &mut self.stale);
        let mut log = LayerLog::default();
        match &mut self.cells {
            Cells::Maxima(maxima) => {
                maxima.update(isa, features, changed, values, &mut log, |cell, _| stale.insert(cell));
            }
            Cells::Sums(sums) => {
                sums.update(isa, features, changed, values, &mut log, |cell| stale.insert(cell));
            }
        }
        self.valid &= self.stale.len() == 0;
        counters.cells_recomputed += log.counters.recomputed;
        counters.cells_unchanged += log.counters.unchanged;
        counters.read += 1;
        counters.reused += u64::from(self.valid);
        !self.valid
    }

    pub(crate) fn run(&mut self, network: &Network, isa: Isa) {
        if self.times > 1 {
            self.stale_by_age.clear();
            for &row in self.stale.as_slice() {
                let (place, cell) = (row as usize / self.grid.cells(), row as usize % self.grid.cells());
                let age = (self.newest - place as i64).rem_euclid(self.times as i64) as usize;
                let aged = age * self.grid.cells() + cell;
                self.by_age.row_mut(aged).copy_from_slice(self.values.row(row as usize));
                self.stale_by_age.insert(aged as u32);
            }
        }
        let (readout, changed) =
            if self.times > 1 { (&self.by_age, &self.stale_by_age) } else { (&self.values, &self.stale) };
        self.head.run(network, isa, readout, self.grid.cells(), changed.as_slice(), &mut self.prediction);
        self.stale.clear();
        self.valid = true;
    }

    /// The cells that the last prediction was computed from; (times, cells, channels).
    pub(crate) fn values(&self) -> &Matrix {
        if self.times > 1 { &self.by_age } else { &self.values }
    }

    pub(crate) fn failure(&self, network: &Network) -> Option<EngineError> {
        self.head.failure(network)
    }
}
