//! The data of an engine over events in a frame, read through its public methods.
//!
//! Input: an engine after a prediction. Output: sections. O(window + cells). An engine without
//! viewers is not read.

use meissner_engine::{Counters, Engine, Fraction, Network};

use crate::frame::{Bytes, FrameWriter};

/// The engine's window, graph, rows, cells and readout: EVNT, NEAR, WAVE, CELL, READ.
pub fn write(engine: &Engine, to: &mut FrameWriter) {
    let events = engine.events();
    let now_us = engine.now_us().unwrap_or(0);
    to.section(*b"EVNT", |to| {
        for event in &events {
            let age = now_us.saturating_sub(event.t_us).clamp(0, i64::from(i32::MAX)) as u32;
            to.u16(event.x);
            to.u16(event.y);
            to.u32(age << 1 | u32::from(event.on));
        }
    });
    to.section(*b"NEAR", |to| {
        let newest = events.len().checked_sub(1);
        let near = newest.map_or_else(Vec::new, |newest| engine.neighbourhood(newest));
        near.iter().for_each(|neighbour| to.u32(neighbour.row));
    });
    to.section(*b"WAVE", |to| wave(engine, to));
    to.section(*b"CELL", |to| cells(engine, to));
    to.section(*b"READ", |to| readout(engine, to));
}

/// The level of each of the layers that compute rows.
fn levels_of_layers(network: &Network) -> Vec<usize> {
    (0..network.levels()).flat_map(|level| vec![level; network.layers_of(level)]).collect()
}

fn wave(engine: &Engine, to: &mut Bytes<'_>) {
    let layers = engine.computed_rows();
    let levels = levels_of_layers(engine.network());
    let rows: Vec<usize> = (0..engine.network().levels()).map(|level| rows_of(engine, level)).collect();
    to.count(layers.len());
    for (computed, &level) in layers.iter().zip(&levels) {
        to.count(level);
        to.count(rows[level]);
        to.count(computed.len());
    }
    for row in layers.iter().flatten() {
        to.u32((row.row as u32) << 1 | u32::from(row.changed));
    }
}

fn rows_of(engine: &Engine, level: usize) -> usize {
    if level == 0 { engine.nodes() } else { engine.cells(level).len() }
}

fn cells(engine: &Engine, to: &mut Bytes<'_>) {
    let pooled = &engine.network().parts().pooled;
    to.count(pooled.len());
    for (level, (pooling, _)) in (1..).zip(pooled) {
        let cells = engine.cells(level);
        let newest = cells.iter().map(|[_, _, t]| *t).max().unwrap_or(0);
        let [columns, rows] = pooling.cell.map(Fraction::cells);
        to.count(columns);
        to.count(rows);
        to.count(cells.len());
        for ([x, y, t], values) in cells.into_iter().zip(engine.feature(level, 0)) {
            to.u16(x as u16);
            to.u16(y as u16);
            to.count((newest - t) as usize);
            to.f32(root_mean_square(&values));
        }
    }
}

fn readout(engine: &Engine, to: &mut Bytes<'_>) {
    let grid = engine.network().parts().readout;
    to.count(engine.network().readout_times());
    to.count(grid.columns);
    to.count(grid.rows);
    engine.readout().iter().for_each(|cell| to.f32(root_mean_square(cell)));
}

fn root_mean_square(values: &[f32]) -> f32 {
    let squares: f32 = values.iter().map(|value| value * value).sum();
    (squares / values.len().max(1) as f32).sqrt()
}

/// The section WORK.
pub(crate) fn work(counters: &Counters, to: &mut Bytes<'_>) {
    to.count(counters.layers.len());
    for layer in &counters.layers {
        for count in [layer.recomputed, layer.unchanged, layer.within_tolerance, layer.kept] {
            to.f64(count as f64);
        }
    }
    let of = counters.predictions;
    for count in [
        of.read,
        of.reused,
        of.cells_recomputed,
        of.cells_unchanged,
        of.neighbourhoods_checked,
        of.neighbourhoods_unchanged,
    ] {
        to.f64(count as f64);
    }
}
