//! A network computed from scratch: the engine's oracle, and the way to run data sets.
//!
//! The batch shares only the kernels with the engine: it compares all pairs, pools through ordered
//! maps, and loops over all rows. [`Search::Grid`], for speed, uses the engine's grid and metric,
//! and is not an independent oracle.

mod events;
mod neighbours;
mod pool;
pub(crate) mod published;
pub(crate) mod setup;
mod trace;

use std::sync::Arc;

use meissner_kernels::{GraphRow, Lanes, Matrix, is_nan};
use rayon::prelude::*;

use crate::EngineError;
use crate::convolution::{ConvolutionScratch, GraphConvolution};
use crate::frames::{FrameEngine, FrameNetwork, FrameOptions, Skip};
use crate::network::{Aggregation, Level, Normalisation, Pooling};
pub use pool::Cells;
pub use setup::{Batch, Places, Propose, Search};
pub use trace::{Edges, LevelTrace, Stream, Trace};
use trace::{maximum_of, sum_of};

/// Neighbourhoods, cells and positions of a network on one window; independent of its weights.
#[derive(Clone, Debug)]
pub struct Graph {
    /// The event level, then one per pooling. Each has one feature, the input of its first block if
    /// no layer below was computed: the polarity, or its maxima.
    pub levels: Vec<LevelTrace>,
    /// Readout cell (row-major index) of each row of the last level that is in the window.
    pub readout: Vec<usize>,
}

impl Batch {
    /// Predictions for all `streams`, computed on all of rayon's threads.
    pub fn predict_all(&self, streams: &[Stream<'_>]) -> Vec<Result<Vec<f32>, EngineError>> {
        streams.par_iter().map(|stream| self.forward(*stream).map(|trace| trace.prediction)).collect()
    }

    /// Computes every row of every layer.
    ///
    /// Cost: n rows per layer, and the search.
    ///
    /// # Errors
    /// [`EngineError::Stream`] for an event outside the sensor, out of order or after the newest
    /// time, or a time difference beyond 64 bits; [`EngineError::NotANumber`] if a row or the
    /// prediction holds NaN; [`EngineError::FrameMemory`] if the head needs more than 4 GiB.
    pub fn forward(&self, stream: Stream<'_>) -> Result<Trace, EngineError> {
        let levels = self.levels(stream, true)?;
        let parts = self.network.parts();
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

    /// Neighbourhoods, cells and positions on `stream`, without layers. Cost: the search, O(edges).
    ///
    /// # Errors
    /// [`EngineError::Stream`] as [`Self::forward`].
    pub fn graph(&self, stream: Stream<'_>) -> Result<Graph, EngineError> {
        let levels = self.levels(stream, false)?;
        let readout = self.readout_cells(&levels[levels.len() - 1], levels.len() == 1, stream);
        Ok(Graph { levels, readout })
    }

    /// The event level, then one level per pooling; without `blocks`, each has only its input.
    fn levels(&self, stream: Stream<'_>, blocks: bool) -> Result<Vec<LevelTrace>, EngineError> {
        stream.check(self.sensor)?;
        let parts = self.network.parts();
        let mut levels = vec![events::level(self, stream)];
        if blocks {
            self.run_blocks(&parts.events, &mut levels[0])?;
        }
        let mut below_pooling = None;
        for (pooling, level) in &parts.pooled {
            let from = if blocks { pooling.from } else { 0 };
            let of_feature = (&Pooling { from, ..pooling.clone() }, level);
            let mut trace = pool::level(self, of_feature, &levels[levels.len() - 1], below_pooling, stream);
            if blocks {
                self.run_blocks(level, &mut trace)?;
            }
            levels.push(trace);
            below_pooling = Some(pooling);
        }
        Ok(levels)
    }

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

    /// Maximum or sum over the readout's grid.
    fn readout(&self, top: &LevelTrace, events: bool, stream: Stream<'_>) -> Matrix {
        let readout = self.network.parts().readout;
        let features = &top.features[readout.from];
        let cells = readout.columns * readout.rows * self.network.readout_times();
        let mut out = Matrix::zeros(cells, features.columns());
        let mut members = vec![Vec::new(); out.rows()];
        for (row, cell) in (top.first..).zip(self.readout_cells(top, events, stream)) {
            members[cell].push(row);
        }
        let part = |row: usize| {
            let event = stream.events[stream.events.len() - features.rows() + row];
            (event.t_us - stream.epoch_us) / self.network.sum_part_us()
        };
        for (cell, members) in members.iter().enumerate().filter(|(_, m)| !m.is_empty()) {
            match readout.aggregation {
                Aggregation::Max => maximum_of(features, members, out.row_mut(cell)),
                Aggregation::Sum => sum_of(features, members, part, out.row_mut(cell)),
            }
        }
        out
    }

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

    /// Readout cell of each row of `top` in the window; `events` if `top` is the event level.
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
}
