//! Every kernel on every instruction set against its scalar twin, bit for bit.

use meissner_kernels::{
    Activation, Dense, GraphRow, Isa, Lanes, Matrix, Neighbour, PointNetConv, PointNetParts, PointNetScratch,
    SplineConv, SplineParts, SplineScratch, spline_basis,
};
use proptest::prelude::*;

use crate::naive;
use crate::values::values;

/// Attributes, many of them at the ends, in the middle and next to these, where slots change.
fn attribute() -> impl Strategy<Value = f32> {
    prop_oneof![4 => 0.0f32..=1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(0.5), 1 => Just(1.0 - f32::EPSILON / 2.0)]
}

#[derive(Clone, Debug)]
struct Case {
    parts: SplineParts,
    features: Vec<f32>,
    neighbours: Vec<Neighbour>,
    skip: Option<Vec<f32>>,
}

const ROWS: usize = 9;

fn case() -> impl Strategy<Value = Case> {
    let kernel = prop_oneof![
        2 => Just([2, 2, 2]),
        1 => Just([2, 2, 1]),
        3 => (1usize..=5, 1usize..=5, 1usize..=5).prop_map(|(x, y, t)| [x, y, t]),
        1 => Just([8, 8, 8]),
    ];
    (kernel, 1usize..=34, 1usize..=34, 0usize..=24).prop_flat_map(|(kernel, inputs, outputs, degree)| {
        let slots: usize = kernel.iter().product();
        let neighbour = (0..ROWS as u32, attribute(), attribute(), attribute())
            .prop_map(|(row, x, y, t)| Neighbour { row, u: [x, y, t] });
        (
            values(slots * inputs * outputs),
            proptest::option::of(values(outputs * inputs)),
            proptest::option::of(values(outputs)),
            proptest::option::of((values(outputs), values(outputs))),
            any::<bool>(),
            values(ROWS * inputs),
            proptest::collection::vec(neighbour, degree),
            proptest::option::of(values(outputs)),
        )
            .prop_map(move |(weight, root, bias, norm, elu, features, neighbours, skip)| Case {
                parts: SplineParts { inputs, outputs, kernel, weight, root, bias, norm, elu },
                features,
                neighbours,
                skip,
            })
    })
}

/// A `PointNet` block, the rows' values, a row's in-edges with offsets, and the values that are
/// added.
type PointNetCase = (PointNetParts, Vec<f32>, Vec<(u32, [f32; 3])>, Option<Vec<f32>>);

fn pointnet_case() -> impl Strategy<Value = PointNetCase> {
    (1usize..=34, 1usize..=34, 0usize..=24).prop_flat_map(|(inputs, outputs, degree)| {
        let offset = || prop_oneof![4 => -3.0f32..3.0, 1 => Just(0.0), 1 => Just(-0.0)];
        let norm = proptest::option::of((values(outputs), values(outputs)));
        let parts = (values(outputs * (inputs + 3)), values(outputs), norm)
            .prop_map(move |(weight, bias, norm)| PointNetParts { inputs, outputs, weight, bias, norm });
        let edge = (0..ROWS as u32, [offset(), offset(), offset()]);
        // Sometimes a feature makes sums infinite or NaN.
        let features = (values(ROWS * inputs), proptest::option::weighted(0.1, 0..ROWS * inputs)).prop_map(
            |(mut features, infinite)| {
                if let Some(at) = infinite {
                    features[at] = f32::INFINITY;
                }
                features
            },
        );
        let skip = proptest::option::of(values(outputs));
        (parts, features, proptest::collection::vec(edge, degree), skip)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_spline_row_is_the_same_bits_as_its_scalar_twin(
        case in case(), own in 0..ROWS, company in 1usize..20, place in 0usize..20,
    ) {
        let inputs = case.parts.inputs;
        let expected = naive::spline_row(
            &case.parts, &case.neighbours, |j, c| case.features[j * inputs + c], own, case.skip.as_deref());
        let features = Matrix::from_rows(inputs, &case.features);
        let conv = SplineConv::new(&case.parts).unwrap();
        let skip = case.skip.as_deref().map(Lanes::pack);
        let mut scratch = SplineScratch::default();
        let basis: Vec<Lanes> = case.neighbours.iter().map(|n| spline_basis(n.u)).collect();
        for isa in Isa::available() {
            // Twice with one scratch, with and without a basis: no row may affect the next.
            for basis in [&basis[..], &[]] {
                let row = GraphRow {
                    neighbours: &case.neighbours, basis, offsets: &[], own: features.row(own), skip: skip.as_deref(),
                };
                // The row is among different rows, so that tiles of every size occur.
                let neighbours = &case.neighbours[case.neighbours.len() / 2..];
                let other = GraphRow { neighbours, basis: &[], ..row };
                let rows: Vec<_> = (0..company).map(|i| if i == place % company { row } else { other }).collect();
                let mut out = Matrix::zeros(company, case.parts.outputs);
                conv.rows(isa, &features, &rows, &mut scratch, out.lanes_mut());
                let got: Vec<u32> = out.values(place % company).map(f32::to_bits).collect();
                let expected: Vec<u32> = expected.iter().map(|v| v.to_bits()).collect();
                prop_assert_eq!(got, expected, "{} of {} rows, {}", place % company, company, isa.name());
            }
        }
    }

    #[test]
    fn a_block_made_of_its_own_parts_has_the_same_parts(case in case()) {
        let parts = SplineConv::new(&case.parts).unwrap().parts();
        prop_assert_eq!(&parts.weight, &case.parts.weight);
        prop_assert_eq!(&parts.root, &case.parts.root);
        prop_assert_eq!((parts.kernel, parts.elu), (case.parts.kernel, case.parts.elu));
        let outputs = case.parts.outputs;
        let zeros = vec![0.0; outputs];
        prop_assert_eq!(parts.bias, Some(case.parts.bias.unwrap_or_else(|| zeros.clone())));
        prop_assert_eq!(parts.norm, Some(case.parts.norm.unwrap_or((vec![1.0; outputs], zeros))));
    }

    #[test]
    fn a_pointnet_row_is_the_same_bits_as_its_scalar_twin(
        (parts, features, edges, skip) in pointnet_case(), own in 0..ROWS, company in 1usize..20, place in 0usize..20,
    ) {
        let neighbours: Vec<Neighbour> = edges.iter().map(|&(row, _)| Neighbour { row, u: [0.5; 3] }).collect();
        let offsets: Vec<[f32; 3]> = edges.iter().map(|&(_, offset)| offset).collect();
        let matrix = Matrix::from_rows(parts.inputs, &features);
        let packed = skip.as_deref().map(Lanes::pack);
        let row = GraphRow {
            neighbours: &neighbours, basis: &[], offsets: &offsets, own: matrix.row(own), skip: packed.as_deref(),
        };
        let x = |j: usize, c: usize| features[j * parts.inputs + c];
        let bits = |v: f32| if v.is_nan() { f32::NAN.to_bits() } else { v.to_bits() };
        let expected = naive::pointnet_row(&parts, &row, x, own, skip.as_deref());
        let expected: Vec<u32> = expected.into_iter().map(bits).collect();
        let conv = PointNetConv::new(&parts).unwrap();
        // Data that a row leaves in the scratch must not affect the next.
        let mut scratch = PointNetScratch::default();
        let half = edges.len() / 2;
        let other = GraphRow { neighbours: &neighbours[half..], offsets: &offsets[half..], ..row };
        let rows: Vec<_> = (0..company).map(|i| if i == place % company { row } else { other }).collect();
        for isa in Isa::available() {
            let mut out = Matrix::zeros(company, parts.outputs);
            conv.rows(isa, &matrix, &rows, &mut scratch, out.lanes_mut());
            let got: Vec<u32> = out.values(place % company).map(bits).collect();
            prop_assert_eq!(&got, &expected, "{} of {} rows, {}", place % company, company, isa.name());
        }
    }

    #[test]
    fn a_pointnet_block_made_of_its_own_parts_has_the_same_parts((parts, ..) in pointnet_case()) {
        let again = PointNetConv::new(&parts).unwrap().parts();
        prop_assert_eq!(&again.weight, &parts.weight);
        prop_assert_eq!(&again.bias, &parts.bias);
        let trivial = (vec![1.0; parts.outputs], vec![0.0; parts.outputs]);
        prop_assert_eq!(again.norm, Some(parts.norm.unwrap_or(trivial)));
    }

    #[test]
    fn a_dense_layer_tells_the_parameters_that_it_was_made_of(
        (segments, channels, outputs, weight, bias) in (1usize..9, 1usize..40, 1usize..12)
            .prop_flat_map(|(s, c, o)| (Just(s), Just(c), Just(o), values(s * c * o), values(o))),
    ) {
        let dense = Dense::new(segments, channels, outputs, &weight, Some(&bias), Activation::Elu).unwrap();
        prop_assert_eq!(dense.weight(), weight);
        prop_assert_eq!(dense.bias(), &bias[..]);
        prop_assert_eq!((dense.channels(), dense.inputs(), dense.activation()),
            (channels, segments * channels, Activation::Elu));
    }

    /// Some segments change from one input to the next, and all of them are reported.
    #[test]
    fn a_dense_layer_is_the_same_bits_as_its_scalar_twin(
        (segments, channels, outputs, inputs, weight, bias) in (1usize..20, 1usize..40, 1usize..40)
            .prop_flat_map(|(s, c, o)| {
                let inputs = proptest::collection::vec((values(s * c), proptest::collection::vec(0u8..4, s)), 1..4);
                (Just(s), Just(c), Just(o), inputs, values(s * c * o), values(o))
            }),
        activation in prop_oneof![
            Just(Activation::Identity), Just(Activation::Relu), Just(Activation::Elu), Just(Activation::Sigmoid),
            Just(Activation::Tanh),
        ],
    ) {
        let rows: Vec<Vec<f32>> = weight.chunks(segments * channels).map(<[f32]>::to_vec).collect();
        let dense = Dense::new(segments, channels, outputs, &weight, Some(&bias), activation).unwrap();
        for isa in Isa::available() {
            let mut x = vec![vec![0.0; channels]; segments];
            let mut sums = vec![Lanes::ZERO; dense.sums()];
            let mut kept = Matrix::zeros(1, outputs);
            for (values, kinds) in &inputs {
                let mut changed = Vec::new();
                for (segment, (value, kind)) in values.chunks(channels).zip(kinds).enumerate().rev() {
                    match kind {
                        0 => x[segment].fill(0.0),
                        1 => x[segment].copy_from_slice(value),
                        _ => continue,
                    }
                    changed.push(segment as u32);
                }
                let expected: Vec<u32> =
                    naive::dense(&x, &rows, &bias, activation).iter().map(|v| v.to_bits()).collect();
                let input = Matrix::from_rows(channels, &x.concat());
                let mut out = Matrix::zeros(1, outputs);
                dense.run(isa, input.lanes(), out.row_mut(0));
                dense.update(isa, input.lanes(), &changed, &mut sums, kept.row_mut(0));
                for got in [&out, &kept] {
                    let got: Vec<u32> = got.values(0).map(f32::to_bits).collect();
                    prop_assert_eq!(&got, &expected, "{}", isa.name());
                }
            }
        }
    }
}

#[test]
fn a_dense_layer_reads_no_segment_that_it_is_not_told() {
    let (segments, channels, outputs) = (5, 2, 3);
    let numbers = |count: usize| (0..count).map(|i| (i as f32 * 0.7).sin()).collect::<Vec<_>>();
    let weight = numbers(segments * channels * outputs);
    let dense = Dense::new(segments, channels, outputs, &weight, None, Activation::Identity).unwrap();
    let first = Matrix::from_rows(channels, &numbers(segments * channels));
    let (mut told, mut all) = (first.clone(), first.clone());
    told.row_mut(3)[0] = Lanes::splat(2.0);
    all.row_mut(3)[0] = Lanes::splat(2.0);
    all.row_mut(1)[0] = Lanes::splat(f32::NAN);
    for isa in Isa::available() {
        let mut sums = vec![Lanes::ZERO; dense.sums()];
        let (mut out, mut expected) = (Matrix::zeros(1, outputs), Matrix::zeros(1, outputs));
        dense.update(isa, first.lanes(), &[0, 1, 2, 3, 4], &mut sums, out.row_mut(0));
        dense.update(isa, all.lanes(), &[3], &mut sums, out.row_mut(0));
        dense.run(isa, told.lanes(), expected.row_mut(0));
        assert_eq!(out.lanes(), expected.lanes(), "{}", isa.name());
    }
}
