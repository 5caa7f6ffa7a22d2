//! The spline blocks and dense layers of the shipped networks as single kernels: their shapes, and in-edges of a real
//! graph. Numbers are drawn from a seed, so that the scalar twin can compute with the same ones.

use meissner_engine::Stream;
use meissner_kernels::{
    Activation, Dense, GraphRow, Isa, Lanes, Matrix, Neighbour, SplineConv, SplineParts, SplineScratch, naive,
};

use crate::answers::bits;
use crate::cost::{self, Cost};
use crate::networks;
use crate::streams::Recording;
use meissner_models::random::Random;

/// Most rows of a case: enough for many neighbourhoods, few enough to repeat often.
const MOST_ROWS: usize = 1_024;

/// One spline block over rows of a real graph.
#[derive(Clone, Debug)]
pub struct SplineCase {
    /// Network.
    pub network: String,
    /// Layer.
    pub layer: String,
    /// The parameters.
    pub parts: SplineParts,
    /// Mean number of in-edges.
    pub degree: f64,
    conv: SplineConv,
    features: Matrix,
    skip: Option<Matrix>,
    /// Consecutive rows: index and in-edges.
    rows: Vec<(usize, Vec<Neighbour>)>,
}

/// Each spline block of a shipped network, over the graphs of `window`.
///
/// # Panics
/// If a layer computes NaN.
pub fn splines(name: &str, window: &Recording) -> Vec<SplineCase> {
    let network = networks::shipped(name);
    let batch = networks::grid_batch(&network, window.sensor);
    let trace = batch.forward(Stream::new(&window.events)).expect("finite");
    let mut random = Random::new(3);
    let mut cases = Vec::new();
    for (l, level) in trace.levels.iter().enumerate() {
        let count = level.edges.rows();
        // From the middle of a window: its first rows have few neighbours under `past`.
        let taken = count.min(MOST_ROWS);
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
            cases.push(SplineCase {
                network: name.to_owned(),
                layer: block.name.clone(),
                conv: SplineConv::new(&parts).expect("sizes fit"),
                features: matrix(inputs),
                skip: block.skip.is_some().then(|| matrix(outputs)),
                rows: rows.clone(),
                parts,
                degree,
            });
        }
    }
    cases
}

impl SplineCase {
    /// Number of rows that [`Self::run`] computes.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The shape in a few characters.
    pub fn shape(&self) -> String {
        let skip = if self.skip.is_some() { " + skip" } else { "" };
        format!("{} -> {}{skip}", self.parts.inputs, self.parts.outputs)
    }

    /// Cost of all rows.
    pub fn cost(&self) -> Cost {
        let skip = self.skip.is_some();
        self.rows.iter().map(|(_, edges)| cost::spline_row(&self.conv, edges.len(), skip)).sum()
    }

    /// Room for [`Self::run`].
    pub fn out(&self) -> Matrix {
        Matrix::zeros(self.rows.len(), self.parts.outputs)
    }

    /// Computes every row.
    pub fn run(&self, isa: Isa, scratch: &mut SplineScratch, out: &mut Matrix) {
        let mut group = [GraphRow::default(); SplineConv::GROUP];
        let lanes = out.lanes_mut().chunks_mut(SplineConv::GROUP * Lanes::count(self.parts.outputs));
        for (rows, out) in self.rows.chunks(SplineConv::GROUP).zip(lanes) {
            for (to, (row, neighbours)) in group.iter_mut().zip(rows) {
                let skip = self.skip.as_ref().map(|skip| skip.row(*row));
                *to = GraphRow { neighbours, own: self.features.row(*row), skip, ..GraphRow::default() };
            }
            self.conv.rows(isa, &self.features, &group[..rows.len()], scratch, out);
        }
    }

    /// Asserts that some rows equal the scalar twin's, bit for bit.
    ///
    /// # Panics
    /// If one does not.
    pub fn check(&self, isa: Isa) {
        let mut out = self.out();
        self.run(isa, &mut SplineScratch::default(), &mut out);
        let values = |matrix: &Matrix, row| matrix.values(row).collect::<Vec<f32>>();
        let features: Vec<Vec<f32>> =
            (0..self.features.rows()).map(|row| values(&self.features, row)).collect();
        for (place, (row, neighbours)) in self.rows.iter().enumerate().step_by(31) {
            let skip = self.skip.as_ref().map(|skip| values(skip, *row));
            let read = |j: usize, c: usize| features[j][c];
            let expected = naive::spline_row(&self.parts, neighbours, read, *row, skip.as_deref());
            let case = format!("{} {}, {}", self.network, self.layer, isa.name());
            assert_eq!(bits(&values(&out, place)), bits(&expected), "{case}");
        }
    }
}

/// One dense layer.
#[derive(Clone, Debug)]
pub struct DenseCase {
    /// Network.
    pub network: String,
    /// Layer.
    pub layer: String,
    /// The layer's cost.
    pub cost: Cost,
    dense: Dense,
    /// One row of padded weights an output.
    weight: Vec<Vec<f32>>,
    bias: Vec<f32>,
    activation: Activation,
    input: Matrix,
}

/// The dense layers of the shipped networks: after a readout of 4 x 4 cells of 32 channels, and after a hidden layer.
pub fn denses() -> Vec<DenseCase> {
    vec![
        DenseCase::new("graphres", "fc", [16, 32, 2], Activation::Identity),
        DenseCase::new("tactigraph-past", "hidden", [16, 32, 38], Activation::Elu),
        DenseCase::new("tactigraph-past", "fc", [1, 38, 2], Activation::Identity),
    ]
}

impl DenseCase {
    fn new(
        network: &str,
        layer: &str,
        [segments, channels, outputs]: [usize; 3],
        activation: Activation,
    ) -> Self {
        let mut random = Random::new(4);
        let weight = random.values(segments * channels * outputs, 0.3);
        let bias = random.values(outputs, 0.3);
        let padded = |row: &[f32]| row.chunks(channels).flat_map(Lanes::pack).flat_map(|l| l.0).collect();
        Self {
            network: network.to_owned(),
            layer: layer.to_owned(),
            cost: cost::dense(segments, channels, outputs),
            dense: Dense::new(segments, channels, outputs, &weight, Some(&bias), activation)
                .expect("sizes fit"),
            weight: weight.chunks(segments * channels).map(padded).collect(),
            input: Matrix::from_rows(channels, &random.values(segments * channels, 1.0)),
            bias,
            activation,
        }
    }

    /// Room for [`Self::run`].
    pub fn out(&self) -> Matrix {
        Matrix::zeros(1, self.dense.outputs())
    }

    /// The shape in a few characters.
    pub fn shape(&self) -> String {
        format!("{} -> {}", self.dense.inputs(), self.dense.outputs())
    }

    /// Computes the layer.
    pub fn run(&self, isa: Isa, out: &mut Matrix) {
        self.dense.run(isa, self.input.lanes(), out.row_mut(0));
    }

    /// Asserts that the layer equals its scalar twin, bit for bit.
    ///
    /// # Panics
    /// If it does not.
    pub fn check(&self, isa: Isa) {
        let mut out = self.out();
        self.run(isa, &mut out);
        let input: Vec<f32> = self.input.lanes().iter().flat_map(|l| l.0).collect();
        let expected = naive::dense(&input, &self.weight, &self.bias, self.activation);
        let case = format!("{} {}, {}", self.network, self.layer, isa.name());
        assert_eq!(bits(&out.values(0).collect::<Vec<_>>()), bits(&expected), "{case}");
    }
}
