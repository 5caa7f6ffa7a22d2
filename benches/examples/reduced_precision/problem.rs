//! Rows to compute: real activations and in-edges, weights from a seed, and the engine's own answer.

use meissner_engine::Trace;
use meissner_kernels::{
    GraphRow, Isa, Lanes, Matrix, Neighbour, SplineConv, SplineParts, SplineScratch, spline_basis,
};
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
        for (g, out) in out.lanes_mut().chunks_mut(GROUP * Lanes::count(self.outputs)).enumerate() {
            let group: [_; GROUP] = std::array::from_fn(|r| {
                let own = (g * GROUP + r) * self.degree..(g * GROUP + r + 1) * self.degree;
                let basis = basis.map_or(&[][..], |basis| &basis[own.clone()]);
                GraphRow { neighbours: &edges[own], basis, ..GraphRow::default() }
            });
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

    /// The row that is read instead of `row` after a change.
    pub(crate) fn instead(&self, row: u32) -> u32 {
        (row + 1) % self.features.rows() as u32
    }

    /// The weights of output `o`.
    pub(crate) fn weights_of(&self, o: usize) -> impl Iterator<Item = f32> {
        self.parts.weight[o..].iter().step_by(self.outputs).copied()
    }
}

/// The ranges of the numbers of rows.
#[derive(Clone, Copy, Default)]
pub(crate) struct Ranges {
    /// Largest magnitude of an activation in steps, and steps of 1 of the basis; none in f32.
    pub(crate) steps: Option<[f32; 2]>,
    /// Largest magnitude that the weights of an output are scaled to, if they are scaled.
    pub(crate) weight: Option<f32>,
    /// Largest magnitude of a stored integer sum of inputs.
    pub(crate) sum: u32,
}

/// The values of a matrix, in whole lanes.
pub(crate) fn flat(matrix: &Matrix) -> Vec<f32> {
    matrix.lanes().iter().flat_map(|l| l.0).collect()
}

/// Largest magnitude of a matrix.
pub(crate) fn magnitude(matrix: &Matrix) -> f32 {
    flat(matrix).into_iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// In-edges whose attributes are rounded to a grid of some levels an axis.
pub(crate) struct Rounded {
    pub(crate) edges: Vec<Neighbour>,
    /// Place of each edge's attribute on the grid.
    pub(crate) places: Vec<u32>,
    /// B of every place.
    pub(crate) bases: Vec<Lanes>,
}

impl Rounded {
    /// A grid over the attributes of `problem`, axis by axis, or over 0 to 1.
    pub(crate) fn new(problem: &Problem, levels: usize, occurring: bool) -> Self {
        let axis = |d: usize| problem.edges.iter().map(move |n| n.u[d]);
        let range = |d| [axis(d).fold(1.0, f32::min), axis(d).fold(0.0, f32::max)];
        let ranges: [_; 3] = std::array::from_fn(|d| if occurring { range(d) } else { [0.0, 1.0] });
        let most = (levels - 1) as f32;
        let level = |d: usize, u: f32| {
            let [low, high] = ranges[d];
            ((u - low) / (high - low) * most).round_ties_even() as usize
        };
        let at = |place: usize| -> [f32; 3] {
            std::array::from_fn(|d| {
                let ([low, high], level) = (ranges[d], place / levels.pow(d as u32) % levels);
                (low + (high - low) * (level as f32 / most)).clamp(0.0, 1.0)
            })
        };
        let place = |n: &Neighbour| (0..3).rev().fold(0, |at, d| at * levels + level(d, n.u[d]));
        Self {
            edges: problem.edges.iter().map(|n| Neighbour { u: at(place(n)), ..*n }).collect(),
            places: problem.edges.iter().map(|n| place(n) as u32).collect(),
            bases: (0..levels.pow(3)).map(|place| spline_basis(at(place))).collect(),
        }
    }

    /// The basis of every edge, copied from the table.
    pub(crate) fn look_up(&self, basis: &mut Vec<Lanes>) {
        basis.clear();
        basis.extend(self.places.iter().map(|&place| self.bases[place as usize]));
    }

    /// W(u)(c,o) = sum over s of B(u, s) W(s, c, o) at a place.
    pub(crate) fn weights(&self, problem: &Problem, place: usize) -> Vec<f32> {
        let mut out = vec![0.0; problem.inputs * problem.outputs];
        for (&basis, slot) in self.bases[place].0.iter().zip(problem.parts.weight.chunks_exact(out.len())) {
            out.iter_mut().zip(slot).for_each(|(to, w)| *to += basis * w);
        }
        out
    }
}
