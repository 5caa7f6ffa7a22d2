//! Rows that a tolerance keeps, on every instruction set, against the scalar twin.

use meissner_kernels::{Isa, Lanes, Matrix, naive, replace_rows, replace_rows_beyond};
use proptest::prelude::*;

/// Multiples of an eighth, so that differences meet tolerances exactly; zeros of both signs, NaN
/// and infinities.
fn value() -> impl Strategy<Value = f32> {
    prop_oneof![
        20 => (-6i8..6).prop_map(|i| f32::from(i) / 8.0),
        2 => Just(-0.0f32),
        1 => Just(f32::NAN),
        1 => prop_oneof![Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
        1 => prop_oneof![Just(f32::MAX), Just(-f32::MAX), Just(f32::from_bits(1))],
    ]
}

/// A stored row, and the computed one.
type Row = (Vec<f32>, Vec<f32>);

fn row(columns: usize) -> impl Strategy<Value = Row> {
    let old = || proptest::collection::vec(value(), columns);
    let moved = (old(), proptest::collection::vec(-2i8..=2, columns)).prop_map(|(old, steps)| {
        let new = old.iter().zip(steps).map(|(v, step)| v + f32::from(step) / 8.0).collect();
        (old, new)
    });
    prop_oneof![3 => moved, 1 => (old(), old()), 1 => old().prop_map(|old| (old.clone(), old))]
}

fn case() -> impl Strategy<Value = (usize, Vec<Row>)> {
    (1usize..40).prop_flat_map(|columns| (Just(columns), proptest::collection::vec(row(columns), 1..=32)))
}

fn bits(row: &[f32]) -> Vec<u32> {
    row.iter().map(|v| v.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn rows_within_a_tolerance_stay_as_the_scalar_twin_says(
        (columns, rows) in case(),
        tolerance in prop_oneof![Just(0.0f32), Just(0.125), Just(0.13), Just(0.25), Just(f32::MAX)],
    ) {
        let flat: Vec<f32> = rows.iter().flat_map(|(old, _)| old.clone()).collect();
        let new: Vec<Lanes> = rows.iter().flat_map(|(_, new)| Lanes::pack(new)).collect();
        let places: Vec<u32> = (0..rows.len() as u32).collect();
        for isa in Isa::available() {
            let mut stored = Matrix::from_rows(columns, &flat);
            let replaced = replace_rows_beyond(isa, tolerance, &new, &mut stored, &places);
            for (i, (old, new)) in rows.iter().enumerate() {
                let bit = |set: u32| set >> i & 1 != 0;
                let beyond = naive::replaced_beyond(tolerance, new, old);
                let differs = bits(new) != bits(old);
                prop_assert_eq!(bit(replaced.changed), beyond, "{}", isa.name());
                prop_assert_eq!(bit(replaced.within), differs && !beyond, "{}", isa.name());
                prop_assert_eq!(bit(replaced.nan), new.iter().any(|v| v.is_nan()), "{}", isa.name());
                let expected = if beyond { new } else { old };
                prop_assert_eq!(bits(stored.slice(i)), bits(expected), "{}", isa.name());
            }
        }
    }

    #[test]
    fn without_a_tolerance_no_row_that_differs_is_kept((columns, rows) in case()) {
        let flat: Vec<f32> = rows.iter().flat_map(|(old, _)| old.clone()).collect();
        let new: Vec<Lanes> = rows.iter().flat_map(|(_, new)| Lanes::pack(new)).collect();
        let places: Vec<u32> = (0..rows.len() as u32).collect();
        for isa in Isa::available() {
            let mut stored = Matrix::from_rows(columns, &flat);
            let replaced = replace_rows(isa, &new, &mut stored, &places);
            prop_assert_eq!(replaced.within, 0);
            for (i, (_, new)) in rows.iter().enumerate() {
                prop_assert_eq!(bits(stored.slice(i)), bits(new), "{}", isa.name());
            }
        }
    }
}

#[test]
fn a_row_of_nan_is_replaced_whatever_the_tolerance() {
    for isa in Isa::available() {
        let mut stored = Matrix::from_rows(3, &[f32::NAN; 3]);
        let replaced = replace_rows_beyond(isa, f32::MAX, &Lanes::pack(&[1.0; 3]), &mut stored, &[0]);
        assert_eq!((replaced.changed, replaced.within, replaced.nan), (1, 0, 0), "{}", isa.name());
        assert_eq!(stored.slice(0), [1.0; 3]);
    }
}
