//! What a recording changes: events enter one by one, and the network over the window after each is compared with the
//! one before, row by row. Once exact, and twice with the activations of every layer rounded to a grid.
//!
//! A row is dirty where an in-edge came, went or moved, where a source's value changed, or where its skip did. The
//! exact numbers of dirty rows are held against the engine's own counters.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use meissner_benches::streams::Recording;
use meissner_engine::{Batch, Engine, LevelTrace, Network, Search, Stream, Trace};
use meissner_kernels::{Isa, Lanes, Matrix, Neighbour, SplineRow, SplineScratch, maximum, settle};

use crate::integer::Width;
use crate::problem::{Error, error};

/// Counts of one layer.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LayerWave {
    /// Rows recomputed.
    pub(crate) dirty: u64,
    /// Of these, rows that were there before.
    pub(crate) stayed: u64,
    /// Of these, rows that came out the same.
    pub(crate) unchanged: u64,
    /// In-edges of rows that stayed.
    pub(crate) edges: u64,
    /// Of these, in-edges that came (one that went beside it is the same change), moved or read another value.
    pub(crate) changed: u64,
    /// Rows that stayed with at most a quarter of their in-edges changed.
    pub(crate) few: u64,
}

/// Activations of each level: what enters it, then what each block wrote.
type Features = Vec<Vec<Matrix>>;

/// What activations are rounded to, by level and feature.
type Grids = Vec<Vec<Option<Grid>>>;

#[derive(Clone, Copy)]
struct Grid {
    step: f32,
    largest: f32,
}

/// Counts of every layer, and how far the last one is off.
#[derive(Clone, Default)]
pub(crate) struct Waves {
    pub(crate) layers: Vec<LayerWave>,
    /// Of the last layer after the last event at each place.
    pub(crate) errors: Vec<Error>,
}

/// What `count` events from each of `places` of a recording change, a prediction after each: exact, i16, i8. The grids
/// span what the windows at all places hold, and are the same throughout.
///
/// # Panics
/// If the exact rows are not as many as the engine recomputes.
pub(crate) fn waves(
    network: &Arc<Network>,
    recording: &Recording,
    places: &[usize],
    count: usize,
) -> [Waves; 3] {
    let windows = Windows {
        recording,
        span_us: network.parts().span_us,
        batch: Batch::new(network.clone(), recording.sensor)
            .expect("the sensor has pixels")
            .with_search(Search::Grid),
    };
    let ends = places.iter().flat_map(|&place| (place - 1..place + count).step_by(count / 5));
    let seen: Vec<Trace> = ends.map(|end| windows.ending(end).1).collect();
    let grids = [None, Some(Width::I16), Some(Width::I8)].map(|width| grids(&seen, width));
    let mut out: [Waves; 3] = Default::default();
    for &start in places {
        windows.follow(network, start..start + count, &grids, &mut out);
    }
    out
}

/// Windows of a recording.
struct Windows<'a> {
    recording: &'a Recording,
    span_us: i64,
    batch: Batch,
}

impl Windows<'_> {
    /// The window that ends with event `end`, and its first event.
    fn ending(&self, end: usize) -> (usize, Trace) {
        let events = &self.recording.events;
        let now_us = events[end].t_us;
        let from = events.partition_point(|e| e.t_us < now_us - self.span_us);
        let stream = Stream { events: &events[from..=end], epoch_us: events[0].t_us, now_us };
        (from, self.batch.forward(stream).expect("finite"))
    }

    /// Adds what each of `events` changes.
    fn follow(&self, network: &Arc<Network>, events: Range<usize>, grids: &[Grids; 3], out: &mut [Waves; 3]) {
        let Recording { events: all, sensor, .. } = self.recording;
        let (mut from, mut before) = self.ending(events.start - 1);
        let mut engine = Engine::new(network.clone(), *sensor).expect("the network is exact");
        // The epoch is the recording's, for those poolings that have cells in time.
        engine.push(all[0]);
        engine.push_slice(&all[from.max(1)..events.start]);
        engine.predict().expect("finite");
        let mut features = grids.each_ref().map(|grids| forward(network, &before, grids));
        for (level, own) in before.levels.iter().zip(&features[0]) {
            let equal = |(a, b): (&Matrix, &Matrix)| a.lanes() == b.lanes();
            assert!(level.features.iter().zip(own).all(equal), "activations without a grid are the batch's");
        }
        for end in events {
            engine.push(all[end]);
            let rows = engine.predict().expect("finite").rows.to_vec();
            let (next_from, after) = self.ending(end);
            let step = Step { network, levels: [&before.levels, &after.levels], expired: next_from - from };
            for (i, ((grids, features), out)) in grids.iter().zip(&mut features).zip(&mut *out).enumerate() {
                let next = forward(network, &after, grids);
                let waves = step.compare([features, &next]);
                let layers = network.layers().into_iter().zip(&rows);
                let own = layers.filter(|(name, _)| !name.starts_with("pool")).map(|(_, &rows)| rows);
                assert!(
                    i > 0 || waves.iter().map(|w| w.dirty).eq(own),
                    "the engine's rows: {rows:?}, {waves:?}"
                );
                out.layers.resize(waves.len(), LayerWave::default());
                out.layers.iter_mut().zip(waves).for_each(|(sum, wave)| sum.add(wave));
                *features = next;
            }
            (from, before) = (next_from, after);
        }
        let last = features.map(|mut levels| levels.pop().and_then(|mut level| level.pop()).expect("layers"));
        for (out, got) in out.iter_mut().zip(&last) {
            out.errors.push(error(got, &last[0]));
        }
    }
}

impl LayerWave {
    fn add(&mut self, other: Self) {
        self.few += other.few;
        self.dirty += other.dirty;
        self.stayed += other.stayed;
        self.unchanged += other.unchanged;
        self.edges += other.edges;
        self.changed += other.changed;
    }
}

/// Grids that span the largest magnitude of each feature that a block wrote.
fn grids(seen: &[Trace], width: Option<Width>) -> Grids {
    let feature = |l: usize, f: usize| {
        let largest = width.filter(|_| f > 0)?.largest();
        let values =
            seen.iter().flat_map(|trace| trace.levels[l].features[f].lanes()).flat_map(|lanes| lanes.0);
        Some(Grid { step: values.fold(0f32, |m, x| m.max(x.abs())) / largest, largest })
    };
    let levels = seen[0].levels.iter().enumerate();
    levels.map(|(l, level)| (0..level.features.len()).map(|f| feature(l, f)).collect()).collect()
}

/// Every activation over the graphs of `trace`, rounded to `grids`.
fn forward(network: &Network, trace: &Trace, grids: &Grids) -> Features {
    let mut scratch = SplineScratch::default();
    let mut out: Features = Vec::new();
    for (l, (trace, grids)) in trace.levels.iter().zip(grids).enumerate() {
        let mut written = vec![match l {
            0 => trace.features[0].clone(),
            _ => pooled(&out[l - 1][network.parts().pooled[l - 1].0.from], &trace.members),
        }];
        for (block, grid) in network.level(l).blocks.iter().zip(&grids[1..]) {
            let mut to = Matrix::zeros(trace.edges.rows(), block.conv.outputs());
            let (input, skip) = (&written[block.input], block.skip.map(|skip| &written[skip]));
            let row = |i| SplineRow {
                neighbours: trace.edges.row(i),
                basis: &[],
                own: input.row(i),
                skip: skip.map(|skip| skip.row(i)),
            };
            let rows: Vec<_> = (0..to.rows()).map(row).collect();
            block.conv.rows(Isa::best(), input, &rows, &mut scratch, to.lanes_mut());
            if let Some(grid) = grid {
                let round =
                    |x: f32| (x / grid.step).round_ties_even().clamp(-grid.largest, grid.largest) * grid.step;
                to.lanes_mut().iter_mut().for_each(|lanes| *lanes = lanes.map(round));
            }
            written.push(to);
        }
        out.push(written);
    }
    out
}

/// Channel-wise maxima over members.
fn pooled(features: &Matrix, members: &[Vec<usize>]) -> Matrix {
    let mut out = Matrix::zeros(members.len(), features.columns());
    for (cell, members) in members.iter().enumerate() {
        let to = out.row_mut(cell);
        to.fill(Lanes::splat(f32::NEG_INFINITY));
        members.iter().for_each(|&row| maximum(to, features.row(row)));
        settle(to);
    }
    out
}

/// Two consecutive windows.
struct Step<'a> {
    network: &'a Network,
    levels: [&'a [LevelTrace]; 2],
    /// Events that left between them.
    expired: usize,
}

impl Step<'_> {
    /// The layers' counts, from activations before and after.
    fn compare(&self, [before, after]: [&Features; 2]) -> Vec<LayerWave> {
        let mut out = Vec::new();
        for (l, (old, new)) in self.levels[0].iter().zip(self.levels[1]).enumerate() {
            let rows_before = self.rows_before(l);
            let differs = |(old, new): (&Matrix, &Matrix)| -> Vec<bool> {
                let same = |(row, before): (usize, &Option<usize>)| {
                    before.is_some_and(|before| old.row(before).iter().zip(new.row(row)).all(same_bits))
                };
                rows_before.iter().enumerate().map(|at| !same(at)).collect()
            };
            let changed: Vec<Vec<bool>> = before[l].iter().zip(&after[l]).map(differs).collect();
            for (b, block) in self.network.level(l).blocks.iter().enumerate() {
                let mut wave = LayerWave::default();
                for (row, &at) in rows_before.iter().enumerate() {
                    let edges = new.edges.row(row);
                    let edges_before = at.map_or(&[][..], |at| old.edges.row(at));
                    let moved = changes(edges, edges_before, &rows_before, &changed[block.input]);
                    let own = block.conv.has_root() && changed[block.input][row];
                    let skip = block.skip.is_some_and(|skip| changed[skip][row]);
                    if at.is_some() && moved == 0 && !own && !skip {
                        assert!(!changed[b + 1][row], "a clean row keeps its value");
                        continue;
                    }
                    wave.dirty += 1;
                    if at.is_some() {
                        wave.stayed += 1;
                        wave.unchanged += u64::from(!changed[b + 1][row]);
                        wave.edges += edges.len() as u64;
                        wave.changed += moved as u64;
                        wave.few += u64::from(4 * moved <= edges.len());
                    }
                }
                out.push(wave);
            }
        }
        out
    }

    /// The row that each row of a level was before.
    fn rows_before(&self, level: usize) -> Vec<Option<usize>> {
        let [old, new] = self.levels.map(|levels| &levels[level]);
        if level == 0 {
            let count = old.edges.rows();
            return (0..new.edges.rows())
                .map(|row| Some(row + self.expired).filter(|&row| row < count))
                .collect();
        }
        let places: BTreeMap<[i64; 3], usize> =
            old.cells.iter().enumerate().map(|(i, &cell)| (cell, i)).collect();
        new.cells.iter().map(|cell| places.get(cell).copied()).collect()
    }
}

fn same_bits((a, b): (&Lanes, &Lanes)) -> bool {
    a.0.map(f32::to_bits) == b.0.map(f32::to_bits)
}

/// In-edges that came or went (a pair of both is one), moved, or read a row that changed.
fn changes(
    edges: &[Neighbour],
    before: &[Neighbour],
    rows_before: &[Option<usize>],
    changed: &[bool],
) -> usize {
    let kept = |n: &Neighbour| {
        let row = rows_before[n.row as usize];
        row.is_some_and(|row| before.iter().any(|b| b.row as usize == row && b.u == n.u))
    };
    let stayed = edges.iter().filter(|n| kept(n)).count();
    let altered = edges.iter().filter(|n| kept(n) && changed[n.row as usize]).count();
    altered + (edges.len() - stayed).max(before.len() - stayed)
}
