//! Rows to compute: real activations and in-edges, weights from a seed, and the engine's own answer.

use meissner_engine::Trace;
use meissner_kernels::{GraphRow, Isa, Lanes, Matrix, Neighbour, SplineConv, SplineParts};
use meissner_kernels::{SplineScratch, spline_basis};
use meissner_models::random::Random;

/// Rows of a problem.
pub(crate) const ROWS: usize = 1_024;
/// Rows that a kernel computes together.
pub(crate) const GROUP: usize = SplineConv::GROUP;

/// A spline block over rows of one degree.
pub(crate) struct Problem {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    pub(crate) degree: usize,
    pub(crate) parts: SplineParts,
    pub(crate) features: Matrix,
    /// `degree` in-edges a row.
    pub(crate) edges: Vec<Neighbour>,
    /// B(e, s) of each.
    pub(crate) basis: Vec<Lanes>,
    conv: SplineConv,
}

impl Problem {
    /// The first `degree` in-edges of rows in the middle of the window; activations of the event level's first feature
    /// with `inputs` channels.
    pub(crate) fn new(trace: &Trace, [inputs, outputs, degree]: [usize; 3]) -> Self {
        let level = &trace.levels[0];
        let features =
            level.features.iter().find(|f| f.columns() == inputs).expect("a feature of that width");
        let rows = (0..level.edges.rows()).map(|row| level.edges.row(row)).filter(|row| row.len() >= degree);
        let skip = level.edges.rows().saturating_sub(ROWS) / 2;
        let edges: Vec<Neighbour> =
            rows.skip(skip).take(ROWS).flat_map(|row| &row[..degree]).copied().collect();
        assert_eq!(edges.len(), ROWS * degree, "the window has enough rows");
        let mut random = Random::new(31);
        let parts = SplineParts {
            inputs,
            outputs,
            kernel: [2; 3],
            weight: random.values(8 * inputs * outputs, 1.0 / (inputs as f32).sqrt()),
            root: None,
            bias: Some(random.values(outputs, 0.3)),
            norm: Some((random.values(outputs, 1.0), random.values(outputs, 1.0))),
            elu: true,
        };
        let conv = SplineConv::new(&parts).expect("sizes fit");
        let basis = edges.iter().map(|n| spline_basis(n.u)).collect();
        Self { inputs, outputs, degree, parts, features: features.clone(), edges, basis, conv }
    }

    /// Every row as the engine computes it, over `edges` like the problem's own; their basis is at hand where it is given.
    pub(crate) fn engine(
        &self,
        edges: &[Neighbour],
        basis: Option<&[Lanes]>,
        scratch: &mut SplineScratch,
        out: &mut Matrix,
    ) {
        let mut group = [GraphRow::default(); GROUP];
        let lanes = out.lanes_mut().chunks_mut(GROUP * Lanes::count(self.outputs));
        for (g, (edges, out)) in edges.chunks(GROUP * self.degree).zip(lanes).enumerate() {
            for (r, (to, neighbours)) in group.iter_mut().zip(edges.chunks(self.degree)).enumerate() {
                let basis = basis.map_or(&[][..], |b| &b[(g * GROUP + r) * self.degree..][..self.degree]);
                *to = GraphRow { neighbours, basis, ..GraphRow::default() };
            }
            self.conv.rows(Isa::best(), &self.features, &group, scratch, out);
        }
    }

    /// The engine's answer over `edges` with `basis`.
    pub(crate) fn answer(&self, edges: &[Neighbour], basis: &[Lanes]) -> Matrix {
        let mut out = Matrix::zeros(ROWS, self.outputs);
        self.engine(edges, Some(basis), &mut SplineScratch::default(), &mut out);
        out
    }

    /// Multiply-adds of a row: sums per slot, and weights.
    pub(crate) fn multiply_adds(&self) -> [usize; 2] {
        [self.degree * 8 * self.inputs, 8 * self.inputs * self.outputs]
    }

    /// The step of each output's weights: 1, or the output's largest magnitude over `largest`.
    pub(crate) fn weight_steps(&self, largest: Option<f32>) -> Vec<f32> {
        let channel = |o: usize| self.parts.weight[o..].iter().step_by(self.outputs);
        let step = |largest: f32, o| channel(o).fold(0f32, |m, w| m.max(w.abs())) / largest;
        (0..self.outputs).map(|o| largest.map_or(1.0, |largest| step(largest, o))).collect()
    }
}

/// The values of a matrix, in whole lanes.
pub(crate) fn flat(matrix: &Matrix) -> Vec<f32> {
    matrix.lanes().iter().flat_map(|l| l.0).collect()
}

/// Largest magnitude of a matrix.
pub(crate) fn magnitude(matrix: &Matrix) -> f32 {
    flat(matrix).into_iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// The range that a grid of attributes covers.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Span {
    /// 0 to 1: every possible attribute.
    Whole,
    /// From the smallest to the largest attribute of the problem, axis by axis.
    Occurring,
}

/// In-edges whose attributes are rounded to a grid of q levels an axis.
#[derive(Clone)]
pub(crate) struct Rounded {
    pub(crate) edges: Vec<Neighbour>,
    /// Place of each edge's attribute on the grid.
    pub(crate) places: Vec<u32>,
    /// B of every place.
    pub(crate) bases: Vec<Lanes>,
}

impl Rounded {
    pub(crate) fn new(problem: &Problem, levels: usize, span: Span) -> Self {
        let widen = |[low, high]: [f32; 2], u: f32| [low.min(u), high.max(u)];
        let ranges: [[f32; 2]; 3] = std::array::from_fn(|d| match span {
            Span::Whole => [0.0, 1.0],
            Span::Occurring => problem.edges.iter().map(|n| n.u[d]).fold([1.0, 0.0], widen),
        });
        let most = (levels - 1) as f32;
        let level = |d: usize, u: f32| {
            let [low, high] = ranges[d];
            ((u - low) / (high - low) * most).round_ties_even() as usize
        };
        let value = |d: usize, level: usize| {
            let [low, high] = ranges[d];
            (low + (high - low) * (level as f32 / most)).clamp(0.0, 1.0)
        };
        let place = |u: [f32; 3]| (0..3).rev().fold(0, |at, d| at * levels + level(d, u[d]));
        let edge = |n: &Neighbour| Neighbour { u: std::array::from_fn(|d| value(d, level(d, n.u[d]))), ..*n };
        let at =
            |i: usize| [value(0, i % levels), value(1, i / levels % levels), value(2, i / (levels * levels))];
        Self {
            edges: problem.edges.iter().map(edge).collect(),
            places: problem.edges.iter().map(|n| place(n.u) as u32).collect(),
            bases: (0..levels.pow(3)).map(|i| spline_basis(at(i))).collect(),
        }
    }

    /// The basis of every edge, copied from the table.
    pub(crate) fn look_up(&self, basis: &mut Vec<Lanes>) {
        basis.clear();
        basis.extend(self.places.iter().map(|&place| self.bases[place as usize]));
    }

    /// W(u)(c,o) = sum over s of B(u, s) W(s, c, o) at a place.
    pub(crate) fn weights(&self, problem: &Problem, place: usize) -> Vec<f32> {
        let slots = problem.parts.weight.chunks_exact(problem.inputs * problem.outputs);
        let mut out = vec![0.0; problem.inputs * problem.outputs];
        for (&basis, slot) in self.bases[place].0.iter().zip(slots) {
            out.iter_mut().zip(slot).for_each(|(to, w)| *to += basis * w);
        }
        out
    }
}
