//! Linear systems against slow ways.

use ndarray::{Array2, array};
use proptest::prelude::*;

use meissner_kernels::random::Random;

use crate::fit::cholesky::{Factor, add_products};
use crate::fit::design::Design;

fn matrix(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
    let mut random = Random::new(seed);
    Array2::from_shape_fn((rows, columns), |_| f64::from(random.symmetric()))
}

fn largest(of: &Array2<f64>) -> f64 {
    of.iter().fold(0.0, |most, value| value.abs().max(most))
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
    fn rows_and_columns_give_one_solution(rows in 4_usize..40, cells in 1_usize..20, seed in any::<u64>()) {
        let (channels, columns) = (2, 2 * cells);
        let values: Vec<f32> = matrix(rows, columns, seed).iter().map(|&value| value as f32).collect();
        let design = Design { values: &values, columns, channels };
        let (all, group): (Vec<usize>, Vec<usize>) =
            ((0..rows).collect(), (0..rows).map(|row| row % 2).collect());
        let system = design.system(&all, &group, 2);
        // The same by hand: centred by group, scaled by channel.
        let x = Array2::from_shape_fn((rows, columns), |(row, column)| {
            let value = f64::from(values[row * columns + column]);
            (value - system.means[[group[row], column]]) * system.scale[column]
        });
        let whole = x.t().dot(&x) + Array2::<f64>::eye(columns) * 0.3;
        let right = matrix(2, columns, seed ^ 1);
        let found = system.solve(&right, &[0.3]).remove(0).expect("it is positive definite");
        prop_assert!(largest(&(found.dot(&whole) - &right)) < 1e-8);
        let of = matrix(rows, 2, seed ^ 2);
        prop_assert!(largest(&(system.transposed(&of) - of.t().dot(&x))) < 1e-9);
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_has_no_factor() {
    assert!(Factor::new(array![[1.0, 0.0], [2.0, 1.0]], 0.0).is_none());
    assert!(Factor::new(array![[f64::NAN]], 1.0).is_none());
}
