//! The published mode: positions, cells and means as its float32 operations give them.
//!
//! Positions, a grid's origin, and their difference over a cell's size are float32 there, so an
//! event on a cell's edge can fall into the cell before. Every function rounds at the same places;
//! positions are f64 values that are exact in f32.

use crate::{Event, Fraction};

/// Positions of events: f64 quotients, rounded once. `first_us`: time of the graph's first event.
pub(crate) fn positions(events: &[Event], first_us: i64, extents: [f64; 3]) -> Vec<[f64; 3]> {
    let position = |e: &Event| {
        let integers = [i64::from(e.x), i64::from(e.y), e.t_us - first_us];
        [0, 1, 2].map(|d| rounded(integers[d] as f64 / extents[d]))
    };
    events.iter().map(position).collect()
}

pub(super) fn difference(source: [f64; 3], reader: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|d| f64::from(source[d] as f32 - reader[d] as f32))
}

/// Origin of a grid over nodes at `positions`: their smallest coordinates along x and y.
pub(super) fn origin(positions: &[[f64; 3]]) -> [f32; 2] {
    [0, 1].map(|d| positions.iter().map(|p| p[d] as f32).fold(f32::INFINITY, f32::min))
}

/// Index of the pooling cell of length `size` that contains a coordinate.
pub(crate) fn cell(position: f64, origin: f32, size: Fraction) -> i64 {
    index(position, origin, f64::from(size.numerator()) / f64::from(size.denominator())) as i64
}

/// Index of the readout cell, of `cells` along the axis, that contains a coordinate.
pub(crate) fn readout_cell(position: f64, origin: f32, cells: usize) -> usize {
    (index(position, origin, 1.0 / cells as f64).max(0.0) as usize).min(cells - 1)
}

/// The cell's size is a quotient in f64; the tensor library rounds it before it divides by it.
fn index(position: f64, origin: f32, size: f64) -> f32 {
    ((position as f32 - origin) / size as f32).floor()
}

/// Mean of the members' positions: summed in their order, then divided by their number.
pub(crate) fn mean(members: &[usize], positions: &[[f64; 3]]) -> [f64; 3] {
    let add = |sum: [f32; 3], &m: &usize| [0, 1, 2].map(|d| sum[d] + positions[m][d] as f32);
    members.iter().fold([0.0; 3], add).map(|sum| f64::from(sum / members.len() as f32))
}

fn rounded(value: f64) -> f64 {
    f64::from(value as f32)
}
