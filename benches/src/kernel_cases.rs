//! Spline blocks and dense layers of the shipped networks as single kernels, with in-edges of a
//! real graph and numbers from a seed, which the scalar twin shares.

use meissner_engine::Stream;
use meissner_kernels::{
    Activation, Dense, GraphRow, Isa, Lanes, Matrix, Neighbour, SplineConv, SplineParts, SplineScratch, naive,
};

use crate::cost::{self, Cost};
use crate::networks;
use crate::streams::Recording;
use meissner_kernels::random::Random;
use meissner_verify::bits;

/// Maximum number of rows of a case: enough for many neighbourhoods, few enough to repeat often.
const MAX_ROWS: usize = 1_024;

/// One spline block over rows of a real graph, or one dense layer.
#[derive(Clone, Debug)]
pub struct KernelCase {
    /// Network.
    pub network: String,
    /// Layer.
    pub layer: String,
    /// The shape in a few characters.
    pub shape: String,
    /// Mean number of in-edges; 0 for a dense layer.
    pub degree: f64,
    /// Number of rows that [`Self::run`] computes.
    pub rows: usize,
    /// Cost of all rows.
    pub cost: Cost,
    outputs: usize,
    kernel: Kernel,
}

#[derive(Clone, Debug)]
enum Kernel {
    Spline {
        parts: SplineParts,
        conv: Box<SplineConv>,
        features: Matrix,
        skip: Option<Matrix>,
        /// Consecutive rows: index and in-edges.
        rows: Vec<(usize, Vec<Neighbour>)>,
    },
    Dense {
        dense: Dense,
        /// One row of padded weights an output.
        weight: Vec<Vec<f32>>,
        bias: Vec<f32>,
        activation: Activation,
        input: Matrix,
    },
}

/// Each spline block of a shipped network, over the graphs of `window`.
///
/// # Panics
/// If a layer computes NaN.
pub fn splines(name: &str, window: &Recording) -> Vec<KernelCase> {
    let network = networks::shipped(name);
    let batch = networks::grid_batch(&network, window.sensor);
    let trace = batch.forward(Stream::new(&window.events)).expect("finite");
    let mut random = Random::new(3);
    let mut cases = Vec::new();
    for (l, level) in trace.levels.iter().enumerate() {
        let count = level.edges.rows();
        // From the middle of a window: its first rows have few neighbours under `past`.
        let taken = count.min(MAX_ROWS);
        let rows: Vec<(usize, Vec<Neighbour>)> = (0..taken)
            .map(|i| (count - taken) / 2 + i)
            .map(|row| (row, level.edges.row(row).to_vec()))
            .collect();
        let degree = rows.iter().map(|(_, edges)| edges.len()).sum::<usize>() as f64 / taken as f64;
        for block in &network.level(l).blocks {
            let Some(conv) = block.conv.spline() else { continue };
            let (inputs, outputs, kernel) = (conv.inputs(), conv.outputs(), conv.kernel());
            let parts = SplineParts {
                inputs,
                outputs,
                kernel,
                weight: random.values(conv.slots() * inputs * outputs, 0.3),
                root: conv.has_root().then(|| random.values(inputs * outputs, 0.3)),
                bias: None,
                norm: Some((random.values(outputs, 1.0), random.values(outputs, 1.0))),
                elu: true,
            };
            let mut matrix = |columns| Matrix::from_rows(columns, &random.values(count * columns, 1.0));
            let (features, skip) = (matrix(inputs), block.skip.is_some().then(|| matrix(outputs)));
            let conv = Box::new(SplineConv::new(&parts).expect("sizes fit"));
            let cost = |(_, edges): &(_, Vec<_>)| cost::spline_row(&conv, edges.len(), skip.is_some());
            cases.push(KernelCase {
                network: name.to_owned(),
                layer: block.name.clone(),
                shape: format!("{inputs} -> {outputs}{}", if skip.is_some() { " + skip" } else { "" }),
                degree,
                rows: taken,
                cost: rows.iter().map(cost).sum(),
                outputs,
                kernel: Kernel::Spline { parts, conv, features, skip, rows: rows.clone() },
            });
        }
    }
    cases
}

/// The dense layers of shipped networks: after two readouts, and after a hidden layer.
pub fn denses() -> Vec<KernelCase> {
    vec![
        dense("graphres", "fc", [16, 32, 2], Activation::Identity),
        dense("tactigraph-past", "hidden", [432, 16, 32], Activation::Elu),
        dense("tactigraph-past", "fc", [1, 32, 2], Activation::Identity),
    ]
}

fn dense(
    network: &str,
    layer: &str,
    [segments, channels, outputs]: [usize; 3],
    activation: Activation,
) -> KernelCase {
    let mut random = Random::new(4);
    let inputs = segments * channels;
    let weight = random.values(inputs * outputs, 0.3);
    let bias = random.values(outputs, 0.3);
    KernelCase {
        network: network.to_owned(),
        layer: layer.to_owned(),
        shape: format!("{inputs} -> {outputs}"),
        degree: 0.0,
        rows: 1,
        cost: cost::dense(segments, channels, outputs),
        outputs,
        kernel: Kernel::Dense {
            dense: Dense::new(segments, channels, outputs, &weight, Some(&bias), activation)
                .expect("sizes fit"),
            weight: weight.chunks(inputs).map(<[f32]>::to_vec).collect(),
            input: Matrix::from_rows(channels, &random.values(inputs, 1.0)),
            bias,
            activation,
        },
    }
}

impl KernelCase {
    /// Room for [`Self::run`].
    pub fn out(&self) -> Matrix {
        Matrix::zeros(self.rows, self.outputs)
    }

    /// Computes every row.
    pub fn run(&self, isa: Isa, scratch: &mut SplineScratch, out: &mut Matrix) {
        let (conv, features, skip, rows) = match &self.kernel {
            Kernel::Dense { dense, input, .. } => return dense.run(isa, input.lanes(), out.row_mut(0)),
            Kernel::Spline { conv, features, skip, rows, .. } => (conv, features, skip, rows),
        };
        let mut group = [GraphRow::default(); SplineConv::GROUP];
        let lanes = out.lanes_mut().chunks_mut(SplineConv::GROUP * Lanes::count(self.outputs));
        for (rows, out) in rows.chunks(SplineConv::GROUP).zip(lanes) {
            for (to, (row, neighbours)) in group.iter_mut().zip(rows) {
                let skip = skip.as_ref().map(|skip| skip.row(*row));
                *to = GraphRow { neighbours, own: features.row(*row), skip, ..GraphRow::default() };
            }
            conv.rows(isa, features, &group[..rows.len()], scratch, out);
        }
    }

    /// Asserts that the layer, or every 31st row, equals the scalar twin's, bit for bit.
    ///
    /// # Panics
    /// If one does not.
    pub fn check(&self, isa: Isa) {
        let mut out = self.out();
        self.run(isa, &mut SplineScratch::default(), &mut out);
        let values = |matrix: &Matrix, row| matrix.values(row).collect::<Vec<f32>>();
        let check = |row, expected: &[f32]| {
            let case = format!("{} {}, {}", self.network, self.layer, isa.name());
            assert_eq!(bits(&values(&out, row)), bits(expected), "{case}");
        };
        match &self.kernel {
            Kernel::Dense { weight, bias, activation, input, .. } => {
                let input: Vec<_> = (0..input.rows()).map(|row| values(input, row)).collect();
                check(0, &naive::dense(&input, weight, bias, *activation));
            }
            Kernel::Spline { parts, features, skip, rows, .. } => {
                let features: Vec<Vec<f32>> = (0..features.rows()).map(|row| values(features, row)).collect();
                for (place, (row, neighbours)) in rows.iter().enumerate().step_by(31) {
                    let skip = skip.as_ref().map(|skip| values(skip, *row));
                    let read = |j: usize, c: usize| features[j][c];
                    check(place, &naive::spline_row(parts, neighbours, read, *row, skip.as_deref()));
                }
            }
        }
    }
}
