//! The filter of near points, maxima over rows, and the replacement of rows, against scalar twins.

use meissner_kernels::{
    Isa, Lanes, Matrix, Nearby, Replaced, Simd, Task, clear_negative_zero, maximum, prefetch, replace_rows,
    replace_rows_beyond,
};
use proptest::prelude::*;

use crate::naive;

/// Points on a lattice, so that many distances are equal.
fn points() -> impl Strategy<Value = [Vec<f32>; 3]> {
    (1usize..150, prop_oneof![Just(3u8), Just(12), Just(100)]).prop_flat_map(|(n, extent)| {
        let axis = || proptest::collection::vec((0..extent).prop_map(f32::from), n);
        [axis(), axis(), axis()]
    })
}

fn padded(mut values: Vec<f32>) -> Vec<f32> {
    values.resize(values.len().next_multiple_of(Nearby::TOGETHER), f32::INFINITY);
    values
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn near_points_are_those_of_the_scalar_twin(
        points in points(), except in 0usize..150, most in 1usize..40, guess in 0.0f32..4.0,
    ) {
        let except = except % points[0].len();
        let place = [0, 1, 2].map(|d| points[d][except]);
        let weights = [0.25, 0.01, 0.003];
        let points = points.map(padded);
        let points = [0, 1, 2].map(|d| &points[d][..]);
        let expected = naive::nearby(weights, points, place, except, most, guess);
        for isa in Isa::available() {
            let mut nearby = Nearby::new(weights);
            // Twice: data that a search leaves behind must not affect the next.
            for _ in 0..2 {
                let found = nearby.find(isa, points, place, except, most, guess);
                let sorted = found.map(|found| {
                    let mut sorted = found.to_vec();
                    sorted.sort_unstable();
                    sorted
                });
                prop_assert_eq!(&sorted, &expected, "{}", isa.name());
            }
        }
    }

    #[test]
    fn up_to_32_points_come_nearest_first_and_later_ones_first_among_equals(
        points in points(), most in 1usize..20, guess in 0.0f32..4.0,
    ) {
        let place = [0, 1, 2].map(|d| points[d][0]);
        let points = points.map(padded);
        let points = [0, 1, 2].map(|d| &points[d][..]);
        // Squared distances of whole numbers up to 2^18 are exact.
        let distance = |i: u32| (0..3).map(|d| (points[d][i as usize] - place[d]).powi(2)).sum::<f32>();
        let mut orders = Vec::new();
        for isa in Isa::available() {
            let mut nearby = Nearby::new([1.0; 3]);
            let found = nearby.find(isa, points, place, 0, most, guess * 100.0).unwrap_or_default();
            if found.len() <= 32 {
                for pair in found.windows(2) {
                    let (first, second) = (distance(pair[0]), distance(pair[1]));
                    prop_assert!(first < second || (first == second && pair[0] > pair[1]), "{}", isa.name());
                }
            }
            orders.push(found.to_vec());
        }
        prop_assert!(orders.windows(2).all(|pair| pair[0] == pair[1]));
    }

    #[test]
    fn replaced_rows_are_those_whose_bits_differ(
        columns in 1usize..40,
        rows in proptest::collection::vec((0u8..5, any::<proptest::sample::Index>()), 0..=20),
    ) {
        for isa in Isa::available() {
            let old: Vec<f32> = (0..rows.len().max(1) * columns).map(|i| i as f32 - 3.0).collect();
            let mut stored = Matrix::from_rows(columns, &old);
            let places: Vec<u32> = (0..rows.len() as u32).rev().collect();
            let mut expected = Replaced::default();
            let mut new = Vec::new();
            for (i, ((kind, index), &place)) in rows.iter().zip(&places).enumerate() {
                let mut row: Vec<f32> = stored.values(place as usize).collect();
                let value = &mut row[index.index(columns)];
                *value = match kind {
                    0 => *value + 1.0,
                    1 => f32::NAN,
                    2 if *value == 0.0 => -0.0,
                    _ => *value,
                };
                let differs = value.to_bits() != stored.row(place as usize)[index.index(columns) / 8].0[index.index(columns) % 8].to_bits();
                expected.changed |= u32::from(differs) << i;
                expected.nan |= u32::from(value.is_nan()) << i;
                new.extend(Lanes::pack(&row));
            }
            let replaced = replace_rows(isa, &new, &mut stored, &places);
            prop_assert_eq!(replaced, expected, "{}", isa.name());
            for (&place, new) in places.iter().zip(new.chunks(Lanes::count(columns))) {
                let bits = |row: &[Lanes]| row.iter().flat_map(|l| l.0).map(f32::to_bits).collect::<Vec<_>>();
                prop_assert_eq!(bits(stored.row(place as usize)), bits(new));
            }
        }
    }
}

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

/// The maximum of the rows in this order.
struct Maximum<'a> {
    rows: &'a Matrix,
    order: &'a [usize],
}

impl Task for Maximum<'_> {
    type Output = Vec<u32>;

    #[expect(clippy::inline_always, reason = "otherwise it does not use the instruction set")]
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<u32> {
        let mut acc = vec![Lanes::splat(f32::NEG_INFINITY); Lanes::count(self.rows.columns())];
        maximum(simd, &mut acc, self.order.iter().map(|&row| self.rows.row(row)));
        clear_negative_zero(&mut acc);
        acc.iter().flat_map(|lanes| lanes.0).map(f32::to_bits).take(self.rows.columns()).collect()
    }
}

proptest! {
    #[test]
    fn a_maximum_is_that_of_every_channel_in_any_order_of_its_members(
        (columns, values) in (1..80_usize, 1..9_usize).prop_flat_map(|(columns, rows)| {
            let value = prop_oneof![
                4 => -4.0..4.0_f32,
                1 => prop_oneof![Just(0.0), Just(-0.0), Just(1e-45), Just(-1e-45)],
                1 => prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
            ];
            (Just(columns), prop::collection::vec(value, columns * rows))
        }),
        turn in 0..9_usize,
    ) {
        let rows = Matrix::from_rows(columns, &values);
        let largest = |c: usize| {
            let members = values.iter().skip(c).step_by(columns).copied();
            members.filter(|v| !v.is_nan()).fold(f32::NEG_INFINITY, f32::max) + 0.0
        };
        let expected: Vec<u32> = (0..columns).map(|c| largest(c).to_bits()).collect();
        let mut order: Vec<usize> = (0..rows.rows()).collect();
        order.rotate_left(turn % rows.rows());
        if turn.is_multiple_of(2) {
            order.reverse();
        }
        for isa in Isa::available() {
            prop_assert_eq!(&isa.run(Maximum { rows: &rows, order: &order }), &expected);
        }
    }
}

#[test]
fn what_does_not_exist_can_be_prefetched() {
    let matrix = Matrix::zeros(3, 40);
    for row in [0, 2, 3, usize::from(u16::MAX)] {
        matrix.prefetch(row);
    }
    Matrix::zeros(0, 8).prefetch(0);
    prefetch(matrix.row(2));
    prefetch::<u64>(&[]);
}
