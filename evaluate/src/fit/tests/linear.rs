//! Linear systems and heads against slow ways.

use ndarray::{Array2, Axis, array, concatenate};
use proptest::prelude::*;

use meissner_kernels::Activation;
use meissner_kernels::random::Random;

use crate::fit::basis::{Basis, Design, Linear};
use crate::fit::cholesky::{Factor, add_products};
use crate::fit::dense::Dense;
use crate::fit::heads::{Choice, Sums};
use crate::fit::kernel::Kernel;
use crate::fit::modes::Features;
use crate::fit::samples::{Instant, Quantity, Target};
use crate::fit::validation::sureness;

pub(super) fn matrix(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
    let mut random = Random::new(seed);
    Array2::from_shape_fn((rows, columns), |_| f64::from(random.symmetric()))
}

fn largest(of: &Array2<f64>) -> f64 {
    of.iter().fold(0.0, |most, value| value.abs().max(most))
}

/// Instants with these truths, a row each.
fn instants(truth: &Array2<f64>) -> Vec<Instant> {
    let of = |(press, truth): (usize, ndarray::ArrayView1<'_, f64>)| Instant {
        press,
        t_us: 0,
        age_us: 0,
        is_end: true,
        moved: [0, 0],
        weight: 1.0,
        truth: truth.to_vec(),
    };
    truth.rows().into_iter().enumerate().map(of).collect()
}

fn quantities(count: usize) -> Target {
    let one = |label: usize| Quantity {
        label,
        name: format!("q{label}"),
        unit: "mm".to_owned(),
        factor: 1.0,
        shown: ("mm".to_owned(), 1.0),
    };
    Target::Quantities((0..count).map(one).collect())
}

/// The outputs of dense layers for the rows of a readout.
pub(super) fn run(dense: &Dense, readout: &Array2<f64>) -> Array2<f64> {
    dense.0.iter().fold(readout.clone(), |inputs, (layer, activation)| {
        let sums: Array2<f64> = layer.of(inputs.view());
        let is_elu = *activation == Activation::Elu;
        sums.mapv(|sum| if is_elu && sum < 0.0 { sum.exp_m1() } else { sum })
    })
}

/// A readout of so many rows, 12 cells of 2 channels each, and its features.
fn drawn(rows: usize, seed: u64) -> (Array2<f64>, Basis, Features) {
    let (channels, columns) = (2, 24);
    let readout = matrix(rows, columns, seed).mapv(|value| value as f32);
    let values = readout.as_slice().expect("rows follow each other");
    let weights = vec![1.0; rows];
    let design = Design { values, columns, channels, weights: &weights, counts: 0 };
    let (basis, coordinates) = Basis::new(design, seed).expect("it has a basis");
    let features = Features::new(coordinates, &weights, seed);
    (readout.mapv(f64::from), basis, features)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_factor_in_blocks_solves_what_it_was_made_of(size in 1_usize..220, seed in any::<u64>()) {
        let part = matrix(size + 3, size, seed);
        let mut products = Array2::zeros((size, size));
        add_products(&mut products, part.view());
        let whole = part.t().dot(&part) + Array2::<f64>::eye(size) * 0.5;
        let right = matrix(3, size, seed ^ 1);
        let mut found = right.clone();
        Factor::new(products, 0.5).expect("it is positive definite").solve(&mut found);
        prop_assert!(largest(&(found.dot(&whole) - &right)) < 1e-9);
    }

    #[test]
    fn products_of_coordinates_are_those_of_readouts(rows in 4_usize..40, cells in 1_usize..20, seed in any::<u64>()) {
        let (channels, columns) = (2, 2 * cells);
        let values: Vec<f32> = matrix(rows, columns, seed).iter().map(|&value| value as f32).collect();
        let weights = vec![1.0; rows];
        let design = Design { values: &values, columns, channels, weights: &weights, counts: 0 };
        let (basis, found) = Basis::new(design, seed).expect("it has a basis");
        // The same by hand: centred, and scaled by channel.
        let mut x = Array2::from_shape_fn((rows, columns), |(i, j)| f64::from(values[i * columns + j]));
        let readout = x.clone();
        x -= &x.mean_axis(Axis(0)).expect("there are rows");
        for channel in 0..channels {
            let of_channel = || (0..columns).filter(move |column| column % channels == channel);
            let square: f64 = of_channel().map(|column| x.column(column).dot(&x.column(column))).sum();
            let deviation = (square / (rows * cells) as f64).sqrt();
            of_channel().for_each(|column| x.column_mut(column).mapv_inplace(|value| value / deviation));
        }
        prop_assert!(largest(&(found.dot(&found.t()) - x.dot(&x.t()))) < 1e-5);
        // A linear function of the coordinates is linear in the readout.
        let of = matrix(3, found.ncols(), seed ^ 1);
        let linear = basis.of_readout(of.view());
        prop_assert!(largest(&(linear.of(readout.view()) - found.dot(&of.t()))) < 1e-5);
    }

    #[test]
    fn sums_give_the_ridge_of_their_rows(rows in 6_usize..40, size in 1_usize..9, seed in any::<u64>()) {
        let features = Features::new(matrix(rows, size, seed), &vec![1.0; rows], seed);
        let truth = matrix(rows, 2, seed ^ 1);
        let target = quantities(2);
        let instants = instants(&truth);
        let all: Vec<usize> = (0..rows).collect();
        let part = Sums::of(&features, &target, &instants, &all[..2]);
        let sums = Sums::of(&features, &target, &instants, &all).without(&part);
        let choice = Choice { products: 0.7, width: 0.0, strength: 0.1 };
        let head = sums.heads(size, &[choice]).remove(0).expect("it is positive definite");
        // By hand: products times 0.7, all centred, and the normal equations.
        let kept = features.values.select(Axis(0), &all[2..]);
        let mut x = kept.clone();
        x.indexed_iter_mut().for_each(|((_, column), value)| *value *= if column < size { 1.0 } else { 0.7 });
        let mean = x.mean_axis(Axis(0)).expect("there are rows");
        let y = truth.select(Axis(0), &all[2..]);
        let y_mean = y.mean_axis(Axis(0)).expect("there are rows");
        let (x, y) = (x - &mean, y - &y_mean);
        let whole = x.t().dot(&x);
        let strength = 0.1 * whole.diag().sum() / (rows - 2) as f64;
        let whole = whole + Array2::<f64>::eye(x.ncols()) * strength;
        let mut weight = y.t().dot(&x);
        Factor::new(whole, 0.0).expect("it is positive definite").solve(&mut weight);
        let by_hand = x.dot(&weight.t()) + &y_mean;
        prop_assert!(largest(&(head.of(kept.view()) - by_hand)) < 1e-8);
    }

    #[test]
    fn dense_layers_give_what_is_linear_in_a_kernel(rows in 20_usize..60, width in 0.3_f64..3.0, seed in any::<u64>()) {
        let (readout, basis, features) = drawn(rows, seed);
        let (kernel, found) = Kernel::new((&features.of_modes(), &vec![1.0; rows]), width, seed).expect("rows differ");
        // Products of coordinates are values of the kernel.
        let modes = features.of_modes();
        let value = |i: usize, j: usize| {
            let difference = &modes.row(i) - &modes.row(j);
            (-kernel.narrowness * difference.dot(&difference)).exp()
        };
        let expected = Array2::from_shape_fn((rows, rows), |(i, j)| value(i, j));
        prop_assert!(largest(&(found.dot(&found.t()) - &expected)) < 1e-3);
        let head = Linear { weight: matrix(2, found.ncols(), seed ^ 1), bias: vec![0.5, -0.25] };
        let dense = Dense::of_kernel(&head, &kernel, &features, &basis);
        let (found, expected) = (run(&dense, &readout), head.of(found.view()));
        prop_assert!(largest(&(&found - &expected)) < 0.02 * largest(&expected), "{found} {expected}");
    }

    #[test]
    fn dense_layers_give_what_is_quadratic(rows in 40_usize..60, seed in any::<u64>()) {
        let (readout, basis, features) = drawn(rows, seed);
        let head = Linear { weight: matrix(2, features.values.ncols(), seed ^ 1), bias: vec![0.5, -0.25] };
        let choices = [Choice { products: 0.7, width: 0.0, strength: 0.1 }; 2];
        let dense = Dense::new((&head, &choices), &[], &features, &basis);
        let (found, expected) = (run(&dense, &readout), head.of(features.values.view()));
        prop_assert!(largest(&(&found - &expected)) < 0.02 * largest(&expected), "{found} {expected}");
        // Without products, one layer is the same exactly.
        let linear = concatenate(Axis(1), &[head.weight.view().split_at(Axis(1), features.linear).0]).expect("columns");
        let head = Linear { weight: linear, bias: head.bias };
        let dense = Dense::new((&head, &[Choice { products: 0.0, width: 0.0, strength: 0.1 }; 2]), &[], &features, &basis);
        prop_assert_eq!(dense.0.len(), 1);
        prop_assert!(largest(&(run(&dense, &readout) - head.of(features.values.view()))) < 1e-6);
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_has_no_factor() {
    assert!(Factor::new(array![[1.0, 0.0], [2.0, 1.0]], 0.0).is_none());
    assert!(Factor::new(array![[f64::NAN]], 1.0).is_none());
}

#[test]
fn logits_become_as_sure_as_they_are_right() {
    // Three of four are right, whatever the logits say.
    let logits = Array2::from_shape_fn((400, 2), |(row, class)| if row % 2 == class { 50.0 } else { 0.0 });
    let truth: Vec<usize> = (0..400).map(|row| if row % 8 < 2 { 1 - row % 2 } else { row % 2 }).collect();
    let sure = 1.0 / (1.0 + (-50.0 * sureness(&logits, &truth)).exp());
    assert!((sure - 0.75).abs() < 0.03, "{sure}");
}
