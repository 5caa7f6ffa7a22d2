//! The changes that events of a recording cause: events enter one by one, and the network over the window after each is
//! compared with the one before, row by row. Once exact, and twice with the activations of every layer rounded to a grid.
//!
//! A row is dirty where an in-edge came, went or moved, where a source's value changed, or where its skip did. The
//! exact numbers of dirty rows must equal the engine's own counters.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use meissner_benches::answers::Deviation;
use meissner_benches::networks::{grid_batch, level_features};
use meissner_benches::streams::Recording;
use meissner_engine::{Batch, Engine, LevelTrace, Network, Stream, Trace};
use meissner_kernels::{Lanes, Matrix, Neighbour, clear_negative_zero, maximum};

use crate::problem::{flat, magnitude};
use crate::rows::Width;

/// Counts of one layer.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LayerWave {
    /// Rows recomputed.
    pub(crate) dirty: u64,
    /// Of these, rows that existed before.
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

/// Activations of each level: the one that enters it, then the one that each block wrote.
type Features = Vec<Vec<Matrix>>;

/// The step and the largest number of steps of each block's activations, by level; none where they stay exact.
type Grids = Option<Vec<Vec<[f32; 2]>>>;

/// Counts of every layer.
#[derive(Clone, Default)]
pub(crate) struct Waves {
    pub(crate) layers: Vec<LayerWave>,
    /// Of the last layer after the last event at each place.
    pub(crate) deviations: Vec<Deviation>,
}

/// The changes of `count` events from each of `places` of a recording, with a prediction after each: exact, i16, i8. The
/// grids span the activations of windows at all places.
///
/// # Panics
/// If the exact rows are not as many as the engine recomputes.
pub(crate) fn waves(
    network: &Arc<Network>,
    recording: &Recording,
    places: &[usize],
    count: usize,
) -> [Waves; 3] {
    let windows = Windows { recording, network, batch: grid_batch(network, recording.sensor) };
    let ends = places.iter().flat_map(|&place| (place - 1..place + count).step_by(count / 5));
    let seen: Vec<Trace> = ends.map(|end| windows.ending(end).1).collect();
    let grids = [Width::F32, Width::I16, Width::I8].map(|width| {
        let [most, _] = width.steps()?;
        let grid = |l: usize, f: usize| {
            let of_window = |trace: &Trace| magnitude(&trace.levels[l].features[f]);
            [seen.iter().map(of_window).fold(0.0, f32::max) / most, most]
        };
        let levels = seen[0].levels.iter().enumerate();
        Some(levels.map(|(l, level)| (1..level.features.len()).map(|f| grid(l, f)).collect()).collect())
    });
    let mut out: [Waves; 3] = Default::default();
    for &start in places {
        windows.follow(start..start + count, &grids, &mut out);
    }
    out
}

/// Windows of a recording.
struct Windows<'a> {
    recording: &'a Recording,
    network: &'a Arc<Network>,
    batch: Batch,
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

    /// Adds the changes of each of `events`.
    fn follow(&self, events: Range<usize>, grids: &[Grids; 3], out: &mut [Waves; 3]) {
        let (network, all) = (self.network, &self.recording.events);
        let (mut from, mut before) = self.ending(events.start - 1);
        let mut engine = Engine::new(network.clone(), self.recording.sensor).expect("the network is exact");
        // The epoch is the recording's, for poolings that have cells in time.
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
                let dirty = |out: &Waves| out.layers.iter().map(|w| w.dirty).collect::<Vec<_>>();
                let layers = network.layers().into_iter().zip(&rows);
                let own: Vec<u64> =
                    layers.filter(|(name, _)| !name.starts_with("pool")).map(|(_, &rows)| rows).collect();
                out.layers.resize(own.len(), LayerWave::default());
                let earlier = dirty(out);
                step.compare([features, &next], &mut out.layers);
                let expected: Vec<u64> = earlier.iter().zip(&own).map(|(sum, rows)| sum + rows).collect();
                assert!(i > 0 || dirty(out) == expected, "the engine's rows: {own:?}");
                *features = next;
            }
            (from, before) = (next_from, after);
        }
        let last = features.each_ref().map(|levels| levels.last().and_then(|l| l.last()).expect("layers"));
        for (out, found) in out.iter_mut().zip(last) {
            out.deviations.push(Deviation::between(&flat(last[0]), &flat(found)));
        }
    }
}

/// Every activation over the graphs of `trace`, rounded to `grids`.
fn forward(network: &Network, trace: &Trace, grids: &Grids) -> Features {
    let mut out: Features = Vec::new();
    for (l, level) in trace.levels.iter().enumerate() {
        let entering = match l {
            0 => level.features[0].clone(),
            _ => pooled(&out[l - 1][network.parts().pooled[l - 1].0.from], &level.members),
        };
        out.push(level_features(network.level(l), level, entering, |block, features| {
            let Some(grids) = grids else { return };
            let [step, most] = grids[l][block];
            let round = |x: f32| (x / step).round_ties_even().clamp(-most, most) * step;
            features.lanes_mut().iter_mut().for_each(|lanes| *lanes = lanes.map(round));
        }));
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
        clear_negative_zero(to);
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
    /// Adds the layers' counts, from activations before and after.
    fn compare(&self, [before, after]: [&Features; 2], waves: &mut [LayerWave]) {
        let mut waves = waves.iter_mut();
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
                let wave = waves.next().expect("a layer for each block");
                for (row, &at) in rows_before.iter().enumerate() {
                    let edges = new.edges.row(row);
                    let edges_before = at.map_or(&[][..], |at| old.edges.row(at));
                    let moved = changes(edges, edges_before, &rows_before, &changed[block.input]);
                    let own = block.conv.reads_itself() && changed[block.input][row];
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
            }
        }
    }

    /// The row that each row of a level was before.
    fn rows_before(&self, level: usize) -> Vec<Option<usize>> {
        let [old, new] = self.levels.map(|levels| &levels[level]);
        if level == 0 {
            let rows = self.expired..self.expired + new.edges.rows();
            return rows.map(|row| Some(row).filter(|&row| row < old.edges.rows())).collect();
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
