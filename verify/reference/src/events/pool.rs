//! A pooled level, and the readout: maxima or sums over cells, which are computed in integers.

use std::collections::{BTreeMap, BTreeSet};

use meissner_engine::{Aggregation, Event, Fraction, Pooling, Position, Stream};

use super::{EventReference, ReferenceLevel, Rows};
use crate::convolution::Edge;

/// Index of a cell with t first, which gives the order of cells.
type Key = [i64; 3];

/// The level that `pooling` makes from `below`, which `inner` made, unless it is the event level.
pub(super) fn level(
    reference: &EventReference,
    (pooling, scale): (&Pooling, f32),
    below: &ReferenceLevel,
    inner: Option<&Pooling>,
    stream: Stream<'_>,
) -> ReferenceLevel {
    let rows = below.features[pooling.from].len();
    let event = |row: usize| &stream.events[stream.events.len() - rows + row];
    let key = |row: usize| match inner {
        None => key_of_event(reference, pooling, event(row), stream),
        Some(inner) => key_of_cell(pooling, inner, below.cells[row]),
    };
    let mut members: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
    (below.first..rows).for_each(|row| members.entry(key(row)).or_default().push(row));
    let order: BTreeMap<Key, usize> = members.keys().enumerate().map(|(i, &key)| (key, i)).collect();
    let position = |(&key, members): (&Key, &Vec<usize>)| match (pooling.position, inner) {
        (Position::Centre, _) => centre(pooling, key),
        (Position::Mean, None) => {
            let members: Vec<&Event> = members.iter().map(|&row| event(row)).collect();
            mean_of_events(reference, &members, stream)
        }
        (Position::Mean, Some(_)) => {
            let sum = |d: usize| members.iter().fold(0.0, |sum, &m| sum + below.positions[m][d]);
            [0, 1, 2].map(|d| sum(d) / members.len() as f64)
        }
    };
    let positions: Vec<[f64; 3]> = members.iter().map(position).collect();
    let edges = members.iter().enumerate().map(|(to, (_, members))| {
        let read = members.iter().flat_map(|&row| &below.edges[row]).filter(|edge| edge.row >= below.first);
        let sources: BTreeSet<usize> = read.map(|edge| order[&key(edge.row)]).collect();
        let edge =
            |from: usize| Edge::new(from, [0, 1, 2].map(|d| positions[from][d] - positions[to][d]), scale);
        sources.into_iter().filter(|&from| from != to).map(edge).collect()
    });
    let features = &below.features[pooling.from];
    ReferenceLevel {
        edges: edges.collect(),
        features: vec![members.values().map(|members| maximum(features, members)).collect()],
        cells: members.keys().map(|&[t, y, x]| [x, y, t]).collect(),
        positions,
        first: 0,
    }
}

/// Maximum or sum over the readout's grid, 0 for an empty cell; (cells, channels).
pub(super) fn readout(reference: &EventReference, top: &ReferenceLevel, stream: Stream<'_>) -> Rows {
    let network = &reference.network;
    let readout = network.parts().readout;
    let features = &top.features[readout.from];
    let plane = readout.columns * readout.rows;
    let mut members = vec![Vec::new(); plane * network.readout_times()];
    for row in top.first..features.len() {
        let [column, line] = if top.cells.is_empty() {
            let event = stream.events[stream.events.len() - features.len() + row];
            let axis = |p: u16, cells: usize, extent: u16| usize::from(p) * cells / usize::from(extent);
            [
                axis(event.x, readout.columns, reference.sensor.width),
                axis(event.y, readout.rows, reference.sensor.height),
            ]
        } else {
            let axis = |p: f64, cells: usize| ((p * cells as f64).floor().max(0.0) as usize).min(cells - 1);
            [axis(top.positions[row][0], readout.columns), axis(top.positions[row][1], readout.rows)]
        };
        let time = network.parts().pooled.last().and_then(|(pooling, _)| pooling.time);
        let age = time.filter(|_| readout.by_time).map_or(0, |size| {
            let now = i128::from(stream.now_us) - i128::from(stream.epoch_us);
            (size.cell(now, network.parts().span_us.into()) - i128::from(top.cells[row][2])) as usize
        });
        members[age * plane + line * readout.columns + column].push(row);
    }
    let channels = network.readout_channels();
    let cell = |members: &Vec<usize>| match readout.aggregation {
        Aggregation::Max if !members.is_empty() => maximum(features, members),
        _ => (0..channels).map(|c| members.iter().fold(0.0, |sum, &row| sum + features[row][c])).collect(),
    };
    members.iter().map(cell).collect()
}

fn maximum(features: &Rows, members: &[usize]) -> Vec<f64> {
    let channels = features[members[0]].len();
    (0..channels).map(|c| members.iter().fold(f64::NEG_INFINITY, |m, &row| m.max(features[row][c]))).collect()
}

/// Cell of an event, in integers.
fn key_of_event(reference: &EventReference, pooling: &Pooling, event: &Event, stream: Stream<'_>) -> Key {
    let span_us = i128::from(reference.network.parts().span_us);
    let age = i128::from(event.t_us) - i128::from(stream.epoch_us);
    let [width, height] = pooling.cell;
    [
        pooling.time.map_or(0, |size| size.cell(age, span_us) as i64),
        height.cell(event.y.into(), reference.sensor.height.into()) as i64,
        width.cell(event.x.into(), reference.sensor.width.into()) as i64,
    ]
}

/// Cell that contains the centre of a cell of `inner`; the last one beyond the image.
fn key_of_cell(pooling: &Pooling, inner: &Pooling, [x, y, t]: [i64; 3]) -> Key {
    let axis = |index: i64, inner: Fraction, outer: Fraction| {
        let twice_centre = (2 * i128::from(index) + 1) * i128::from(inner.numerator());
        outer.cell(twice_centre, 2 * i128::from(inner.denominator())) as i64
    };
    let image =
        |d: usize, i: i64| axis(i, inner.cell[d], pooling.cell[d]).min(pooling.cell[d].cells() as i64 - 1);
    let time = inner.time.zip(pooling.time);
    [time.map_or(0, |(inner, outer)| axis(t, inner, outer)), image(1, y), image(0, x)]
}

fn centre(pooling: &Pooling, [t, y, x]: Key) -> [f64; 3] {
    let [width, height] = pooling.cell;
    [width.centre(x), height.centre(y), pooling.time.map_or(0.5, |size| size.centre(t))]
}

/// Mean position of some events, from exact sums.
fn mean_of_events(reference: &EventReference, members: &[&Event], stream: Stream<'_>) -> [f64; 3] {
    let count = members.len() as i128;
    let share = |sum: i128, extent: i128| sum as f64 / (count * extent) as f64;
    [
        share(members.iter().map(|e| i128::from(e.x)).sum(), reference.sensor.width.into()),
        share(members.iter().map(|e| i128::from(e.y)).sum(), reference.sensor.height.into()),
        share(
            members.iter().map(|e| i128::from(e.t_us) - i128::from(stream.epoch_us)).sum(),
            reference.network.parts().span_us.into(),
        ),
    ]
}
