//! Cells, planar kernels, squeeze-and-excitation on every instruction set against scalar twins.

use meissner_kernels::{
    Activation, FeatureMap, Isa, Lstm, LstmParts, Occupancy, PlanarConv3x3, PlanarConvLstm, Planes, Squash,
    SqueezeExcite, SqueezeScratch, TileRegion, lstm_update, lstm_update_rows, planar_average_pool,
    planar_max_pool, sigmoid, tanh,
};
use proptest::prelude::*;

use crate::naive;

/// Usual values, zeros of both signs, and values whose products vanish.
fn value() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -2.0f32..2.0,
        1 => Just(0.0),
        1 => Just(-0.0),
        1 => prop_oneof![Just(1e-30f32), Just(-1e-30), Just(1e-40), Just(-1e-45)],
    ]
}

fn values(n: usize) -> impl Strategy<Value = Vec<f32>> {
    // Skipping is meant for whole tensors of zeros.
    prop_oneof![
        5 => proptest::collection::vec(value(), n),
        1 => proptest::collection::vec(prop_oneof![Just(0.0f32), Just(-0.0)], n),
    ]
}

/// Images that are mostly empty.
fn sparse(n: usize) -> impl Strategy<Value = Vec<f32>> {
    proptest::collection::vec(prop_oneof![30 => Just(0.0), 2 => Just(-0.0), 1 => value()], n)
}

fn squash() -> impl Strategy<Value = Squash> {
    prop_oneof![Just(Squash::Tanh), Just(Squash::Sigmoid)]
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn bits_of(planes: &Planes) -> Vec<u32> {
    planes.values().map(f32::to_bits).collect()
}

/// Everything outside of the pixels must stay zero, or the next kernel reads it.
fn border_is_zero(planes: &Planes) -> bool {
    let mut all: Vec<u32> =
        planes.lanes().iter().flat_map(|l| l.0).map(f32::to_bits).filter(|&v| v != 0).collect();
    let mut inside: Vec<u32> = bits_of(planes).into_iter().filter(|&v| v != 0).collect();
    all.sort_unstable();
    inside.sort_unstable();
    all == inside
}

#[test]
fn sigmoid_and_tanh_are_the_same_bits_in_vectors_of_every_instruction_set() {
    let x: Vec<f32> = (0..=u32::MAX).step_by(65_521).map(f32::from_bits).filter(|x| !x.is_nan()).collect();
    let n = x.len();
    // i = sigmoid(x), tanh(g) = 1, f = 0: the new cell is sigmoid(x). o = 1, so h = tanh(c).
    let (high, low) = (vec![100.0; n], vec![f32::NEG_INFINITY; n]);
    for isa in Isa::available() {
        let (mut c, mut h) = (vec![0.0; n], vec![0.0; n]);
        lstm_update(isa, [&x, &low, &high, &high], None, Squash::Tanh, &mut c, &mut h);
        for i in 0..n {
            assert_eq!(c[i].to_bits(), sigmoid(x[i]).to_bits(), "sigmoid of {:e}, {}", x[i], isa.name());
            assert_eq!(h[i].to_bits(), tanh(c[i]).to_bits(), "tanh of {:e}, {}", c[i], isa.name());
        }
        // i = 1, f = 0: c = tanh(x) + 0.
        let mut c = vec![0.0; n];
        lstm_update(isa, [&high, &low, &x, &high], None, Squash::Tanh, &mut c, &mut h);
        for i in 0..n {
            assert_eq!(c[i].to_bits(), (tanh(x[i]) + 0.0).to_bits(), "tanh of {:e}, {}", x[i], isa.name());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn gates_are_the_same_bits_as_their_scalar_twin(
        (gates, peephole, cell) in (0usize..150).prop_flat_map(|n| (
            prop::array::uniform4(values(n)), proptest::option::of(prop::array::uniform3(values(n))), values(n))),
        by in squash(),
    ) {
        let n = cell.len();
        let expected: Vec<(f32, f32)> = (0..n)
            .map(|j| {
                let peephole = peephole.as_ref().map(|p| p.each_ref().map(|p| p[j]));
                naive::lstm_update(gates.each_ref().map(|g| g[j]), peephole, by, cell[j])
            })
            .collect();
        let (expected_c, expected_h): (Vec<f32>, Vec<f32>) = expected.into_iter().unzip();
        for isa in Isa::available() {
            let (mut c, mut h) = (cell.clone(), vec![0.5; n]);
            let peephole = peephole.as_ref().map(|p| p.each_ref().map(|p| &p[..]));
            lstm_update(isa, gates.each_ref().map(|g| &g[..]), peephole, by, &mut c, &mut h);
            prop_assert_eq!(bits(&c), bits(&expected_c), "{}", isa.name());
            prop_assert_eq!(bits(&h), bits(&expected_h), "{}", isa.name());
        }
    }

    #[test]
    fn rows_of_gates_are_the_same_bits_as_gates_apart(
        (channels, rows, gates, peephole, cell) in (1usize..70, 0usize..5).prop_flat_map(|(channels, rows)| (
            Just(channels), Just(rows), values(4 * channels * rows), prop::array::uniform3(values(channels * rows)),
            values(channels * rows))),
        by in squash(),
    ) {
        let gate = |gate: usize| -> Vec<f32> {
            gates.chunks(4 * channels).flat_map(|row| row[gate * channels..][..channels].to_vec()).collect()
        };
        let apart: [Vec<f32>; 4] = std::array::from_fn(gate);
        let peephole = Some(peephole.each_ref().map(|p| &p[..]));
        for isa in Isa::available() {
            let (mut c, mut h) = (cell.clone(), vec![0.0; channels * rows]);
            let (mut expected_c, mut expected_h) = (c.clone(), h.clone());
            lstm_update(isa, apart.each_ref().map(|g| &g[..]), peephole, by, &mut expected_c, &mut expected_h);
            lstm_update_rows(isa, channels, &gates, peephole, by, &mut c, &mut h);
            prop_assert_eq!((bits(&c), bits(&h)), (bits(&expected_c), bits(&expected_h)), "{}", isa.name());
        }
    }

    #[test]
    fn an_lstm_is_the_same_bits_as_its_scalar_twin(
        (inputs, hidden, ih, hh, bias_ih, bias_hh, readings) in (1usize..40, 1usize..40).prop_flat_map(|(i, h)| (
            Just(i), Just(h), values(4 * h * i), values(4 * h * h), proptest::option::of(values(4 * h)),
            proptest::option::of(values(4 * h)), proptest::collection::vec(values(i), 0..4))),
        squash in squash(),
    ) {
        let parts = LstmParts {
            inputs, hidden, weight_ih: &ih, weight_hh: &hh, bias_ih: bias_ih.as_deref(),
            bias_hh: bias_hh.as_deref(), squash,
        };
        let lstm = Lstm::new(&parts).unwrap();
        for isa in Isa::available() {
            let mut state = lstm.state();
            let (mut h, mut c) = (vec![0.0; hidden], vec![0.0; hidden]);
            for reading in &readings {
                lstm.step(isa, reading, &mut state);
                naive::lstm(&parts, reading, &mut h, &mut c);
                prop_assert_eq!((bits(state.hidden()), bits(state.cell())), (bits(&h), bits(&c)), "{}", isa.name());
                let padding = state.hidden_lanes().iter().flat_map(|l| l.0).skip(hidden);
                prop_assert!(padding.into_iter().all(|v| v.to_bits() == 0));
            }
        }
    }

    #[test]
    fn a_planar_convolution_is_the_same_bits_as_its_scalar_twin(
        (channels, outputs, (height, width), first, second, weight, bias) in
            (0usize..4, 0usize..4, 1usize..14, (0usize..6, 0usize..70)).prop_flat_map(|(a, b, outputs, size)| {
                let a = if a + b == 0 { 1 } else { a };
                let pixels = size.0 * size.1;
                (
                    Just([a, b]), Just(outputs), Just(size), sparse(a * pixels), values(b * pixels),
                    values(outputs * (a + b) * 9), values(outputs),
                )
            }),
        relu in any::<bool>(),
        cut in (0usize..6, 0usize..6, 0usize..6, 0usize..6),
    ) {
        let inputs = channels[0] + channels[1];
        let both = [&first[..], &second].concat();
        let expected = naive::planar_conv((inputs, height, width), &both, &weight, &bias, relu);
        let conv = PlanarConv3x3::new(channels, outputs, &weight, Some(&bias), relu).unwrap();
        let images = [
            Planes::from_values(channels[0], height, width, &first),
            Planes::from_values(channels[1], height, width, &second),
        ];
        let mut occupied = Occupancy::empty(height, width);
        occupied.update(&images[0]);
        let mut zero = images[0].clone();
        zero.clear();
        let whole = images[0].region();
        let part = TileRegion {
            rows: cut.0.min(cut.1).min(height)..cut.0.max(cut.1).min(height),
            tiles: cut.2.min(cut.3).min(whole.tiles.end)..cut.2.max(cut.3).min(whole.tiles.end),
        };
        for isa in Isa::available() {
            let both = [Some(&images[0]), Some(&images[1])];
            let mut out = Planes::zeros(outputs, height, width);
            conv.run(isa, both, None, &whole, &mut out);
            prop_assert_eq!(bits_of(&out), bits(&expected), "{}", isa.name());
            prop_assert!(border_is_zero(&out));
            // Empty tiles may be skipped, and an empty image may be left out.
            let mut skipped = Planes::zeros(outputs, height, width);
            conv.run(isa, both, Some(&occupied), &whole, &mut skipped);
            prop_assert_eq!(bits_of(&skipped), bits(&expected), "{}, skipping", isa.name());
            if images[0].is_zero_around(&whole) {
                conv.run(isa, [None, both[1]], None, &whole, &mut skipped);
                prop_assert_eq!(bits_of(&skipped), bits(&expected), "{}, without", isa.name());
            }
            // A region changes nothing else.
            let mut region = Planes::zeros(outputs, height, width);
            conv.run(isa, both, None, &part, &mut region);
            prop_assert!(border_is_zero(&region));
            for (i, (got, expected)) in region.values().zip(&expected).enumerate() {
                let (y, x) = (i / width % height, i % width);
                let within = part.rows.contains(&y) && part.tiles.contains(&(x / 16));
                prop_assert_eq!(got.to_bits(), if within { expected.to_bits() } else { 0 });
            }
        }
    }

    #[test]
    fn a_planar_conv_lstm_is_the_same_bits_as_its_scalar_twin(
        (inputs, hidden, (height, width), frames, weight, bias) in
            (1usize..4, 1usize..4, (1usize..6, 1usize..70)).prop_flat_map(|(inputs, hidden, size)| (
                Just(inputs), Just(hidden), Just(size),
                proptest::collection::vec(prop_oneof![
                    sparse(inputs * size.0 * size.1), values(inputs * size.0 * size.1),
                ], 0..4),
                values(4 * hidden * (inputs + hidden) * 9), values(4 * hidden),
            )),
        by in squash(),
    ) {
        let lstm = PlanarConvLstm::new(inputs, hidden, &weight, Some(&bias), by).unwrap();
        for isa in Isa::available() {
            let (mut state, mut skipping) = (lstm.state(height, width), lstm.state(height, width));
            let (mut shown, mut shown_skipping) = (state.cell().clone(), state.cell().clone());
            let mut occupied = Occupancy::empty(height, width);
            let mut h = vec![0.0; hidden * height * width];
            let mut c = h.clone();
            for frame in &frames {
                let x = Planes::from_values(inputs, height, width, frame);
                naive::planar_conv_lstm((height, width), (&weight, &bias), by, frame, &mut h, &mut c);
                occupied.update(&x);
                lstm.step(isa, Some(&x), None, &mut state, &mut shown);
                let empty = occupied.occupied() == 0;
                lstm.step(isa, (!empty).then_some(&x), Some(&occupied), &mut skipping, &mut shown_skipping);
                for (state, shown) in [(&state, &shown), (&skipping, &shown_skipping)] {
                    prop_assert_eq!(bits_of(shown), bits(&h), "{}", isa.name());
                    prop_assert_eq!(bits_of(state.cell()), bits(&c), "{}", isa.name());
                    prop_assert!(border_is_zero(shown) && border_is_zero(state.cell()));
                }
            }
        }
    }

    #[test]
    fn planar_poolings_are_the_same_bits_as_their_scalar_twins(
        (size, image) in (0usize..4, 0usize..12, 0usize..40)
            .prop_flat_map(|size| (Just(size), values(size.0 * size.1 * size.2))),
        window in 1usize..6,
    ) {
        let (channels, height, width) = size;
        let planes = Planes::from_values(channels, height, width, &image);
        let mut out = Planes::zeros(channels, height / 2, width / 2);
        planar_max_pool(&planes, &mut out);
        prop_assert_eq!(bits_of(&out), bits(&naive::maximum_pool(size, &image)));
        let (mut columns, mut out) = (Vec::new(), Planes::zeros(channels, height / window, width / window));
        planar_average_pool(&planes, window, &mut columns, &mut out);
        prop_assert_eq!(bits_of(&out), bits(&naive::average_pool(size, &image, window)));
    }

    #[test]
    fn occupancy_is_what_a_search_for_nonzero_values_finds(
        (size, image) in (1usize..3, 1usize..7, 1usize..70)
            .prop_flat_map(|size| (Just(size), sparse(size.0 * size.1 * size.2))),
    ) {
        let planes = Planes::from_values(size.0, size.1, size.2, &image);
        let mut occupied = Occupancy::empty(size.1, size.2);
        // Twice, so that the earlier flags must disappear.
        occupied.update(&Planes::from_values(size.0, size.1, size.2, &vec![1.0; image.len()]));
        occupied.update(&planes);
        let tiles = planes.tiles();
        for y in 0..size.1 {
            for first in 0..tiles {
                for count in 1..=tiles - first {
                    let set = |at: usize| {
                        let (row, tile) = (at / size.2 % size.1, at % size.2 / 16);
                        image[at] != 0.0 && row + 1 >= y && row <= y + 1 && tile + 1 >= first && tile <= first + count
                    };
                    prop_assert_eq!(occupied.is_empty_around(y, first, count), !(0..image.len()).any(set));
                }
            }
        }
    }

    #[test]
    fn squeeze_and_excitation_is_the_same_bits_as_its_scalar_twin(
        (size, middle, down, up, image) in (1usize..40, 1usize..4, 1usize..6, 1usize..9).prop_flat_map(|(c, m, h, w)|
            (Just([h, w, c]), Just(m), values(c * m), values(c * m), values(h * w * c))),
    ) {
        let channels = size[2];
        let weights = |w: &[f32], n: usize| -> Vec<Vec<f32>> { w.chunks(n).map(<[f32]>::to_vec).collect() };
        let map = FeatureMap::from_pixels(size, 0, &image).unwrap();
        let mean = naive::frames::global_average(&naive::frames::Image::of(map.view()));
        let bias = |n: usize| vec![0.0; n];
        let squeezed =
            naive::dense(&[mean], &weights(&down, channels), &bias(middle), Activation::Relu);
        let scale = naive::dense(&[squeezed], &weights(&up, middle), &bias(channels), Activation::Sigmoid);
        let expected: Vec<f32> = image.iter().enumerate().map(|(i, v)| v * scale[i % channels]).collect();
        let block = SqueezeExcite::new(channels, middle, &down, &up).unwrap();
        let mut scratch = SqueezeScratch::default();
        for isa in Isa::available() {
            let mut out = FeatureMap::zeros(size[0], size[1], channels, 1).unwrap();
            block.run(isa, map.view(), out.band(), &mut scratch).unwrap();
            prop_assert_eq!(
                bits(&naive::frames::Image::of(out.view()).values), bits(&expected), "{}", isa.name());
        }
    }
}

#[test]
fn weights_of_other_sizes_and_weights_that_are_not_finite_are_refused() {
    let weight = vec![0.0; 54];
    assert!(PlanarConv3x3::new([2, 1], 2, &weight, None, false).is_ok());
    assert!(PlanarConv3x3::new([2, 1], 2, &weight[1..], None, false).is_err());
    assert!(PlanarConv3x3::new([0, 0], 2, &[], None, false).is_err());
    assert!(PlanarConv3x3::new([2, 1], 2, &weight, Some(&[0.0, f32::NAN]), false).is_err());
    let lstm = |weight_ih: &[f32], inputs| {
        Lstm::new(&LstmParts {
            inputs,
            hidden: 1,
            weight_ih,
            weight_hh: &[0.0; 4],
            bias_ih: None,
            bias_hh: None,
            squash: Squash::Tanh,
        })
    };
    assert!(lstm(&[0.0; 8], 2).is_ok() && lstm(&[0.0; 8], 1).is_err() && lstm(&[], 0).is_err());
    assert!(lstm(&[f32::INFINITY; 4], 1).is_err());
}

#[test]
fn weights_spread_over_an_image_give_the_dense_layer_of_its_values() {
    let image = Planes::from_values(2, 3, 17, &(0..102).map(|v| v as f32).collect::<Vec<_>>());
    let weight: Vec<f32> = (0..204).map(|v| (v % 7) as f32).collect();
    let spread = image.spread(&weight);
    let x: Vec<f32> = image.lanes().iter().flat_map(|l| l.0).collect();
    for (spread, weight) in spread.chunks(x.len()).zip(weight.chunks(102)) {
        let got: f32 = spread.iter().zip(&x).map(|(w, x)| w * x).sum();
        let expected: f32 = weight.iter().enumerate().map(|(i, w)| w * i as f32).sum();
        assert_eq!(got, expected);
    }
}
