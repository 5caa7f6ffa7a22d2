//! Rows kept in integers and updated by what changed: some in-edges read another value than before.
//!
//! ```text
//! by slots    S' += sum over changed e of B'(e) (x'new - x'old), then T' and all of a' again
//! by table    a' += sum over changed e of (x'new - x'old) W'(u(e)), W' tabulated for rounded attributes
//! ```
//!
//! Both are exact: what is subtracted is what was added. A changed edge touches all eight slots of a 2 x 2 x 2 kernel,
//! so by slots nothing of the contraction is saved; by table, a changed edge costs C O products.

use meissner_kernels::{Isa, Neighbour, Simd, Task};
use pulp::x86::V4;

use crate::float::{Finish, Stage, steps};
use crate::integer::{EdgePair, IntegerRows, finished, padded, quantised};
use crate::problem::{Problem, ROWS};
use crate::table::Rounded;
use crate::vectors::{Dot, Pairs, Words, splat};

/// The row that is read instead of `row`.
fn instead(row: u32, rows: usize) -> u32 {
    (row + 1) % rows as u32
}

/// Makes `rows` start from the sums that they have, and replace the sources of the first `changed` in-edges of each.
///
/// # Panics
/// If the sums that this leaves are not those that come from nothing.
pub(crate) fn update_by_slots<const C: usize, const B: usize>(
    rows: &mut IntegerRows<C, B>,
    problem: &Problem,
    changed: usize,
) {
    let per_row = problem.degree / 2;
    rows.state = vec![[0; 16]; ROWS * IntegerRows::<C, B>::STATE];
    rows.run::<Pairs>(Stage::Sums);
    assert_eq!(rows.state_values(), rows.scalar_state(), "sums in vectors");
    let mut whole = rows.pairs.clone();
    let mut changes = Vec::new();
    for row in whole.chunks_mut(per_row) {
        for e in 0..changed {
            let pair = &mut row[e / 2];
            let old = pair.rows[e % 2];
            pair.rows[e % 2] = instead(old, problem.features.rows());
            let basis = pair.basis.map(|both| [both[e % 2], -both[e % 2]]);
            changes.push(EdgePair { rows: [pair.rows[e % 2], old], basis });
        }
    }
    (rows.pairs, rows.per_row) = (changes, changed);
    rows.run::<Pairs>(Stage::Sums);
    let updated = rows.state_values();
    let changes = std::mem::replace(&mut rows.pairs, whole);
    rows.per_row = per_row;
    assert_eq!(updated, rows.scalar_state(), "updated sums");
    (rows.pairs, rows.per_row) = (changes, changed);
}

/// Totals of rows kept in integers, and updated for some changed in-edges of each: a' += sum of (x'new - x'old) W'(u).
pub(crate) struct TableUpdates<const C: usize, const B: usize> {
    v: V4,
    /// x', old rows and new ones.
    features: Vec<i16>,
    /// Of each row's changed edges, one row's after the other: old and new source, and the attribute's place.
    pub(crate) changes: Vec<([u32; 2], u32)>,
    /// Changes of a row.
    pub(crate) per_row: usize,
    /// (place, pair of c, block) words.
    table: Vec<Words>,
    finish: Finish,
    /// a' of every row.
    pub(crate) totals: Vec<[i32; 16]>,
    out: Vec<i16>,
}

impl<const C: usize, const B: usize> TableUpdates<C, B> {
    /// The first `changed` in-edges of each row change their source, with the activations and the scale of `rows`.
    pub(crate) fn new(
        rows: &IntegerRows<C, B>,
        problem: &Problem,
        rounded: &Rounded,
        changed: usize,
    ) -> Self {
        let steps = steps(problem, Some(127.0));
        let mut table = Vec::new();
        for place in 0..rounded.bases.len() {
            for pair in rounded.weights(problem, place).chunks_exact(2 * 16 * B) {
                for b in 0..B {
                    let at = |c: usize, o: usize| quantised(pair[16 * (B * c + b) + o], steps[16 * b + o]);
                    table.push(Words(std::array::from_fn(|o| Pairs::word(&[at(0, o), at(1, o)]))));
                }
            }
        }
        let features = problem.features.rows();
        let change = |(n, &place): (&Neighbour, &u32)| ([n.row, instead(n.row, features)], place);
        let edges = problem.edges.iter().zip(&rounded.places);
        let changes: Vec<_> = edges.map(change).collect();
        let changes = changes.chunks(problem.degree).flat_map(|row| &row[..changed]).copied().collect();
        Self {
            v: rows.v,
            features: rows.features.clone(),
            changes,
            per_row: changed,
            table,
            finish: rows.finish.clone(),
            totals: vec![[0; 16]; ROWS * B],
            out: vec![0; ROWS * 16 * B],
        }
    }

    /// Updates every row.
    pub(crate) fn run(&mut self) {
        Isa::best().run(Update { rows: self });
    }

    /// a' of every row after [`Self::run`] from zeros, by plain loops.
    pub(crate) fn scalar_totals(&self) -> Vec<[i32; 16]> {
        let mut out = vec![[0; 16]; ROWS * B];
        for (changes, totals) in self.changes.chunks(self.per_row).zip(out.chunks_mut(B)) {
            for &(sources, place) in changes {
                let [old, new] = sources.map(|row| &self.features[row as usize * padded(C)..][..C]);
                for c in 0..C {
                    let x = i32::from(new[c]) - i32::from(old[c]);
                    for (b, totals) in totals.iter_mut().enumerate() {
                        let words = self.table[(place as usize * C / 2 + c / 2) * B + b].0;
                        let weight = |word: i32| i32::from(pulp::cast::<_, [i16; 2]>(word)[c % 2]);
                        totals.iter_mut().zip(words).for_each(|(t, w)| *t += x * weight(w));
                    }
                }
            }
        }
        out
    }
}

struct Update<'a, const C: usize, const B: usize> {
    rows: &'a mut TableUpdates<C, B>,
}

impl<const C: usize, const B: usize> Task for Update<'_, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let TableUpdates { v, features, changes, per_row, table, finish, totals, out } = self.rows;
        let v = *v;
        let totals = totals.chunks_exact_mut(B).zip(out.chunks_exact_mut(16 * B));
        for (changes, (totals, out)) in changes.chunks_exact(*per_row).zip(totals) {
            let mut acc = [[splat(v, 0); B]; 4];
            for &(sources, place) in changes {
                let rows = sources.map(|row| &features[row as usize * padded(C)..][..C]);
                let mut x = [0; C];
                for (x, (old, new)) in x.iter_mut().zip(rows[0].iter().zip(rows[1])) {
                    *x = new.wrapping_sub(*old);
                }
                let weights = &table[place as usize * C / 2 * B..][..C / 2 * B];
                for (x, weights) in x.as_chunks::<8>().0.iter().zip(weights.chunks_exact(4 * B)) {
                    for ((acc, &x), weights) in
                        acc.iter_mut().zip(x.as_chunks::<2>().0).zip(weights.chunks_exact(B))
                    {
                        let x = splat(v, pulp::cast(x));
                        for (acc, w) in acc.iter_mut().zip(weights) {
                            *acc = Pairs::dot(v, *acc, x, pulp::cast(w.0));
                        }
                    }
                }
            }
            for (b, (total, out)) in totals.iter_mut().zip(out.chunks_exact_mut(16)).enumerate() {
                let add = |a, b| v.avx512f._mm512_add_epi32(a, b);
                let sum = add(add(acc[0][b], acc[1][b]), add(acc[2][b], acc[3][b]));
                let sum = add(sum, pulp::cast(*total));
                *total = pulp::cast(sum);
                out.copy_from_slice(&finished(v, simd, finish, b, sum));
            }
        }
    }
}
