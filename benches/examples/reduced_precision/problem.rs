//! Rows to compute: real activations and in-edges, weights from a seed, and the engine's own answer.

use meissner_engine::Trace;
use meissner_kernels::{Isa, LANES, Lanes, Matrix, Neighbour, SplineConv, SplineParts, SplineRow};
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

/// Where the basis of the engine's rows comes from.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Basis {
    AtHand,
    Computed,
}

/// Distance of values from those expected.
#[derive(Clone, Copy, Default)]
pub(crate) struct Error {
    /// Largest difference, relative to the largest magnitude.
    pub(crate) max: f64,
    /// Root of the mean squared difference, relative to that of the values.
    pub(crate) rms: f64,
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

    /// Room for [`Self::engine`].
    pub(crate) fn out(&self) -> Matrix {
        Matrix::zeros(ROWS, self.outputs)
    }

    /// Every row as the engine computes it, over `edges` and `basis` like the problem's own.
    pub(crate) fn engine_over(
        &self,
        (edges, basis): (&[Neighbour], &[Lanes]),
        from: Basis,
        scratch: &mut SplineScratch,
        out: &mut Matrix,
    ) {
        let isa = Isa::best();
        let mut group = [SplineRow::default(); GROUP];
        let lanes = GROUP * Lanes::count(self.outputs);
        let edges = edges.chunks(GROUP * self.degree).zip(basis.chunks(GROUP * self.degree));
        for ((edges, basis), out) in edges.zip(out.lanes_mut().chunks_mut(lanes)) {
            let rows = edges.chunks(self.degree).zip(basis.chunks(self.degree));
            for (to, (neighbours, basis)) in group.iter_mut().zip(rows) {
                let basis = if from == Basis::AtHand { basis } else { &[] };
                *to = SplineRow { neighbours, basis, own: &[], skip: None };
            }
            self.conv.rows(isa, &self.features, &group, scratch, out);
        }
    }

    /// Every row as the engine computes it.
    pub(crate) fn engine(&self, from: Basis, scratch: &mut SplineScratch, out: &mut Matrix) {
        self.engine_over((&self.edges, &self.basis), from, scratch, out);
    }

    /// What the engine computes.
    pub(crate) fn expected(&self) -> Matrix {
        let mut out = self.out();
        self.engine(Basis::AtHand, &mut SplineScratch::default(), &mut out);
        out
    }

    /// Multiply-adds of a row: sums per slot, and weights.
    pub(crate) fn multiply_adds(&self) -> [usize; 2] {
        [self.degree * 8 * self.inputs, 8 * self.inputs * self.outputs]
    }

    /// Largest magnitude of an activation.
    pub(crate) fn largest_input(&self) -> f32 {
        self.features.lanes().iter().flat_map(|l| l.0).fold(0.0, |m, x| m.max(x.abs()))
    }
}

/// The error of `got` against `expected`; rows are whole lanes here.
pub(crate) fn error(got: &Matrix, expected: &Matrix) -> Error {
    let (mut largest, mut magnitude, mut squares, mut energy) = (0f64, 0f64, 0f64, 0f64);
    assert!(expected.columns().is_multiple_of(LANES));
    let values = |m: &Matrix| m.lanes().iter().flat_map(|l| l.0).map(f64::from).collect::<Vec<_>>();
    for (got, expected) in values(got).into_iter().zip(values(expected)) {
        let difference = got - expected;
        largest = largest.max(difference.abs());
        magnitude = magnitude.max(expected.abs());
        squares += difference * difference;
        energy += expected * expected;
    }
    Error { max: largest / magnitude, rms: (squares / energy).sqrt() }
}
