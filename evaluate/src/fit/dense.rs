//! A head as dense layers behind a readout.
//!
//! A linear head is one layer. A quadratic one is three: modes P and the linear part y; ELUs, two
//! for each square; and sums of these. Perceptrons have their units beside the squares. Kernels are
//! four: modes, their squares, a unit for each centre, and sums. ELU bends at 0: it is the identity
//! above 0 and an exponential below:
//!
//! ```text
//! a^2 = 2 (elu(e a) + elu(-e a)) / e^2 + O(e a^3),      y = elu(y + b) - b
//! P_i P_j = ((P_i + P_j)^2 - P_i^2 - P_j^2) / 2
//! exp(-g |P - c|^2) = 1 + elu(-g sum P_i^2 + 2 g c P - g |c|^2)
//! ```

use ndarray::{Array2, Axis, concatenate};

use meissner_kernels::Activation;

use super::basis::{Basis, Linear};
use super::heads::Choice;
use super::kernel::Kernel;
use super::modes::{Features, factor, pairs};
use super::perceptron::Perceptron;

/// The largest input of an ELU that makes a square: the error is a third of it at most, and f32
/// keeps four digits.
const BEND: f64 = 1.0 / 96.0;
/// How far a linear part may exceed its values at the presses, as a multiple of its largest value.
const BEYOND: f64 = 4.0;

/// Dense layers, the first of which reads a readout.
#[derive(Clone, Debug)]
pub(super) struct Dense(pub(super) Vec<(Linear, Activation)>);

impl Dense {
    /// The layers of `head`, which is linear in `features`, and of `perceptrons` that read the
    /// modes and whose sum is added; `choices` are those of the outputs of `head`.
    pub(super) fn new(
        (head, choices): (&Linear, &[Choice]),
        perceptrons: &[Perceptron],
        features: &Features,
        basis: &Basis,
    ) -> Self {
        let linear = head.weight.view().split_at(Axis(1), features.linear).0;
        let has_squares = choices.iter().any(|choice| choice.products > 0.0);
        if !has_squares && perceptrons.is_empty() {
            let mut only = basis.of_readout(linear);
            only.bias.iter_mut().zip(&head.bias).for_each(|(bias, own)| *bias += own);
            return Self(vec![(only, Activation::Identity)]);
        }
        let (outputs, modes) = (head.bias.len(), features.modes.ncols());
        let both = concatenate(Axis(0), &[features.modes.t(), linear]).expect("both read coordinates");
        let mut first = basis.of_readout(both.view());
        first.bias.iter_mut().skip(modes).zip(&head.bias).for_each(|(bias, own)| *bias += own);

        let coordinates = features.values.view().split_at(Axis(1), features.linear).0;
        let (of_modes, of_linear) = (features.of_modes(), coordinates.dot(&linear.t()));
        let pairs = pairs(if has_squares { features.squared } else { 0 });
        let of_perceptrons: usize = perceptrons.iter().map(|of| of.first.bias.len()).sum();
        let units = 2 * pairs.len() + outputs + of_perceptrons;
        let mut second = Linear { weight: Array2::zeros((units, modes + outputs)), bias: vec![0.0; units] };
        let mut third = Linear { weight: Array2::zeros((outputs, units)), bias: vec![0.0; outputs] };
        for (place, &[i, j]) in pairs.iter().enumerate() {
            let is_square = i == j;
            let sum = |row: ndarray::ArrayView1<'_, f64>| if is_square { row[i] } else { row[i] + row[j] };
            let most = largest(of_modes.rows().into_iter().map(sum));
            let bend = if most > 0.0 { BEND / most } else { 1.0 };
            for (unit, sign) in [(2 * place, bend), (2 * place + 1, -bend)] {
                second.weight[[unit, i]] = sign;
                second.weight[[unit, j]] = sign;
            }
            for output in 0..outputs {
                let of_pair = |pair: usize, [i, j]: [usize; 2]| {
                    head.weight[[output, features.linear + pair]] * factor(i, j) / features.size
                };
                let own = of_pair(place, [i, j]);
                let square = if is_square {
                    let others =
                        pairs.iter().enumerate().filter(|(_, pair)| pair[0] != pair[1] && pair.contains(&i));
                    own - others.map(|(pair, &of)| of_pair(pair, of)).sum::<f64>() / 2.0
                } else {
                    own / 2.0
                };
                for unit in [2 * place, 2 * place + 1] {
                    third.weight[[output, unit]] = 2.0 * square / (bend * bend);
                }
            }
        }
        for output in 0..outputs {
            let unit = 2 * pairs.len() + output;
            let bound = head.bias[output].abs() + BEYOND * largest(of_linear.column(output).iter().copied());
            second.weight[[unit, modes + output]] = 1.0;
            second.bias[unit] = bound;
            third.weight[[output, unit]] = 1.0;
            third.bias[output] = -bound;
        }
        let mut unit = 2 * pairs.len() + outputs;
        for of in perceptrons {
            for (i, &bias) in of.first.bias.iter().enumerate() {
                let mut row = second.weight.row_mut(unit);
                row.iter_mut().zip(of.first.weight.row(i)).for_each(|(to, &weight)| *to = weight);
                second.bias[unit] = bias;
                third.weight.column_mut(unit).assign(&of.second.weight.column(i));
                unit += 1;
            }
            third.bias.iter_mut().zip(&of.second.bias).for_each(|(to, bias)| *to += bias);
        }
        Self(vec![(first, Activation::Identity), (second, Activation::Elu), (third, Activation::Identity)])
    }

    /// The layers of `head`, which is linear in the coordinates of `kernel`.
    pub(super) fn of_kernel(head: &Linear, kernel: &Kernel, features: &Features, basis: &Basis) -> Self {
        let first = basis.of_readout(features.modes.t());
        let (modes, of_modes) = (features.modes.ncols(), features.of_modes());
        let sizes: Vec<f64> = of_modes.columns().into_iter().map(|of| largest(of.iter().copied())).collect();
        let (narrowness, centres) = (kernel.narrowness, &kernel.centres);
        let mut second = Linear { weight: Array2::zeros((3 * modes, modes)), bias: vec![0.0; 3 * modes] };
        let square = |centre: ndarray::ArrayView1<'_, f64>| -narrowness * centre.dot(&centre);
        let bias = centres.rows().into_iter().map(square).collect();
        let mut third = Linear { weight: Array2::zeros((centres.nrows(), 3 * modes)), bias };
        for (mode, &most) in sizes.iter().enumerate() {
            let bend = if most > 0.0 { BEND / most } else { 1.0 };
            for (unit, sign) in [(3 * mode, bend), (3 * mode + 1, -bend)] {
                second.weight[[unit, mode]] = sign;
                third.weight.column_mut(unit).fill(-2.0 * narrowness / (bend * bend));
            }
            let (unit, bound) = (3 * mode + 2, BEYOND * most);
            second.weight[[unit, mode]] = 1.0;
            second.bias[unit] = bound;
            for (centre, mut to) in third.weight.rows_mut().into_iter().enumerate() {
                to[unit] = 2.0 * narrowness * centres[[centre, mode]];
                third.bias[centre] -= to[unit] * bound;
            }
        }
        let mut last = Linear { weight: kernel.of_kernels(head.weight.view()), bias: head.bias.clone() };
        let sums = last.weight.sum_axis(Axis(1));
        last.bias.iter_mut().zip(sums).for_each(|(bias, sum)| *bias += sum);
        let layers = [(first, Activation::Identity), (second, Activation::Elu), (third, Activation::Elu)];
        Self(layers.into_iter().chain([(last, Activation::Identity)]).collect())
    }

    /// Multiplies the outputs.
    pub(super) fn scale(&mut self, factor: f64) {
        if let Some((last, _)) = self.0.last_mut() {
            last.weight *= factor;
            last.bias.iter_mut().for_each(|bias| *bias *= factor);
        }
    }

    /// Values and activations of the layers before the last one.
    pub(super) fn hidden(&self) -> Vec<(usize, Activation)> {
        let before = self.0.iter().take(self.0.len() - 1);
        before.map(|(layer, activation)| (layer.bias.len(), *activation)).collect()
    }

    /// Factors and biases of each layer.
    pub(super) fn values(&self) -> Vec<(Vec<f32>, Vec<f32>)> {
        let rounded = |values: &mut dyn Iterator<Item = &f64>| values.map(|&value| value as f32).collect();
        let of = |(layer, _): &(Linear, Activation)| {
            (rounded(&mut layer.weight.iter()), rounded(&mut layer.bias.iter()))
        };
        self.0.iter().map(of).collect()
    }
}

/// The largest absolute value of `values`; 0 without values.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, x| most.max(x.abs()))
}
