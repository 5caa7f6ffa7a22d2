//! What a perceptron learns, and that dense layers compute the same.

use ndarray::{Array2, Axis};

use meissner_kernels::random::Random;

use super::linear::{matrix, run};
use crate::fit::basis::{Basis, Design, Linear};
use crate::fit::dense::Dense;
use crate::fit::heads::Choice;
use crate::fit::modes::Features;
use crate::fit::perceptron::{Part, Perceptron, Truth};
use crate::workers::ProgressHandle;

fn learn(inputs: &Array2<f64>, truth: &Truth, seed: u64) -> Perceptron {
    let all: Vec<usize> = (0..inputs.nrows()).collect();
    let (choose, train) = all.split_at(inputs.nrows() / 4);
    let part = Part { train, choose, seed };
    Perceptron::train(inputs, truth, &part, 16, &ProgressHandle::default()).expect("nobody cancels it")
}

/// Places in a square, of unit size.
fn places(count: usize) -> Array2<f64> {
    matrix(count, 2, 5) * 3.0_f64.sqrt()
}

#[test]
fn quantities_that_are_not_linear_are_learnt() {
    let inputs = places(400);
    let of = |row: ndarray::ArrayView1<'_, f64>| row[0] * row[1];
    let truth =
        Array2::from_shape_vec((400, 1), inputs.rows().into_iter().map(of).collect()).expect("a column");
    let found = learn(&inputs, &Truth::Quantities(truth.clone()), 1).of(&inputs);
    let square = |of: &Array2<f64>| of.iter().map(|value| value * value).sum::<f64>();
    assert!(
        square(&(&found - &truth)) < 0.4 * square(&truth),
        "{} of {}",
        square(&(found - &truth)),
        square(&truth)
    );
}

#[test]
fn classes_that_no_line_separates_are_learnt_and_the_seed_decides() {
    let inputs = places(400);
    let class = |row: ndarray::ArrayView1<'_, f64>| usize::from(row[0] * row[1] > 0.0);
    let classes: Vec<usize> = inputs.rows().into_iter().map(class).collect();
    let truth = Truth::Classes(classes.clone(), 2);
    let perceptron = learn(&inputs, &truth, 1);
    let found = perceptron.of(&inputs);
    let is_right =
        |(row, class): (ndarray::ArrayView1<'_, f64>, &usize)| usize::from(row[1] > row[0]) == *class;
    let right = found.rows().into_iter().zip(&classes).filter(|(row, class)| is_right((*row, class))).count();
    assert!(right > 320, "{right} of 400");
    assert_eq!(learn(&inputs, &truth, 1).first.weight, perceptron.first.weight);
    assert_ne!(learn(&inputs, &truth, 2).first.weight, perceptron.first.weight);
}

#[test]
fn dense_layers_add_perceptrons() {
    let (rows, columns) = (50, 24);
    let values: Vec<f32> = matrix(rows, columns, 3).iter().map(|&value| value as f32).collect();
    let weights = vec![1.0; rows];
    let design = Design { values: &values, columns, channels: 2, weights: &weights, counts: 0 };
    let (basis, coordinates) = Basis::new(design, 3).expect("it has a basis");
    let features = Features::new(coordinates, &weights, 3);
    let head = Linear { weight: matrix(2, features.values.ncols(), 4), bias: vec![0.5, -0.25] };
    let mut random = Random::new(6);
    let perceptrons = [7, 8].map(|seed| Perceptron {
        first: Linear { weight: matrix(5, features.modes.ncols(), seed), bias: vec![0.1; 5] },
        second: Linear { weight: matrix(2, 5, seed + 10), bias: vec![random.uniform(), 0.0] },
    });
    let readout = Array2::from_shape_fn((rows, columns), |(i, j)| f64::from(values[i * columns + j]));
    for products in [0.0, 0.7] {
        let choices = [Choice { products, width: 0.0, strength: 0.1 }; 2];
        let mut head = head.clone();
        if products == 0.0 {
            head.weight.slice_axis_inplace(Axis(1), (0..features.linear).into());
        }
        let mut expected = head.of(features.values.view());
        perceptrons.iter().for_each(|of| expected += &of.of(&features.of_modes()));
        let dense = Dense::new((&head, &choices), &perceptrons, &features, &basis);
        let largest = |of: &Array2<f64>| of.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let apart = largest(&(run(&dense, &readout) - &expected));
        assert!(apart < 0.02 * largest(&expected), "{apart} {products}");
    }
}
