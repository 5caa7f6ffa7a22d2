//! a(p, o) = sum of v(c) W(c, o) over c with c mod 4 = p, ascending: the products of a row with weights.
//!
//! Four partial sums per output keep the adders busy, and blocks of two output lanes keep them in registers.

use crate::lanes::{LANES, Lanes};

/// Weights (rows, O) by blocks of output lanes: all rows of the first two lanes, then of the next two, and so on; an odd
/// last lane stands alone.
#[derive(Clone, Debug)]
pub(super) struct Packed {
    rows: usize,
    data: Vec<Lanes>,
}

impl Packed {
    /// Packs `weight`, rows of `outputs` values.
    pub(super) fn new(weight: &[f32], outputs: usize) -> Self {
        let rows = weight.len() / outputs;
        let lanes: Vec<Vec<Lanes>> = weight.chunks_exact(outputs).map(Lanes::pack).collect();
        let blocks = (0..Lanes::count(outputs)).step_by(2);
        let row = |block: usize| lanes.iter().flat_map(move |row| row[block..].iter().take(2).copied());
        Self { rows, data: blocks.flat_map(row).collect() }
    }

    /// Every row of output lanes `lane..lane + B`, one of the blocks.
    #[inline(always)]
    pub(super) fn block<const B: usize>(&self, lane: usize) -> &[[Lanes; B]] {
        self.data[lane * self.rows..][..B * self.rows].as_chunks().0
    }
}

/// Partial sums of B output lanes.
pub(super) type Partial<const B: usize> = [[Lanes; B]; 4];

/// Adds the products of `weight`'s rows with as many of `values`.
#[inline(always)]
pub(super) fn contract<const B: usize>(acc: &mut Partial<B>, values: &[Lanes], weight: &[[Lanes; B]]) {
    let (eights, rest) = weight.as_chunks::<LANES>();
    let mut values = values.iter();
    for (weight, values) in eights.iter().zip(&mut values) {
        for c in 0..LANES {
            multiply_add(&mut acc[c % 4], values.0[c], &weight[c]);
        }
    }
    if let Some(values) = values.next() {
        for (c, (weight, &value)) in rest.iter().zip(&values.0).enumerate() {
            multiply_add(&mut acc[c % 4], value, weight);
        }
    }
}

/// acc(o) += value weight(o), product and sum rounded separately.
#[inline(always)]
fn multiply_add<const B: usize>(acc: &mut [Lanes; B], value: f32, weight: &[Lanes; B]) {
    let value = Lanes::splat(value);
    for (a, &w) in acc.iter_mut().zip(weight) {
        *a = *a + value * w;
    }
}

/// (a0 + a1) + (a2 + a3).
#[inline(always)]
pub(super) fn total<const B: usize>(acc: &Partial<B>) -> [Lanes; B] {
    let mut out = [Lanes::ZERO; B];
    for (b, out) in out.iter_mut().enumerate() {
        *out = (acc[0][b] + acc[1][b]) + (acc[2][b] + acc[3][b]);
    }
    out
}
