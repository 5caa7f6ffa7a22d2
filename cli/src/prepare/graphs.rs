//! Graphs of streams of events, as one safetensors file.

mod streams;

use std::collections::BTreeMap;
use std::io::{Write, stdout};

use meissner_engine::{Batch, Edges, Graph, Search, Stream};
use meissner_models::{TensorFile, draw};
use rayon::prelude::*;

use super::GraphsArgs;
use crate::error::CliError;
use crate::output;
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::describe;
use meissner_pipeline::text::grouped;
use streams::Streams;
pub(crate) use streams::StreamsError;

/// One level of all streams.
#[derive(Default)]
struct Level {
    start: Vec<i32>,
    edges: Vec<i32>,
    source: Vec<i32>,
    attribute: Vec<f32>,
    /// Of the rows of the level below.
    cell: Vec<i32>,
    index: Vec<i32>,
}

pub(super) fn prepare(args: &GraphsArgs) -> Result<(), CliError> {
    let (description, _) = describe(&args.network)?;
    let weights = draw(&description, 0);
    let network = description.network(&weights);
    let network = network.map_err(|source| PipelineError::Weights {
        weights: "drawn weights".into(),
        source: Box::new(source),
    })?;
    let streams = Streams::read(&args.events)?;
    let batch = Batch::new(network, streams.sensor)?.with_search(Search::Grid);
    let graphs: Result<Vec<Graph>, _> =
        streams.parts().par_iter().map(|&events| batch.graph(Stream::new(events))).collect();
    let graphs = graphs?;

    let mut levels: Vec<Level> = (0..batch.network().levels()).map(|_| Level::default()).collect();
    let (mut event, mut readout) = (Vec::new(), Vec::new());
    for (graph, end) in graphs.iter().zip(streams.ends()) {
        event.extend((end - graph.levels[0].edges.rows()..end).map(|event| event as i32));
        for (level, (to, trace)) in levels.iter_mut().zip(&graph.levels).enumerate() {
            let first = to.start_stream(&trace.edges);
            to.index.extend(trace.cells.iter().flatten().map(|&i| i as i32));
            if level > 0 {
                let below = graph.levels[level - 1].edges.rows();
                to.pool(below, &trace.members, first);
            }
        }
        readout.extend(graph.readout.iter().map(|&cell| cell as i32));
    }

    let mut file = TensorFile::new(BTreeMap::new());
    file.i32("event", &[event.len()], &event);
    file.i32("readout", &[readout.len()], &readout);
    for (i, level) in levels.into_iter().enumerate() {
        level.write(i, &mut file);
    }
    output::write(&args.out, file.into_bytes())?;
    let mut out = stdout().lock();
    let (count, rows) = (grouped(graphs.len() as u64), grouped(event.len() as u64));
    writeln!(out, "{}: graphs of {count} streams, {rows} rows at the event level", args.out.display())?;
    Ok(out.flush()?)
}

impl Level {
    /// Appends the rows of a stream; the first of them.
    fn start_stream(&mut self, edges: &Edges) -> i32 {
        let first = self.edges.len() as i32;
        self.start.push(first);
        for row in 0..edges.rows() {
            self.edges.push(self.source.len() as i32);
            self.source.extend(edges.row(row).iter().map(|edge| first + edge.row as i32));
            self.attribute.extend(edges.row(row).iter().flat_map(|edge| edge.u));
        }
        first
    }

    /// Notes which of the rows that were appended last, from `first` on, pools each of `below` rows.
    fn pool(&mut self, below: usize, members: &[Vec<usize>], first: i32) {
        let start = self.cell.len();
        self.cell.resize(start + below, -1);
        for (row, members) in (first..).zip(members) {
            members.iter().for_each(|&member| self.cell[start + member] = row);
        }
    }

    fn write(mut self, level: usize, file: &mut TensorFile) {
        let rows = self.edges.len();
        self.start.push(rows as i32);
        self.edges.push(self.source.len() as i32);
        let name = |name| format!("level{level}.{name}");
        file.i32(&name("start"), &[self.start.len()], &self.start);
        file.i32(&name("edges"), &[self.edges.len()], &self.edges);
        file.i32(&name("source"), &[self.source.len()], &self.source);
        file.f32(&name("attribute"), &[self.source.len(), 3], &self.attribute);
        if level > 0 {
            file.i32(&name("cell"), &[self.cell.len()], &self.cell);
            file.i32(&name("index"), &[rows, 3], &self.index);
        }
    }
}
