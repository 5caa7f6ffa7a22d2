//! A pooled level from scratch.

use std::collections::BTreeMap;

use meissner_kernels::{Matrix, Neighbour, attribute, offset};
use smallvec::SmallVec;

use super::published;
use super::setup::Batch;
use super::trace::{Edges, LevelTrace, Stream, maximum_of};
use crate::network::{Level, Normalisation, Pooling, Position};
use crate::{Event, Fraction};

/// Inline capacity of a source list: most cells have edges from adjacent cells only.
const TOUCHING: usize = 8;

/// Index of a cell with t first, which gives the order of cells.
type Key = [i64; 3];

/// Rows, edges and input of the level that `pooling` makes from `below`; `below_pooling` made
/// `below`, if that is a pooled level.
pub(super) fn level(
    batch: &Batch,
    (pooling, level): (&Pooling, &Level),
    below: &LevelTrace,
    below_pooling: Option<&Pooling>,
    stream: Stream<'_>,
) -> LevelTrace {
    let features = &below.features[pooling.from];
    let events = match below_pooling {
        None => &stream.events[stream.events.len() - features.rows()..],
        Some(_) => &[],
    };
    let in_window = &below.positions[below.first..];
    let keys: Vec<Key> = match (batch.network.parts().normalisation, below_pooling) {
        (Normalisation::Fixed, None) => {
            events[below.first..].iter().map(|e| key_of_event(batch, pooling, e, stream)).collect()
        }
        (Normalisation::Fixed, Some(inner)) => {
            below.cells.iter().map(|&c| key_of_cell(pooling, inner, c)).collect()
        }
        (Normalisation::PerGraph, _) => {
            let origin = published::origin(in_window);
            let axis = |p: &[f64; 3], d: usize| published::cell(p[d], origin[d], pooling.cell[d]);
            let time =
                |row: usize| events.get(below.first + row).map_or(0, |e| time_of(batch, pooling, e, stream));
            in_window.iter().enumerate().map(|(row, p)| [time(row), axis(p, 1), axis(p, 0)]).collect()
        }
    };
    let cells = Cells::new(&keys, below.first, features, &below.edges);
    let per_graph = batch.network.parts().normalisation == Normalisation::PerGraph;
    let position = |(members, &key): (&Vec<usize>, &Key)| match pooling.position {
        Position::Centre => centre(pooling, key),
        Position::Mean if per_graph => published::mean(members, &below.positions),
        Position::Mean if below_pooling.is_none() => mean_of_events(batch, events, members, stream),
        Position::Mean => mean(members, &below.positions),
    };
    let positions: Vec<[f64; 3]> = cells.members.iter().zip(&cells.keys).map(position).collect();
    let difference = |source: usize, reader: usize| -> [f64; 3] {
        if per_graph {
            return published::difference(positions[source], positions[reader]);
        }
        [0, 1, 2].map(|d| positions[source][d] - positions[reader][d])
    };
    let readers = || cells.sources.iter().enumerate();
    let pairs = readers().flat_map(|(to, from)| from.iter().map(move |&from| (from, to)));
    let scale = batch.scale(level.scale, pairs.map(|(from, to)| difference(from, to)));
    let mut edges = Edges::default();
    for (to, from) in readers() {
        let attributes = |from: usize| difference(from, to).map(|d| attribute(d, scale));
        edges.push(from.iter().map(|&from| Neighbour { row: from as u32, u: attributes(from) }));
        if level.edge_reads().offsets {
            let offsets = |&from: &usize| difference(from, to).map(|d| offset(d, scale));
            edges.offsets.extend(from.iter().map(offsets));
        }
    }
    let index = cells.keys.iter().map(|&[t, y, x]| [x, y, t]).collect();
    let Cells { members, maxima, .. } = cells;
    LevelTrace { edges, features: vec![maxima], positions, cells: index, members, first: 0 }
}

/// Rows pooled by cell: the result of max pooling, without positions.
#[derive(Clone, Debug)]
pub struct Cells {
    /// Cells with members, in order.
    pub keys: Vec<[i64; 3]>,
    /// Members of each cell, ascending.
    pub members: Vec<Vec<usize>>,
    /// For each cell, the other cells that have an edge to it on the level below, ascending.
    pub sources: Vec<SmallVec<[usize; TOUCHING]>>,
    /// Channel-wise maximum over each cell's members.
    pub maxima: Matrix,
}

impl Cells {
    /// Pools rows of `features` from `first` on, with cells `keys`; drops earlier rows' edges.
    ///
    /// # Panics
    /// If there is not one key per row from `first` on, a member has no row in `edges`, or an edge
    /// comes from a row beyond `features`.
    pub fn new(keys: &[[i64; 3]], first: usize, features: &Matrix, edges: &Edges) -> Self {
        assert_eq!(
            first.saturating_add(keys.len()),
            features.rows(),
            "every row from the first on must have a cell"
        );
        let mut members: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
        for (i, &key) in keys.iter().enumerate() {
            members.entry(key).or_default().push(first + i);
        }
        let mut cell_of = vec![0; features.rows()];
        for (cell, members) in members.values().enumerate() {
            members.iter().for_each(|&row| cell_of[row] = cell);
        }
        // The last cell with an edge from each source cell: each edge is listed once.
        let mut taken_by = vec![usize::MAX; members.len()];
        let mut sources = Vec::with_capacity(members.len());
        for (to, members) in members.values().enumerate() {
            let mut from = SmallVec::new();
            let edges = members.iter().flat_map(|&row| edges.row(row));
            for edge in edges.filter(|edge| edge.row as usize >= first) {
                let cell = cell_of[edge.row as usize];
                if cell != to && taken_by[cell] != to {
                    taken_by[cell] = to;
                    from.push(cell);
                }
            }
            from.sort_unstable();
            sources.push(from);
        }
        let mut maxima = Matrix::zeros(members.len(), features.columns());
        for (i, members) in members.values().enumerate() {
            maximum_of(features, members, maxima.row_mut(i));
        }
        let (keys, members) = members.into_iter().unzip();
        Self { keys, members, sources, maxima }
    }

    /// Mean position of each cell's members.
    ///
    /// # Panics
    /// If a member has no position.
    pub fn mean_positions(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.members.iter().map(|members| mean(members, positions)).collect()
    }
}

/// Mean of the members' positions, summed in member order.
fn mean(members: &[usize], positions: &[[f64; 3]]) -> [f64; 3] {
    let add = |sum: [f64; 3], &m: &usize| [0, 1, 2].map(|d| sum[d] + positions[m][d]);
    members.iter().fold([0.0; 3], add).map(|sum| sum / members.len() as f64)
}

/// Cell of an event, in integers.
fn key_of_event(batch: &Batch, pooling: &Pooling, event: &Event, stream: Stream<'_>) -> Key {
    let [width, height] = pooling.cell;
    [
        time_of(batch, pooling, event, stream),
        height.cell(event.y.into(), batch.sensor.height.into()) as i64,
        width.cell(event.x.into(), batch.sensor.width.into()) as i64,
    ]
}

/// Index of an event's cell along t, in integers; 0 if there are no cells in time.
fn time_of(batch: &Batch, pooling: &Pooling, event: &Event, stream: Stream<'_>) -> i64 {
    let t = i128::from(event.t_us - stream.epoch_us);
    pooling.time.map_or(0, |size| size.cell(t, batch.network.parts().span_us.into()) as i64)
}

/// Cell that contains the centre of a cell of `inner`; the last one beyond the image.
fn key_of_cell(pooling: &Pooling, inner: &Pooling, [x, y, t]: [i64; 3]) -> Key {
    let axis = |index: i64, inner: Fraction, outer: Fraction| {
        let twice_centre = (2 * i128::from(index) + 1) * i128::from(inner.numerator());
        outer.cell(twice_centre, 2 * i128::from(inner.denominator())) as i64
    };
    let [width, height] = pooling.cell;
    let last = |size: Fraction| size.cells() as i64 - 1;
    [
        inner.time.zip(pooling.time).map_or(0, |(inner, outer)| axis(t, inner, outer)),
        axis(y, inner.cell[1], height).min(last(height)),
        axis(x, inner.cell[0], width).min(last(width)),
    ]
}

fn centre(pooling: &Pooling, [t, y, x]: Key) -> [f64; 3] {
    let [width, height] = pooling.cell;
    [width.centre(x), height.centre(y), pooling.time.map_or(0.5, |size| size.centre(t))]
}

/// Mean position of some events, from exact sums.
fn mean_of_events(batch: &Batch, events: &[Event], members: &[usize], stream: Stream<'_>) -> [f64; 3] {
    let sum = |p: &dyn Fn(&Event) -> i128| members.iter().map(|&m| p(&events[m])).sum::<i128>() as f64;
    let share = |sum: f64, extent: i64| sum / (members.len() as i128 * i128::from(extent)) as f64;
    [
        share(sum(&|e| e.x.into()), batch.sensor.width.into()),
        share(sum(&|e| e.y.into()), batch.sensor.height.into()),
        share(sum(&|e| i128::from(e.t_us) - i128::from(stream.epoch_us)), batch.network.parts().span_us),
    ]
}
