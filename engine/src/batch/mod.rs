//! The same network from scratch: the oracle of the incremental engine, and the way to run data sets.
//!
//! Nothing is shared with the engine but the kernels: neighbourhoods by comparing all pairs, or what someone else proposes,
//! poolings through ordered maps, plain loops over all rows. With [`Search::Grid`], which is there for speed, the search grid
//! and its metric are shared too, and the batch is no oracle.

mod events;
mod graph;
mod neighbours;
mod pool;
mod published;
mod search;
mod stream;

pub use graph::Graph;
pub use pool::Cells;
pub use search::{Places, Propose, Search};
pub use stream::Stream;

use std::ops::Range;
use std::sync::Arc;

use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, Neighbour, is_nan, maximum, settle};
use rayon::prelude::*;

use crate::convolution::{ConvolutionScratch, GraphConvolution};
use crate::frames::{FrameEngine, FrameNetwork, FrameOptions, Skip};
use crate::network::{Level, Network, Normalisation};
use crate::{EngineError, Sensor};

/// A network with a sensor, to run from scratch on any number of streams.
#[derive(Clone, Debug)]
pub struct Batch {
    network: Arc<Network>,
    sensor: Sensor,
    search: Search,
    isa: Isa,
    parallel: bool,
}

/// In-edges of consecutive rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edges {
    start: Vec<usize>,
    list: Vec<Neighbour>,
    /// The offset of each in-edge, where a block reads it.
    offsets: Vec<[f32; 3]>,
}

impl Edges {
    /// Appends a row with its in-edges.
    pub fn push(&mut self, row: impl IntoIterator<Item = Neighbour>) {
        self.start.push(self.list.len());
        self.list.extend(row);
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.start.len()
    }

    /// In-edges of `row`, in neighbourhood order.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, row: usize) -> &[Neighbour] {
        &self.list[self.span(row)]
    }

    fn span(&self, row: usize) -> Range<usize> {
        self.start[row]..self.start.get(row + 1).copied().unwrap_or(self.list.len())
    }

    /// What a block reads that computes `row`: its in-edges, its own input `own`, and what is added.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn read<'a>(&'a self, row: usize, own: &'a [Lanes], skip: Option<&'a [Lanes]>) -> GraphRow<'a> {
        let span = self.span(row);
        let offsets = self.offsets.get(span.clone()).unwrap_or_default();
        GraphRow { neighbours: &self.list[span], offsets, own, skip, ..GraphRow::default() }
    }
}

/// One level, computed from scratch.
#[derive(Clone, Debug)]
pub struct LevelTrace {
    /// Neighbourhood of each row.
    pub edges: Edges,
    /// What enters the level, then what each block wrote.
    pub features: Vec<Matrix>,
    /// Position of each row, in shares of sensor and span, time from the epoch. With [`Normalisation::PerGraph`] in
    /// float32, time from the first event of the window.
    pub positions: Vec<[f64; 3]>,
    /// Index of each row's cell along x, y and t; empty at the event level.
    pub cells: Vec<[i64; 3]>,
    /// Rows of the level below that each row pools, ascending; empty at the event level.
    pub members: Vec<Vec<usize>>,
    /// First row that is in the window; rows before it are there for `frozen` in-edges.
    pub first: usize,
}

/// Everything that a batch computed.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The event level, then one per pooling.
    pub levels: Vec<LevelTrace>,
    /// (cells, channels).
    pub readout: Matrix,
    /// The last dense layer's outputs.
    pub prediction: Vec<f32>,
}

impl Batch {
    /// `network` over the events of `sensor`, searched exhaustively.
    ///
    /// # Errors
    /// [`EngineError::Sensor`] for a sensor without pixels.
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor) -> Result<Self, EngineError> {
        if sensor.width == 0 || sensor.height == 0 {
            return Err(EngineError::Sensor(sensor));
        }
        let network = network.into();
        Ok(Self { network, sensor, search: Search::default(), isa: Isa::best(), parallel: false })
    }

    /// The same with another search; over data sets [`Search::Grid`] is the fastest.
    #[must_use]
    pub fn with_search(self, search: Search) -> Self {
        Self { search, ..self }
    }

    /// The same with another instruction set.
    #[must_use]
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// Whether the rows of one forward pass are shared among rayon's threads.
    #[must_use]
    pub fn with_parallel_rows(self, parallel: bool) -> Self {
        Self { parallel, ..self }
    }

    /// How neighbourhoods are found.
    pub fn search(&self) -> Search {
        self.search
    }

    /// The network.
    pub fn network(&self) -> &Arc<Network> {
        &self.network
    }

    /// The sensor.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// The prediction for each of `streams`, on all of rayon's threads.
    pub fn predict_all(&self, streams: &[Stream<'_>]) -> Vec<Result<Vec<f32>, EngineError>> {
        streams.par_iter().map(|stream| self.forward(*stream).map(|trace| trace.prediction)).collect()
    }

    /// Computes every row of every layer.
    ///
    /// Cost: n rows a layer, and the search.
    ///
    /// # Errors
    /// [`EngineError::Stream`] where an event is outside the sensor, before the epoch, before its predecessor or after
    /// the newest time, or where times are further apart than 64 bits say; [`EngineError::NotANumber`] where a row of
    /// the window, or the prediction, holds NaN; [`EngineError::FrameMemory`] for a head that takes more than 4 GiB.
    pub fn forward(&self, stream: Stream<'_>) -> Result<Trace, EngineError> {
        stream.check(self.sensor)?;
        let parts = self.network.parts();
        let mut levels = vec![events::level(self, stream)];
        self.run_blocks(&parts.events, &mut levels[0])?;
        let mut below_pooling = None;
        for (pooling, level) in &parts.pooled {
            let below = &levels[levels.len() - 1];
            let mut trace = pool::level(self, (pooling, level), below, below_pooling, stream);
            self.run_blocks(level, &mut trace)?;
            levels.push(trace);
            below_pooling = Some(pooling);
        }
        let readout = self.readout(&levels[levels.len() - 1], levels.len() == 1, stream);
        if let Some(head) = &parts.head {
            let prediction = self.over_image(head, &readout)?;
            return Ok(Trace { levels, readout, prediction });
        }
        let mut values = readout.clone();
        for layer in &parts.dense {
            let mut out = Matrix::zeros(1, layer.dense.outputs());
            layer.dense.run(self.isa, values.lanes(), out.row_mut(0));
            if is_nan(out.lanes()) {
                return Err(EngineError::NotANumber { layer: layer.name.clone(), rows: 1 });
            }
            values = out;
        }
        Ok(Trace { prediction: values.values(0).collect(), levels, readout })
    }

    /// Computes the blocks of a level whose input and edges are there.
    fn run_blocks(&self, level: &Level, trace: &mut LevelTrace) -> Result<(), EngineError> {
        for block in &level.blocks {
            let input = &trace.features[block.input];
            let skip = block.skip.map(|skip| &trace.features[skip]);
            let mut out = Matrix::zeros(input.rows(), block.conv.outputs());
            let rows: Vec<_> = (0..input.rows())
                .map(|row| trace.edges.read(row, input.row(row), skip.map(|skip| skip.row(row))))
                .collect();
            let compute = |scratch: &mut ConvolutionScratch, rows: &[GraphRow<'_>], out: &mut [Lanes]| {
                block.conv.rows(self.isa, input, rows, scratch, out);
            };
            if self.parallel {
                let lanes = GraphConvolution::GROUP * Lanes::count(block.conv.outputs());
                let groups =
                    rows.par_chunks(GraphConvolution::GROUP).zip(out.lanes_mut().par_chunks_mut(lanes));
                groups.for_each_init(ConvolutionScratch::default, |scratch, (rows, out)| {
                    compute(scratch, rows, out);
                });
            } else {
                compute(&mut ConvolutionScratch::default(), &rows, out.lanes_mut());
            }
            let rows = (trace.first..out.rows()).filter(|&row| is_nan(out.row(row))).count();
            if rows > 0 {
                return Err(EngineError::NotANumber { layer: block.name.clone(), rows });
            }
            trace.features.push(out);
        }
        Ok(())
    }

    /// Maximum over the readout's grid.
    fn readout(&self, top: &LevelTrace, events: bool, stream: Stream<'_>) -> Matrix {
        let readout = self.network.parts().readout;
        let features = &top.features[readout.from];
        let cells = readout.columns * readout.rows * self.network.readout_times();
        let mut out = Matrix::zeros(cells, features.columns());
        let mut members = vec![Vec::new(); out.rows()];
        for (row, cell) in (top.first..).zip(self.readout_cells(top, events, stream)) {
            members[cell].push(row);
        }
        for (cell, members) in members.iter().enumerate().filter(|(_, m)| !m.is_empty()) {
            maximum_of(features, members, out.row_mut(cell));
        }
        out
    }

    /// What `head` makes of the readout.
    fn over_image(&self, head: &Arc<FrameNetwork>, readout: &Matrix) -> Result<Vec<f32>, EngineError> {
        let options = FrameOptions::new().with_isa(self.isa).with_skip(Skip::Nothing);
        let cells = readout.rows() / self.network.readout_times();
        let value = |age: usize, c: usize, cell: usize| readout.values(age * cells + cell).nth(c);
        let image: Option<Vec<f32>> = (0..self.network.readout_times() * readout.columns() * cells)
            .map(|i| value(i / cells / readout.columns(), i / cells % readout.columns(), i % cells))
            .collect();
        let image = image.expect("every cell has every channel");
        if image.iter().any(|value| !value.is_finite()) {
            return Err(EngineError::NotANumber { layer: "readout".to_owned(), rows: 1 });
        }
        let mut engine = FrameEngine::with_options(Arc::clone(head), options)?;
        engine.push(&image)?;
        Ok(engine.predict()?.values.to_vec())
    }

    /// The readout's cell of each row of `top` that is in the window; whether `top` is the event level.
    fn readout_cells(&self, top: &LevelTrace, events: bool, stream: Stream<'_>) -> Vec<usize> {
        let readout = self.network.parts().readout;
        let rows = top.positions.len();
        let per_graph = self.network.parts().normalisation == Normalisation::PerGraph;
        let origin = published::origin(&top.positions[top.first..]);
        let cell = |row: usize| {
            let position = top.positions[row];
            let [column, row] = if per_graph {
                let axis = |d: usize, cells: usize| published::readout_cell(position[d], origin[d], cells);
                [axis(0, readout.columns), axis(1, readout.rows)]
            } else if events {
                let event = stream.events[stream.events.len() - rows + row];
                let axis = |p: u16, cells: usize, extent: u16| usize::from(p) * cells / usize::from(extent);
                [
                    axis(event.x, readout.columns, self.sensor.width),
                    axis(event.y, readout.rows, self.sensor.height),
                ]
            } else {
                let axis = |d: usize, cells: usize| {
                    let cell = (position[d] * cells as f64).floor();
                    (cell.max(0.0) as usize).min(cells - 1)
                };
                [axis(0, readout.columns), axis(1, readout.rows)]
            };
            row * readout.columns + column
        };
        let span_us = self.network.parts().span_us;
        let age = |row: usize| match self.network.readout_time() {
            Some(size) => {
                let now = size.cell((stream.now_us - stream.epoch_us).into(), span_us.into());
                now as usize - top.cells[row][2] as usize
            }
            None => 0,
        };
        let plane = readout.columns * readout.rows;
        (top.first..rows).map(|row| age(row) * plane + cell(row)).collect()
    }

    /// Scale of the edge attributes: the description's, or the largest coordinate difference over the edges.
    fn scale(&self, fixed: f32, differences: impl Iterator<Item = [f64; 3]>) -> f32 {
        match self.network.parts().normalisation {
            Normalisation::Fixed => fixed,
            Normalisation::PerGraph => {
                let largest = differences.flatten().map(|d| (d as f32).abs()).fold(0.0, f32::max);
                if largest > 0.0 { largest } else { 1.0 }
            }
        }
    }
}

/// Channel-wise maximum over some rows.
fn maximum_of(features: &Matrix, rows: &[usize], out: &mut [Lanes]) {
    out.fill(Lanes::splat(f32::NEG_INFINITY));
    rows.iter().for_each(|&row| maximum(out, features.row(row)));
    settle(out);
}
