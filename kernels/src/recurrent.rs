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
//! The output gate's peephole reads the cell before the step, as i's and f's do (in Shi et al. 2015
//! the new one). A peephole's product is rounded once with its gate, f c with i squash(g).

mod conv_lstm;
mod lstm;

use crate::elementary::{Quotients, divided, sigmoid_quotients, tanh_quotients};
use crate::isa::{Exponent, Isa, Simd, Task, Vector};
use crate::lanes::LANES;

pub use conv_lstm::{PlanarConvLstm, PlanarConvLstmState};
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
    fn run<S: Simd>(self, simd: S) {
        let Self { gates, peephole, squash, cell, hidden } = self;
        let count = cell.len();
        assert!(gates.iter().all(|g| g.len() == count), "there must be a gate for each cell");
        assert!(
            peephole.iter().flatten().all(|p| p.len() == count),
            "there must be a peephole for each cell"
        );
        assert_eq!(hidden.len(), count, "there must be a hidden value for each cell");
        let mut at = 0;
        while S::WIDE && at + 4 * WIDTH <= count {
            vectors::<S, 4>(simd, gates, peephole, squash, at, cell, hidden);
            at += 4 * WIDTH;
        }
        while at + 2 * WIDTH <= count {
            vectors::<S, 2>(simd, gates, peephole, squash, at, cell, hidden);
            at += 2 * WIDTH;
        }
        while at + WIDTH <= count {
            vectors::<S, 1>(simd, gates, peephole, squash, at, cell, hidden);
            at += WIDTH;
        }
        if at < count {
            let pad = |from: &[f32]| {
                let mut padded = [0.0; WIDTH];
                padded[..count - at].copy_from_slice(&from[at..]);
                padded
            };
            let (gates, peephole) = (gates.map(pad), peephole.map(|p| p.map(pad)));
            let (mut c, mut h) = (pad(cell), [0.0; WIDTH]);
            let peephole = peephole.as_ref().map(|p| p.each_ref().map(|p| &p[..]));
            vectors::<S, 1>(simd, gates.each_ref().map(|g| &g[..]), peephole, squash, 0, &mut c, &mut h);
            cell[at..].copy_from_slice(&c[..count - at]);
            hidden[at..].copy_from_slice(&h[..count - at]);
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

/// Updates K vectors from `at` on, function by function: more at once would spill registers.
#[inline(always)]
fn vectors<S: Simd, const K: usize>(
    simd: S,
    gates: [&[f32]; 4],
    peephole: Option<[&[f32]; 3]>,
    squash: Squash,
    at: usize,
    cell: &mut [f32],
    hidden: &mut [f32],
) {
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
