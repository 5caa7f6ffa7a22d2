//! The changes that events of a recording cause: events enter one by one, and the network over the window after each is
//! compared with the one before, row by row. Once exact, and twice with the activations of every layer rounded to a grid.
//!
//! A row is dirty where an in-edge came, went or moved, where a source's value changed, or where its skip did. The
//! exact numbers of dirty rows must equal the engine's own counters.

use std::collections::BTreeMap;
use std::sync::Arc;

use meissner_benches::answers::Deviation;
use meissner_benches::networks::{grid_batch, level_features};
use meissner_benches::report::{Column, Digits, print_markdown_head, print_markdown_row};
use meissner_benches::streams::Recording;
use meissner_engine::{Batch, Engine, Network, Stream, Trace};
use meissner_kernels::{Lanes, Matrix, Neighbour, clear_negative_zero, maximum, same_bits};
use serde_json::json;

use crate::problem::{flat, magnitude};
use crate::study::{I8, I16};

/// Places in the recording, and events from each.
const PLACES: usize = 6;
const EVENTS: usize = 50;
/// The numbers of activations, and their largest number of steps; none where they stay exact.
const WIDTHS: [(&str, Option<f32>); 3] = [("f32", None), ("i16", Some(I16[0])), ("i8", Some(I8[0]))];

const COLUMNS: [Column; 8] = [
    ("layer", "layer", Digits::Fixed(0)),
    ("width", "activations", Digits::Fixed(0)),
    ("dirty", "dirty rows an event", Digits::Fixed(1)),
    ("edges", "in-edges", Digits::Fixed(1)),
    ("changed", "changed", Digits::Fixed(1)),
    ("share", "changed, %", Digits::Fixed(0)),
    ("few", "few changed, % of rows", Digits::Fixed(0)),
    ("unchanged", "unchanged, % of rows", Digits::Fixed(1)),
];

/// Counts of one layer.
#[derive(Clone, Copy, Default)]
struct Counts {
    /// Rows recomputed.
    dirty: u64,
    /// Of these, rows that existed before.
    stayed: u64,
    /// Of these, rows that came out the same.
    unchanged: u64,
    /// In-edges of rows that stayed.
    edges: u64,
    /// Of these, in-edges that came (one that went beside it is the same change), moved or read another value.
    changed: u64,
    /// Rows that stayed with at most a quarter of their in-edges changed.
    few: u64,
}

/// Prints the changes of events at some places of a recording, with a prediction after each, layer by layer.
///
/// # Panics
/// If the exact rows are not as many as the engine recomputes.
pub(crate) fn print(network: &Arc<Network>) {
    let recording = Recording::load("tactile_dots").unwrap_or_else(|| Recording::synthetic(20_000));
    let windows = Windows { recording: &recording, network, batch: grid_batch(network, recording.sensor) };
    let places: Vec<usize> = (1..=PLACES).map(|i| recording.events.len() * i / (PLACES + 1)).collect();
    // The grids span the activations of windows at all places.
    let ends = places.iter().flat_map(|&place| (place - 1..place + EVENTS).step_by(EVENTS / 5));
    let seen: Vec<Trace> = ends.map(|end| windows.ending(end).1).collect();
    let largest = |l: usize, f: usize| {
        seen.iter().map(|trace| magnitude(&trace.levels[l].features[f])).fold(0.0, f32::max)
    };
    let levels = seen[0].levels.iter().enumerate();
    let ranges: Vec<Vec<f32>> =
        levels.map(|(l, level)| (0..level.features.len()).map(|f| largest(l, f)).collect()).collect();
    let layers: Vec<&str> = network.layers().into_iter().filter(|name| !name.starts_with("pool")).collect();
    let mut counts = WIDTHS.map(|_| vec![Counts::default(); layers.len()]);
    let mut worst = [[0f64; 2]; 3];
    for place in places {
        let last = windows.follow(place, &ranges, &mut counts);
        for (worst, found) in worst.iter_mut().zip(&last) {
            let deviation = Deviation::between(&last[0], found);
            *worst = [worst[0].max(deviation.max), worst[1].max(deviation.rms)];
        }
    }

    let events = (PLACES * EVENTS) as f64;
    println!("\n{}, {events} events at {PLACES} places, a prediction after each\n", recording.name);
    print_markdown_head(&COLUMNS);
    for (layer, name) in layers.iter().enumerate() {
        for ((width, _), counts) in WIDTHS.iter().zip(&counts) {
            let Counts { dirty, stayed, unchanged, edges, changed, few } = counts[layer];
            let over = |a: u64, b: u64| a as f64 / b as f64;
            let row = json!({
                "layer": name, "width": width, "dirty": dirty as f64 / events, "edges": over(edges, stayed),
                "changed": over(changed, stayed), "share": 100.0 * over(changed, edges),
                "few": 100.0 * over(few, stayed), "unchanged": 100.0 * over(unchanged, stayed),
            });
            print_markdown_row(&COLUMNS, &row);
        }
    }
    for ((width, _), [max, rms]) in WIDTHS.iter().zip(worst).skip(1) {
        println!(
            "\n{width} x: error of the last layer at the worst of the places, max {max:.1e}, RMS {rms:.1e}"
        );
    }
}

/// Windows of a recording.
struct Windows<'a> {
    recording: &'a Recording,
    network: &'a Arc<Network>,
    batch: Batch,
}

/// A window with its activations.
struct Window {
    /// Its first event.
    from: usize,
    trace: Trace,
    /// Of each width and level: the activations that enter it, then those of each block.
    features: [Vec<Vec<Matrix>>; 3],
}

impl Windows<'_> {
    /// The window that ends with event `end`, and its first event.
    fn ending(&self, end: usize) -> (usize, Trace) {
        let events = &self.recording.events;
        let now_us = events[end].t_us;
        let from = events.partition_point(|e| e.t_us < now_us - self.network.parts().span_us);
        let stream = Stream { events: &events[from..=end], epoch_us: events[0].t_us, now_us };
        (from, self.batch.forward(stream).expect("finite"))
    }

    /// The window that ends with event `end`, and its activations on each grid.
    fn window(&self, end: usize, ranges: &[Vec<f32>]) -> Window {
        let (from, trace) = self.ending(end);
        let features = WIDTHS.map(|(_, most)| {
            let mut features: Vec<Vec<Matrix>> = Vec::new();
            for (l, level) in trace.levels.iter().enumerate() {
                let entering = match l {
                    0 => level.features[0].clone(),
                    _ => pooled(&features[l - 1][self.network.parts().pooled[l - 1].0.from], &level.members),
                };
                let round = |block: usize, features: &mut Matrix| {
                    let Some(most) = most else { return };
                    let step = ranges[l][block + 1] / most;
                    let round = |x: f32| (x / step).round_ties_even().clamp(-most, most) * step;
                    features.lanes_mut().iter_mut().for_each(|lanes| *lanes = lanes.map(round));
                };
                features.push(level_features(self.network.level(l), level, entering, round));
            }
            features
        });
        Window { from, trace, features }
    }

    /// Adds the changes of the events from `place` on, and returns the last layer's activations after them.
    fn follow(&self, place: usize, ranges: &[Vec<f32>], counts: &mut [Vec<Counts>; 3]) -> [Vec<f32>; 3] {
        let (network, all) = (self.network, &self.recording.events);
        let mut before = self.window(place - 1, ranges);
        for (level, own) in before.trace.levels.iter().zip(&before.features[0]) {
            let equal = |(a, b): (&Matrix, &Matrix)| same_bits(a.lanes(), b.lanes());
            assert!(level.features.iter().zip(own).all(equal), "activations without a grid are the batch's");
        }
        let mut engine = Engine::new(network.clone(), self.recording.sensor).expect("the network is exact");
        // The epoch is the recording's, for poolings that have cells in time.
        engine.push(all[0]);
        engine.push_slice(&all[before.from.max(1)..place]);
        engine.predict().expect("finite");
        for (end, &event) in all.iter().enumerate().skip(place).take(EVENTS) {
            engine.push(event);
            let layers = network.layers().into_iter().zip(engine.predict().expect("finite").rows.to_vec());
            let own = layers.filter(|(name, _)| !name.starts_with("pool")).map(|(_, rows)| rows);
            let expected: Vec<u64> = counts[0].iter().zip(own).map(|(sum, rows)| sum.dirty + rows).collect();
            let after = self.window(end, ranges);
            for (width, counts) in counts.iter_mut().enumerate() {
                compare(network, width, [&before, &after], counts);
            }
            assert!(counts[0].iter().map(|layer| layer.dirty).eq(expected), "the engine's rows");
            before = after;
        }
        before.features.each_ref().map(|levels| flat(levels.last().and_then(|l| l.last()).expect("layers")))
    }
}

/// Channel-wise maxima over members.
fn pooled(features: &Matrix, members: &[Vec<usize>]) -> Matrix {
    let mut out = Matrix::zeros(members.len(), features.columns());
    for (cell, members) in members.iter().enumerate() {
        let to = out.row_mut(cell);
        to.fill(Lanes::splat(f32::NEG_INFINITY));
        members.iter().for_each(|&row| maximum(to, features.row(row)));
        clear_negative_zero(to);
    }
    out
}

/// Adds the layers' counts, from consecutive windows with activations of one width.
fn compare(network: &Network, width: usize, [before, after]: [&Window; 2], counts: &mut [Counts]) {
    let mut counts = counts.iter_mut();
    for (l, (old, new)) in before.trace.levels.iter().zip(&after.trace.levels).enumerate() {
        let cells: BTreeMap<_, usize> = old.cells.iter().enumerate().map(|(i, cell)| (cell, i)).collect();
        let event = |row| Some(row + after.from - before.from).filter(|&row| row < old.edges.rows());
        let row_before = |row| if l == 0 { event(row) } else { cells.get(&new.cells[row]).copied() };
        let rows_before: Vec<Option<usize>> = (0..new.edges.rows()).map(row_before).collect();
        let changes_of = |(old, new): (&Matrix, &Matrix)| -> Vec<bool> {
            let same = |row, at: Option<usize>| at.is_some_and(|at| same_bits(old.row(at), new.row(row)));
            rows_before.iter().enumerate().map(|(row, &at)| !same(row, at)).collect()
        };
        let features = before.features[width][l].iter().zip(&after.features[width][l]);
        let changed: Vec<Vec<bool>> = features.map(changes_of).collect();
        for (b, block) in network.level(l).blocks.iter().enumerate() {
            let counts = counts.next().expect("a layer for each block");
            for (row, &at) in rows_before.iter().enumerate() {
                let edges = new.edges.row(row);
                let edges_before = at.map_or(&[][..], |at| old.edges.row(at));
                let moved = changes(edges, edges_before, &rows_before, &changed[block.input]);
                let own = block.conv.reads_itself() && changed[block.input][row];
                let skip = block.skip.is_some_and(|skip| changed[skip][row]);
                let dirty = at.is_none() || moved > 0 || own || skip;
                assert!(dirty || !changed[b + 1][row], "a clean row keeps its value");
                counts.dirty += u64::from(dirty);
                if dirty && at.is_some() {
                    counts.stayed += 1;
                    counts.unchanged += u64::from(!changed[b + 1][row]);
                    counts.edges += edges.len() as u64;
                    counts.changed += moved as u64;
                    counts.few += u64::from(4 * moved <= edges.len());
                }
            }
        }
    }
}

/// In-edges that came or went (a pair of both is one), moved, or read a row that changed.
fn changes(
    edges: &[Neighbour],
    before: &[Neighbour],
    rows_before: &[Option<usize>],
    changed: &[bool],
) -> usize {
    let kept = |n: &&Neighbour| {
        let row = rows_before[n.row as usize];
        row.is_some_and(|row| before.iter().any(|b| b.row as usize == row && b.u == n.u))
    };
    let stayed: Vec<_> = edges.iter().filter(kept).collect();
    let altered = stayed.iter().filter(|n| changed[n.row as usize]).count();
    altered + edges.len().max(before.len()) - stayed.len()
}
