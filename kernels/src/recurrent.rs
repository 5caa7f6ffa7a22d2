//! Recurrent cells over vectors and planes, and the element-wise part that both share (Hochreiter
//! and Schmidhuber 1997; Gers et al. 2000):
//!
//! ```text
//! i = sigmoid(i), f = sigmoid(f), o = sigmoid(o)  with peepholes: of i + Vi c, f + Vf c, o + Vo c
//! c = f c + i squash(g)
//! h = o squash(c)
//! ```
//!
//! Sigmoid and tanh are quotients (`elementary.rs`). In i squash(g) and o squash(c), numerators and
//! denominators are multiplied, and divided once: divisions take longest.
//!
//! The output gate's peephole reads the cell before the step, like those of i and f (in Shi et al.
//! 2015, it reads the new cell). A peephole's product is rounded once with its gate, and f c is
//! rounded once with i squash(g).

mod lstm;

use crate::elementary::{Quotients, divided, sigmoid_quotients, tanh_quotients};
use crate::error::KernelError;
use crate::isa::{Exponent, Isa, Simd, Task, Vector, flat_wide_mut};
use crate::lanes::{LANES, Wide};
use crate::planar::{Occupancy, PlanarConv3x3, Planes, RowOut, TILE};

pub use lstm::{Lstm, LstmParts, LstmState};

/// Activation of the candidate and of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Squash {
    /// The hyperbolic tangent.
    #[default]
    Tanh,
    /// 1 / (1 + e^-x).
    Sigmoid,
}

impl Squash {
    #[inline(always)]
    fn of<S: Simd, V: Exponent<S>, const K: usize>(self, simd: S, x: [V; K]) -> Quotients<V, K> {
        match self {
            Self::Tanh => tanh_quotients(simd, x),
            Self::Sigmoid => sigmoid_quotients(simd, x),
        }
    }
}

const WIDTH: usize = 2 * LANES;

/// Updates every element. `gates` are the sums of i, f, g, o; `peephole` the weights of i, f, o on
/// the cell. `cell` is updated, `hidden` only written. O(elements).
///
/// # Panics
/// If the slices differ in length.
pub fn lstm_update(
    isa: Isa,
    gates: [&[f32]; 4],
    peephole: Option<[&[f32]; 3]>,
    squash: Squash,
    cell: &mut [f32],
    hidden: &mut [f32],
) {
    isa.run(Update { gates, peephole, squash, cell, hidden });
}

/// Updates rows of `channels`. A row of `gates` is i, f, g, o, (rows, 4 x channels); `peephole`,
/// `cell` and `hidden` are (rows, channels).
///
/// # Panics
/// If `channels` is zero, or a slice does not have the sizes of `cell`.
pub fn lstm_update_rows(
    isa: Isa,
    channels: usize,
    gates: &[f32],
    peephole: Option<[&[f32]; 3]>,
    squash: Squash,
    cell: &mut [f32],
    hidden: &mut [f32],
) {
    assert_eq!(gates.len(), 4 * cell.len(), "there must be four gates for each cell");
    assert_eq!(cell.len() % channels, 0, "cells must fill whole rows");
    isa.run(UpdateRows { channels, gates, peephole, squash, cell, hidden });
}

struct Update<'a> {
    gates: [&'a [f32]; 4],
    peephole: Option<[&'a [f32]; 3]>,
    squash: Squash,
    cell: &'a mut [f32],
    hidden: &'a mut [f32],
}

struct UpdateRows<'a> {
    channels: usize,
    gates: &'a [f32],
    peephole: Option<[&'a [f32]; 3]>,
    squash: Squash,
    cell: &'a mut [f32],
    hidden: &'a mut [f32],
}

impl Task for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let count = self.cell.len();
        assert!(self.gates.iter().all(|g| g.len() == count), "there must be a gate for each cell");
        assert!(
            self.peephole.iter().flatten().all(|p| p.len() == count),
            "there must be a peephole for each cell"
        );
        assert_eq!(self.hidden.len(), count, "there must be a hidden value for each cell");
        let mut at = 0;
        while S::WIDE && at + 4 * WIDTH <= count {
            simd.apart(Vectors::<4>(&mut self, at));
            at += 4 * WIDTH;
        }
        while at + 2 * WIDTH <= count {
            simd.apart(Vectors::<2>(&mut self, at));
            at += 2 * WIDTH;
        }
        while at + WIDTH <= count {
            simd.apart(Vectors::<1>(&mut self, at));
            at += WIDTH;
        }
        if at < count {
            let pad = |from: &[f32]| {
                let mut padded = [0.0; WIDTH];
                padded[..count - at].copy_from_slice(&from[at..]);
                padded
            };
            let (gates, peephole) = (self.gates.map(pad), self.peephole.map(|p| p.map(pad)));
            let (mut cell, mut hidden) = (pad(self.cell), [0.0; WIDTH]);
            let mut padded = Update {
                gates: gates.each_ref().map(|g| &g[..]),
                peephole: peephole.as_ref().map(|p| p.each_ref().map(|p| &p[..])),
                squash: self.squash,
                cell: &mut cell,
                hidden: &mut hidden,
            };
            simd.apart(Vectors::<1>(&mut padded, 0));
            self.cell[at..].copy_from_slice(&cell[..count - at]);
            self.hidden[at..].copy_from_slice(&hidden[..count - at]);
        }
    }
}

impl Task for UpdateRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { channels, gates, peephole, squash, cell, hidden } = self;
        let rows = cell.chunks_exact_mut(channels).zip(hidden.chunks_exact_mut(channels));
        for (row, ((cell, hidden), gates)) in rows.zip(gates.chunks_exact(4 * channels)).enumerate() {
            let gates = std::array::from_fn(|gate| &gates[gate * channels..][..channels]);
            let peephole = peephole.map(|p| p.map(|p| &p[row * channels..][..channels]));
            Update { gates, peephole, squash, cell, hidden }.run(simd);
        }
    }
}

/// K vectors of an update, from an element on. A function of its own, which four cells share.
struct Vectors<'a, 'b, const K: usize>(&'b mut Update<'a>, usize);

impl<const K: usize> Task for Vectors<'_, '_, K> {
    type Output = ();

    /// Updates them function by function: more at once would spill registers.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self(Update { gates, peephole, squash, cell, hidden }, at) = self;
        let old = load::<S, K>(simd, cell, at);
        let i = gate(simd, gates[0], peephole.map(|p| p[0]), at, old);
        let g = squash.of(simd, load::<S, K>(simd, gates[2], at));
        let mut c = times(i, g);
        let f = divided(gate(simd, gates[1], peephole.map(|p| p[1]), at, old));
        for (c, (f, old)) in c.iter_mut().zip(f.into_iter().zip(old)) {
            *c = c.add_product(f, old);
        }
        let o = gate(simd, gates[3], peephole.map(|p| p[2]), at, old);
        let h = times(o, squash.of(simd, c));
        for k in 0..K {
            c[k].store_slice(&mut cell[at + k * WIDTH..]);
            h[k].store_slice(&mut hidden[at + k * WIDTH..]);
        }
    }
}

/// The product of two quotients, with a single division.
#[inline(always)]
fn times<S, V: Exponent<S>, const K: usize>(a: Quotients<V, K>, b: Quotients<V, K>) -> [V; K] {
    let (mut above, mut below) = a;
    for k in 0..K {
        above[k] = above[k].mul(b.0[k]);
        below[k] = below[k].mul(b.1[k]);
    }
    divided((above, below))
}

/// Loads K vectors of a gate from `at` on.
#[inline(always)]
fn gate<S: Simd, const K: usize>(
    simd: S,
    gate: &[f32],
    peephole: Option<&[f32]>,
    at: usize,
    c: [S::V16; K],
) -> Quotients<S::V16, K> {
    let mut gate = load(simd, gate, at);
    if let Some(weights) = peephole {
        for ((gate, weight), c) in gate.iter_mut().zip(load::<S, K>(simd, weights, at)).zip(c) {
            *gate = gate.add_product(weight, c);
        }
    }
    sigmoid_quotients(simd, gate)
}

#[inline(always)]
fn load<S: Simd, const K: usize>(simd: S, from: &[f32], at: usize) -> [S::V16; K] {
    let mut out = [S::V16::splat(simd, 0.0); K];
    for (out, from) in out.iter_mut().zip(from[at..at + K * WIDTH].chunks_exact(WIDTH)) {
        *out = S::V16::load_slice(simd, from);
    }
    out
}

/// A convolutional LSTM cell over planes of few channels (Shi et al. 2015, without peepholes).
///
/// gates = w * [x, h] + b as in [`PlanarConv3x3`], then the gates' update, row by row. A new row of
/// h is written only after the row below has read the old one, because the state is replaced in
/// place.
#[derive(Clone, Debug)]
pub struct PlanarConvLstm {
    gates: PlanarConv3x3,
    hidden: usize,
    squash: Squash,
}

/// The cell state c of a convolutional LSTM, and scratch. The caller owns the hidden state h.
#[derive(Clone, Debug)]
pub struct PlanarConvLstmState {
    cell: Planes,
    /// A row of every gate, then the new row of h.
    row: Vec<Wide>,
}

impl PlanarConvLstm {
    /// A cell with `inputs` and `hidden` channels. `weight` is (4 x hidden, inputs + hidden, 3, 3)
    /// with gates i, f, g, o and inputs before the state; `bias` is (4 x hidden).
    ///
    /// # Errors
    /// A size of zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(
        inputs: usize,
        hidden: usize,
        weight: &[f32],
        bias: Option<&[f32]>,
        squash: Squash,
    ) -> Result<Self, KernelError> {
        let gates = PlanarConv3x3::new([inputs, hidden], hidden.saturating_mul(4), weight, bias, false)?;
        Ok(Self { gates, hidden, squash })
    }

    /// Bytes of a state.
    pub fn state_bytes(&self, height: usize, width: usize) -> u128 {
        let row = 5 * self.hidden as u128 * width.div_ceil(TILE) as u128;
        Planes::bytes_of(self.hidden, height, width) + row * size_of::<Wide>() as u128
    }

    /// The state before the first step: zeros, as the caller's hidden state must be.
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn state(&self, height: usize, width: usize) -> PlanarConvLstmState {
        let cell = Planes::zeros(self.hidden, height, width);
        let row = vec![Wide::ZERO; 5 * self.hidden * cell.tiles()];
        PlanarConvLstmState { cell, row }
    }

    /// One step: reads `x`, replaces `state` and `hidden`. `None` is an image of zeros. If `x` is
    /// `None`, or a tile is empty by `occupied`, the step costs less with the same bits. O(height x
    /// width x 9 x (inputs + hidden) x 4 hidden).
    ///
    /// # Panics
    /// If `x`, `state` or `hidden` does not have this cell's sizes.
    pub fn step(
        &self,
        isa: Isa,
        x: Option<&Planes>,
        occupied: Option<&Occupancy>,
        state: &mut PlanarConvLstmState,
        hidden: &mut Planes,
    ) {
        self.gates.check([x, Some(hidden)], occupied, state.cell.height(), state.cell.width());
        assert_eq!(state.cell.channels(), self.hidden, "the state must have the cell's channels");
        isa.run(Step { lstm: self, x, occupied, state, hidden });
    }
}

impl PlanarConvLstmState {
    /// The cell state, c.
    pub fn cell(&self) -> &Planes {
        &self.cell
    }

    /// The cell state, c, to write.
    pub fn cell_mut(&mut self) -> &mut Planes {
        &mut self.cell
    }

    /// Sets the state to zeros.
    pub fn reset(&mut self) {
        self.cell.clear();
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        self.cell.bytes() + size_of_val(&*self.row)
    }
}

struct Step<'a> {
    lstm: &'a PlanarConvLstm,
    x: Option<&'a Planes>,
    occupied: Option<&'a Occupancy>,
    state: &'a mut PlanarConvLstmState,
    hidden: &'a mut Planes,
}

impl Task for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { lstm, x, occupied, state: PlanarConvLstmState { cell, row }, hidden } = self;
        let (height, width, tiles) = (hidden.height(), hidden.width(), hidden.tiles());
        let (gates, next) = row.split_at_mut(4 * lstm.hidden * tiles);
        let (gates, next) = (flat_wide_mut(gates), flat_wide_mut(next));
        // Whole tiles, so that every vector is full.
        let columns = if tiles == 0 { 0 } else { next.len() / lstm.hidden };
        for y in 0..height {
            let out = RowOut { values: gates, stride: columns };
            lstm.gates.row(simd, [x, Some(hidden)], occupied, y, 0..tiles, out);
            if y > 0 {
                publish(hidden, y - 1, next, columns);
            }
            for channel in 0..lstm.hidden {
                let gate = |gate: usize| &gates[(gate * lstm.hidden + channel) * columns..][..columns];
                let cell = &mut cell.padded_mut(channel, y)[..columns];
                Update {
                    gates: std::array::from_fn(gate),
                    peephole: None,
                    squash: lstm.squash,
                    cell: &mut *cell,
                    hidden: &mut next[channel * columns..][..columns],
                }
                .run(simd);
                cell[width..].fill(0.0);
            }
        }
        if height > 0 {
            publish(hidden, height - 1, next, columns);
        }
    }
}

/// Writes row `y` of every plane.
#[inline(always)]
fn publish(hidden: &mut Planes, y: usize, next: &[f32], columns: usize) {
    let width = hidden.width();
    for channel in 0..hidden.channels() {
        hidden.row_mut(channel, y).copy_from_slice(&next[channel * columns..][..width]);
    }
}
