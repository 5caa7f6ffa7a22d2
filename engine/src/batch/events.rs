//! The event level from scratch.

use meissner_kernels::{Matrix, Neighbour, Portable, attribute, offset};

use super::neighbours::{Lists, Space, candidates, exhaustive, proposed, take};
use super::published;
use super::setup::{Batch, Search};
use super::trace::{Edges, LevelTrace, Stream};
use crate::Event;
use crate::graph::{Candidate, SIDE_LOG2};
use crate::grid::{Grid, Times};
use crate::memory::Memory;
use crate::metric::{Metric, Node, input_channels, input_of};
use crate::network::{Candidates, Normalisation, Reach};
use crate::queues::Cursor;

pub(super) fn level(batch: &Batch, stream: Stream<'_>) -> LevelTrace {
    let parts = batch.network.parts();
    let oldest = stream.now_us.saturating_sub(parts.span_us);
    let in_time = stream.events.partition_point(|e| e.t_us < oldest);
    let first = in_time.max(stream.events.len().saturating_sub(parts.capacity));
    // Events that have left the window are still inputs of rows that read them on arrival.
    let start = if parts.graph.is_frozen() { 0 } else { first };
    let events = &stream.events[start..];
    let extents = [f64::from(batch.sensor.width), f64::from(batch.sensor.height), parts.span_us as f64];
    let nodes: Vec<Node> = events.iter().map(|&e| Node::new(e, e.t_us - events[0].t_us)).collect();
    let metric = |scale| Metric::new(batch.sensor, parts.span_us, scale, &mut Memory::default());
    let lists = match batch.search {
        Search::Exhaustive => exhaustive(batch, events, extents),
        Search::Proposed(propose) => proposed(batch, events, extents, propose),
        Search::Grid => with_grid(batch, events, &nodes, &metric(parts.events.scale)),
    };
    let per_graph = parts.normalisation == Normalisation::PerGraph;
    let positions = if per_graph {
        let first_us = events.get(first - start).map_or(0, |e| e.t_us);
        published::positions(events, first_us, extents)
    } else {
        events.iter().map(|e| position(e, stream.epoch_us, extents)).collect()
    };
    let difference = |source: usize, reader: usize| {
        if per_graph {
            return published::difference(positions[source], positions[reader]);
        }
        let (a, b) = (events[source], events[reader]);
        let integers = [i64::from(a.x) - i64::from(b.x), i64::from(a.y) - i64::from(b.y), a.t_us - b.t_us];
        [0, 1, 2].map(|d| integers[d] as f64 / extents[d])
    };
    let pairs = lists.rows().enumerate().flat_map(|(i, list)| list.iter().map(move |&j| (j as usize, i)));
    let scale = batch.scale(parts.events.scale, pairs.map(|(j, i)| difference(j, i)));
    let metric = (matches!(batch.search, Search::Grid) && !per_graph).then(|| metric(scale));
    let attributes = |source: usize, reader: usize| match &metric {
        Some(metric) => metric.attributes(nodes[source], nodes[reader]),
        None => difference(source, reader).map(|d| attribute(d, scale)),
    };
    let reads_offsets = parts.events.edge_reads().offsets;
    let mut edges = Edges {
        start: Vec::with_capacity(events.len()),
        list: Vec::with_capacity(lists.edges()),
        offsets: Vec::with_capacity(if reads_offsets { lists.edges() } else { 0 }),
    };
    for (i, list) in lists.rows().enumerate() {
        edges.push(list.iter().map(|&j| Neighbour { row: j, u: attributes(j as usize, i) }));
        if reads_offsets {
            let offsets = |&j: &u32| difference(j as usize, i).map(|d| offset(d, scale));
            edges.offsets.extend(list.iter().map(offsets));
        }
    }
    let input = |event| input_of(event, parts.place, batch.sensor);
    let input: Vec<f32> = events.iter().flat_map(input).collect();
    LevelTrace {
        edges,
        features: vec![Matrix::from_rows(input_channels(parts.place), &input)],
        positions,
        cells: Vec::new(),
        members: Vec::new(),
        first: first - start,
    }
}

fn position(event: &Event, epoch_us: i64, extents: [f64; 3]) -> [f64; 3] {
    [
        f64::from(event.x) / extents[0],
        f64::from(event.y) / extents[1],
        (event.t_us - epoch_us) as f64 / extents[2],
    ]
}

/// Factor by which a guess of a squared distance is enlarged.
const GENEROUS: f64 = 2.0;

/// Neighbour indices of each event, by the engine's search grid.
fn with_grid(batch: &Batch, events: &[Event], nodes: &[Node], metric: &Metric) -> Lists {
    let rule = batch.network.parts().graph;
    let space = Space { nodes, metric, sensor: batch.sensor, span_us: batch.network.parts().span_us };
    if rule.candidates == Candidates::All && matches!(rule.reach, Reach::Knn { .. }) && space.is_short() {
        return space.nearest(rule.reach.most(), batch.isa);
    }
    let mut grid = Grid::new(batch.sensor, SIDE_LOG2, nodes.len(), &mut Memory::default());
    let times = if rule.candidates == Candidates::All {
        nodes.iter().enumerate().for_each(|(i, &node)| grid.push(i as u32, node));
        Times::All
    } else {
        Times::Past
    };
    let (most, limit) = (rule.reach.most(), rule.reach.limit());
    let mut cursors = vec![Cursor::default(); grid.cells()];
    let mut guesses = vec![f64::INFINITY; grid.cells()];
    let mut oldest = 0;
    let mut found = Vec::with_capacity(most + 1);
    let mut lists = Lists::new(nodes.len(), 0);
    for (i, &node) in nodes.iter().enumerate() {
        if times == Times::Past {
            let first = candidates(batch, events, i).start;
            (oldest..first).for_each(|gone| grid.pop(gone as u32, nodes[gone]));
            oldest = first;
        }
        // The enlarged extent of the last neighbourhood in this cell nearly always has enough
        // candidates. Otherwise the search is repeated without a guess.
        let guess = &mut guesses[grid.cell(node.x, node.y)];
        for limit in [limit.min(*guess), limit] {
            found.clear();
            let visit = |d2, j: u32| {
                if j as usize != i {
                    take(&mut found, most, Candidate { d2, slot: j }, |slot| slot);
                }
                if found.len() == most { found[most - 1].d2 } else { limit }
            };
            match times {
                Times::All => grid.search_onwards(metric, node, &mut cursors, limit, visit),
                Times::Past => grid.search(Portable, metric, node, times, limit, visit),
            }
            if found.len() == most {
                *guess = GENEROUS * found[most - 1].d2;
                break;
            }
        }
        lists.set(i as u32, found.iter().map(|c| c.slot));
        if times == Times::Past {
            grid.push(i as u32, node);
        }
    }
    lists
}
