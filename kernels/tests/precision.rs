//! Weights of reduced precision: their error, and blocks whose weights are rounded against blocks of rounded weights.

use meissner_kernels::{
    Activation, Dense, Isa, KernelError, Lanes, Matrix, Neighbour, Precision, SplineConv, SplineParts,
    SplineRow, SplineScratch, naive,
};
use proptest::prelude::*;

/// Any finite f32 that bf16 can hold, and values of the size of weights.
fn weight() -> impl Strategy<Value = f32> {
    let any = any::<u32>().prop_map(f32::from_bits);
    prop_oneof![any.prop_filter("within bf16", |w| w.abs() < 3.38e38), -2.0f32..2.0, Just(0.0), Just(-0.0)]
}

fn weights(n: usize) -> impl Strategy<Value = Vec<f32>> {
    proptest::collection::vec(prop_oneof![8 => -2.0f32..2.0, 1 => Just(0.0)], n)
}

fn rounded(precision: Precision, weights: &[f32]) -> Vec<f32> {
    let mut rounded = weights.to_vec();
    precision.round(&mut rounded).expect("weights in range");
    rounded
}

/// `weights`, (rows, outputs), each column rounded.
fn rounded_columns(precision: Precision, weights: &[f32], outputs: usize) -> Vec<f32> {
    let column = |o: usize| weights.iter().skip(o).step_by(outputs).copied().collect::<Vec<_>>();
    let columns: Vec<Vec<f32>> = (0..outputs).map(|o| rounded(precision, &column(o))).collect();
    (0..weights.len()).map(|i| columns[i % outputs][i / outputs]).collect()
}

fn bits(lanes: &[Lanes]) -> Vec<u32> {
    lanes.iter().flat_map(|l| l.0).map(f32::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn bf16_is_the_nearest_with_ties_to_even(w in weight()) {
        let got = rounded(Precision::Bf16, &[w])[0];
        prop_assert_eq!(got.to_bits(), naive::bf16(w).to_bits());
        if w.is_normal() {
            prop_assert!((f64::from(got) - f64::from(w)).abs() <= f64::from(w).abs() / 256.0);
        }
    }

    #[test]
    fn bf16_ties_go_to_the_even_one(upper in 0u32..0x7f7f, negative in any::<bool>()) {
        let sign = u32::from(negative) << 31;
        let tie = f32::from_bits(sign | upper << 16 | 0x8000);
        let got = rounded(Precision::Bf16, &[tie])[0].to_bits();
        prop_assert_eq!(got, sign | (upper + (upper & 1)) << 16);
    }

    #[test]
    fn int8_is_within_half_a_step_of_the_channel(weights in proptest::collection::vec(weight(), 1..40)) {
        let largest = weights.iter().fold(0.0f64, |m, &w| m.max(f64::from(w).abs()));
        let step = largest / 127.0;
        for (&got, &w) in rounded(Precision::Int8, &weights).iter().zip(&weights) {
            // The result is rounded to f32 once more.
            let slack = f64::from(got).abs() * 2f64.powi(-24) + f64::from(f32::from_bits(1));
            prop_assert!((f64::from(got) - f64::from(w)).abs() <= step * (0.5 + 1e-12) + slack);
            if step > 0.0 {
                let steps = f64::from(got) / step;
                let error = (steps - steps.round()).abs() * step;
                prop_assert!(steps.abs() < 127.5 && error <= 2.0 * slack, "{steps} steps");
            }
        }
    }

    #[test]
    fn rounding_twice_is_rounding_once(weights in proptest::collection::vec(weight(), 1..40)) {
        let bits = |weights: &[f32]| weights.iter().map(|w| w.to_bits()).collect::<Vec<_>>();
        let once = rounded(Precision::Bf16, &weights);
        prop_assert_eq!(bits(&rounded(Precision::Bf16, &once)), bits(&once));
    }

    #[test]
    fn a_rounded_block_is_the_block_of_rounded_weights(
        (inputs, outputs, weight, root) in (1usize..=9, 1usize..=40)
            .prop_flat_map(|(c, o)| (Just(c), Just(o), weights(8 * c * o), weights(c * o))),
        features in proptest::collection::vec(-1.0f32..1.0, 27),
    ) {
        let isa = Isa::best();
        for precision in [Precision::Bf16, Precision::Int8] {
            let parts = SplineParts {
                inputs, outputs, kernel: [2; 3], weight: weight.clone(), root: Some(root.clone()), elu: true,
                ..SplineParts::default()
            };
            // A root weight is (O, C): each output's weights are a row.
            let root = root.chunks(inputs).flat_map(|row| rounded(precision, row)).collect();
            let twin = SplineParts { weight: rounded_columns(precision, &weight, outputs), root: Some(root), ..parts.clone() };
            let features = Matrix::from_rows(inputs, &features[..27 / inputs * inputs]);
            let neighbours = [Neighbour { row: 1, u: [0.2, 0.7, 0.4] }, Neighbour { row: 2, u: [0.9, 0.1, 0.5] }];
            let row = SplineRow { neighbours: &neighbours, own: features.row(0), ..SplineRow::default() };
            let run = |conv: &SplineConv| {
                let mut out = vec![Lanes::ZERO; Lanes::count(outputs)];
                conv.rows(isa, &features, &[row], &mut SplineScratch::default(), &mut out);
                bits(&out)
            };
            let block = SplineConv::new(&parts).expect("sizes fit").rounded(precision).expect("in range");
            prop_assert_eq!(run(&block), run(&SplineConv::new(&twin).expect("sizes fit")), "{:?}", precision);
        }
    }

    #[test]
    fn a_rounded_dense_layer_is_the_layer_of_rounded_weights(
        (segments, channels, outputs, weight) in (1usize..=4, 1usize..=19, 1usize..=9)
            .prop_flat_map(|(s, c, o)| (Just(s), Just(c), Just(o), weights(s * c * o))),
    ) {
        for precision in [Precision::Bf16, Precision::Int8] {
            let dense = |weight: &[f32]| {
                Dense::new(segments, channels, outputs, weight, None, Activation::Identity).expect("sizes fit")
            };
            let rows = weight.chunks(segments * channels).flat_map(|row| rounded(precision, row));
            let twin = dense(&rows.collect::<Vec<_>>());
            let layer = dense(&weight).rounded(precision).expect("in range");
            let input: Vec<f32> = (0..segments * channels).map(|i| 0.1 * i as f32 - 0.7).collect();
            let input = Matrix::from_rows(channels, &input);
            let run = |dense: &Dense| {
                let mut out = vec![Lanes::ZERO; Lanes::count(outputs)];
                dense.run(Isa::best(), input.lanes(), &mut out);
                bits(&out)
            };
            prop_assert_eq!(run(&layer), run(&twin), "{:?}", precision);
        }
    }
}

#[test]
fn a_weight_beyond_the_largest_bf16_is_refused() {
    let refused = Precision::Bf16.round(&mut [1.0, f32::MAX]);
    assert!(matches!(refused, Err(KernelError::NotFinite { index: 1, .. })), "{refused:?}");
    assert!(Precision::Int8.round(&mut [1.0, f32::MAX]).is_ok());
}

#[test]
fn a_channel_of_zeros_and_one_of_the_smallest_number_stay() {
    let mut zeros = [0.0, -0.0];
    Precision::Int8.round(&mut zeros).expect("in range");
    assert_eq!(zeros.map(f32::to_bits), [0, 1 << 31]);
    let mut smallest = [f32::from_bits(1)];
    Precision::Int8.round(&mut smallest).expect("in range");
    assert_eq!(smallest[0].to_bits(), 1);
}
