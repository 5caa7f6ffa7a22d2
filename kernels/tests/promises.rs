//! Promises of kernels besides their bits: known answers, bands, errors, refusals; impossible
//! tensor sizes do not overflow.

use meissner_kernels::{
    Activation, Conv1x1, Conv3x3, ConvParts, ConvScratch, Dense, FeatureMap, Isa, KernelError, Kn2rowConv3x3,
    Lstm, LstmParts, Matrix, PlanarConv3x3, PlanarConvLstm, Planes, PointNetConv, PointNetParts, Region,
    SplineConv, SplineParts, Squash, SqueezeExcite, TileRegion, TransposedConv2x2, WinogradConv3x3,
    WinogradTile, max_pool_2x2, planar_average_pool, planar_max_pool, pointnet_multiply_adds,
    spline_multiply_adds,
};

/// Numbers in -1..1 without a pattern.
fn values(n: usize) -> Vec<f32> {
    let mut state = 1u32;
    let next = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..n).map(next).collect()
}

fn parts(inputs: usize, outputs: usize, weight: Vec<f32>) -> ConvParts {
    ConvParts { inputs: vec![inputs], outputs, weight, ..ConvParts::default() }
}

fn random_layer(inputs: usize, outputs: usize) -> ConvParts {
    parts(inputs, outputs, values(9 * inputs * outputs))
}

fn random_map(size: [usize; 3]) -> FeatureMap {
    FeatureMap::from_pixels(size, 1, &values(size.iter().product())).unwrap()
}

fn all_values(map: &FeatureMap) -> Vec<f32> {
    let pixels = (0..map.height()).flat_map(|y| (0..map.width()).map(move |x| (y, x)));
    pixels.flat_map(|(y, x)| map.pixel(y, x).to_vec()).collect()
}

#[test]
fn a_kernel_of_ones_counts_the_pixels_around() {
    let conv = Conv3x3::new(&parts(1, 1, vec![1.0; 9])).unwrap();
    let input = FeatureMap::from_pixels([3, 4, 1], 1, &[1.0; 12]).unwrap();
    let mut out = FeatureMap::zeros(3, 4, 1, 0).unwrap();
    conv.run(Isa::best(), &[input.view()], Region::all(3, 4), out.band()).unwrap();
    assert_eq!(all_values(&out), [4.0, 6.0, 6.0, 4.0, 6.0, 9.0, 9.0, 6.0, 4.0, 6.0, 6.0, 4.0]);
}

#[test]
fn a_kernels_first_place_is_the_pixel_up_and_left() {
    let mut weight = vec![0.0; 9];
    weight[0] = 1.0;
    let input = FeatureMap::from_pixels([2, 2, 1], 1, &[1.0, 2.0, 3.0, 4.0]).unwrap();
    let mut out = FeatureMap::zeros(2, 2, 1, 0).unwrap();
    let conv = Conv3x3::new(&parts(1, 1, weight)).unwrap();
    conv.run(Isa::best(), &[input.view()], Region::all(2, 2), out.band()).unwrap();
    assert_eq!(all_values(&out), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn a_transposed_convolution_paints_its_kernel_at_each_pixel() {
    let conv = TransposedConv2x2::new(&parts(1, 1, vec![1.0, 2.0, 3.0, 4.0])).unwrap();
    let input = FeatureMap::from_pixels([1, 2, 1], 0, &[1.0, 10.0]).unwrap();
    let mut out = FeatureMap::zeros(2, 4, 1, 0).unwrap();
    conv.run(Isa::best(), &[input.view()], Region::all(1, 2), out.band()).unwrap();
    assert_eq!(all_values(&out), [1.0, 2.0, 10.0, 20.0, 3.0, 4.0, 30.0, 40.0]);
}

#[test]
fn a_batch_norm_multiplies_the_sum_and_the_bias() {
    let mut layer = parts(1, 1, vec![0.0; 9]);
    layer.weight[4] = 3.0;
    layer.bias = Some(vec![2.0]);
    layer.norm = Some((vec![0.5], vec![-4.0]));
    let input = FeatureMap::from_pixels([1, 2, 1], 1, &[1.0, 5.0]).unwrap();
    let mut out = FeatureMap::zeros(1, 2, 1, 0).unwrap();
    for (relu, expected) in [(false, [-1.5, 4.5]), (true, [0.0, 4.5])] {
        layer.relu = relu;
        let conv = Conv3x3::new(&layer).unwrap();
        conv.run(Isa::best(), &[input.view()], Region::all(1, 2), out.band()).unwrap();
        assert_eq!(all_values(&out), expected);
    }
}

#[test]
fn bands_written_apart_make_the_whole() {
    let conv = Conv3x3::new(&random_layer(5, 33)).unwrap();
    let input = random_map([9, 7, 5]);
    let views = [input.view()];
    let (mut whole, mut apart) =
        (FeatureMap::zeros(9, 7, 33, 1).unwrap(), FeatureMap::zeros(9, 7, 33, 1).unwrap());
    conv.run(Isa::best(), &views, Region::all(9, 7), whole.band()).unwrap();
    let (upper, rest) = apart.band().split_at_row(4).unwrap();
    let (middle, lower) = rest.split_at_row(5).unwrap();
    std::thread::scope(|scope| {
        for band in [upper, middle, lower] {
            let (conv, views) = (&conv, &views);
            scope.spawn(move || {
                let rows = band.rows();
                let region = Region { y: rows.start, x: 0, height: rows.len(), width: 7 };
                conv.run(Isa::best(), views, region, band).unwrap();
            });
        }
    });
    assert_eq!(all_values(&apart), all_values(&whole));
    assert!(all_values(&whole).iter().any(|&v| v != 0.0));
}

#[test]
fn what_does_not_fit_is_refused() {
    let isa = Isa::best();
    let conv = Conv3x3::new(&random_layer(2, 3)).unwrap();
    let input = random_map([4, 5, 2]);
    let mut out = FeatureMap::zeros(4, 5, 3, 0).unwrap();
    let beyond = Region { y: 3, x: 0, height: 2, width: 5 };
    let error = conv.run(isa, &[input.view()], beyond, out.band()).unwrap_err();
    assert!(matches!(error, KernelError::Region { height: 4, width: 5, .. }), "{error}");
    let far = Region { y: usize::MAX, x: 0, height: 2, width: 5 };
    assert!(conv.run(isa, &[input.view()], far, out.band()).is_err());
    let all = Region::all(4, 5);
    let (_, lower) = out.band().split_at_row(2).unwrap();
    assert!(matches!(conv.run(isa, &[input.view()], all, lower), Err(KernelError::Region { .. })));
    let error = conv.run(isa, &[], all, out.band()).unwrap_err();
    assert!(matches!(error, KernelError::Length { expected: 1, found: 0, .. }), "{error}");
    let error = conv.run(isa, &[random_map([4, 5, 3]).view()], all, out.band()).unwrap_err();
    assert!(matches!(error, KernelError::Shape { expected: [4, 5, 2], found: [4, 5, 3], .. }), "{error}");
    let bare = FeatureMap::zeros(4, 5, 2, 0).unwrap();
    let error = conv.run(isa, &[bare.view()], all, out.band()).unwrap_err();
    assert!(matches!(error, KernelError::Size { found: 0, .. }), "{error}");
    assert!(input.view().channels(1, 2).is_err() && input.view().channels(0, 0).is_err());
    assert!(out.band().split_at_row(5).is_err());
    assert!(FeatureMap::zeros(4, 0, 2, 0).is_err() && FeatureMap::zeros(4, 5, 2, 2).is_err());
    assert!(FeatureMap::zeros(usize::MAX, 2, 2, 1).is_err());
}

#[test]
fn parameters_that_do_not_fit_are_refused() {
    let good = random_layer(2, 3);
    let short = ConvParts { weight: vec![0.0; 53], ..good.clone() };
    let error = Conv3x3::new(&short).unwrap_err();
    assert!(matches!(error, KernelError::Length { expected: 54, found: 53, .. }), "{error}");
    let mut not_finite = good.clone();
    not_finite.weight[7] = f32::NAN;
    assert!(matches!(Conv3x3::new(&not_finite), Err(KernelError::NotFinite { index: 7, .. })));
    for inputs in [vec![], vec![1, 1, 1], vec![2, 0]] {
        let wrong = ConvParts { inputs, ..good.clone() };
        assert!(matches!(Conv3x3::new(&wrong), Err(KernelError::Size { .. })));
    }
}

#[test]
fn a_region_that_cuts_through_a_tile_is_refused() {
    let conv = WinogradConv3x3::new(&random_layer(2, 3), WinogradTile::Four).unwrap();
    let (input, mut out) = (random_map([9, 8, 2]), FeatureMap::zeros(9, 8, 3, 0).unwrap());
    let mut run = |y, height| {
        let region = Region { y, x: 4, height, width: 4 };
        conv.run(Isa::best(), &[input.view()], region, out.band(), &mut ConvScratch::default())
    };
    assert!(run(0, 4).is_ok() && run(4, 5).is_ok() && run(8, 1).is_ok());
    assert!(run(2, 4).is_err() && run(0, 2).is_err() && run(4, 3).is_err());
}

#[test]
fn winograd_stays_close_to_the_direct_convolution() {
    let (size, channels) = ([16, 20], 128);
    let layer = random_layer(channels, channels);
    let input = random_map([size[0], size[1], channels]);
    let region = Region::all(size[0], size[1]);
    let mut direct = FeatureMap::zeros(size[0], size[1], channels, 0).unwrap();
    Conv3x3::new(&layer).unwrap().run(Isa::best(), &[input.view()], region, direct.band()).unwrap();
    let direct = all_values(&direct);
    let largest = direct.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    let mut scratch = ConvScratch::default();
    for (tile, bound) in [(WinogradTile::Two, 5e-6), (WinogradTile::Four, 5e-5)] {
        let mut out = FeatureMap::zeros(size[0], size[1], channels, 0).unwrap();
        let conv = WinogradConv3x3::new(&layer, tile).unwrap();
        conv.run(Isa::best(), &[input.view()], region, out.band(), &mut scratch).unwrap();
        let difference =
            direct.iter().zip(all_values(&out)).fold(0.0f32, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(difference > 0.0 && difference / largest < bound, "{tile:?}: {}", difference / largest);
    }
}

#[test]
fn a_maximum_over_a_window_that_holds_nan_is_nan_wherever_it_is() {
    for place in 0..4 {
        let value = |y: usize, x: usize, c: usize| {
            if 2 * y + x == place && c == 1 { f32::NAN } else { (y + x + c) as f32 - 2.0 }
        };
        let image: Vec<f32> = (0..4 * 19).map(|i| value(i / 38, i / 19 % 2, i % 19)).collect();
        let map = FeatureMap::from_pixels([2, 2, 19], 0, &image).unwrap();
        let planes = Planes::from_values(1, 2, 2, &[0, 1, 2, 3].map(|i| value(i / 2, i % 2, 1)));
        for isa in Isa::available() {
            let mut out = FeatureMap::zeros(1, 1, 19, 0).unwrap();
            max_pool_2x2(isa, map.view(), Region::all(1, 1), out.band()).unwrap();
            let nan: Vec<usize> = (0..19).filter(|&c| out.pixel(0, 0)[c].is_nan()).collect();
            assert_eq!(nan, [1], "place {place}, {}", isa.name());
        }
        let mut out = Planes::zeros(1, 1, 1);
        planar_max_pool(&planes, &mut out);
        assert!(out.values().all(f32::is_nan), "place {place}");
    }
}

/// Products of two of them overflow, one to 0 and one to 1.
const LARGE: [usize; 4] =
    [usize::MAX, usize::MAX / 2 + 1, 1 << (usize::BITS / 2), 1 << (usize::BITS / 2 - 1)];

fn refused<T>(made: Result<T, KernelError>) -> bool {
    matches!(made, Err(KernelError::Length { .. } | KernelError::Size { .. }))
}

#[test]
fn dense_layers_and_cells_of_sizes_that_no_tensor_has_are_refused() {
    for a in LARGE {
        for b in LARGE.into_iter().chain([0, 1]) {
            for (segments, channels, outputs) in [(a, b, 1), (1, a, b), (b, 1, a), (a, a, b)] {
                let dense = Dense::new(segments, channels, outputs, &[], None, Activation::Identity);
                assert!(refused(dense), "{segments} x {channels} -> {outputs}");
            }
            for (inputs, hidden) in [(a, b), (b, a)] {
                let parts = LstmParts {
                    inputs,
                    hidden,
                    weight_ih: &[],
                    weight_hh: &[],
                    bias_ih: None,
                    bias_hh: None,
                    squash: Squash::Tanh,
                };
                assert!(refused(Lstm::new(&parts)), "{inputs} -> {hidden}");
                let planar = PlanarConvLstm::new(inputs, hidden, &[], None, Squash::Tanh);
                assert!(refused(planar), "{inputs} -> {hidden}");
                assert!(refused(SqueezeExcite::new(inputs, hidden, &[], &[])), "{inputs} by {hidden}");
                let spline =
                    SplineParts { inputs, outputs: hidden, kernel: [1; 3], ..SplineParts::default() };
                assert!(refused(SplineConv::new(&spline)), "{inputs} -> {hidden}");
                let pointnet = PointNetParts { inputs, outputs: hidden, ..PointNetParts::default() };
                assert!(refused(PointNetConv::new(&pointnet)), "{inputs} -> {hidden}");
            }
        }
    }
}

#[test]
fn convolutions_of_sizes_that_no_tensor_has_are_refused() {
    for a in LARGE {
        for inputs in [vec![a], vec![a, a], vec![1, a], vec![a, 1], vec![]] {
            for outputs in LARGE.into_iter().chain([1]) {
                let parts = ConvParts { inputs: inputs.clone(), outputs, ..ConvParts::default() };
                assert!(refused(Conv3x3::new(&parts)), "{inputs:?} -> {outputs}");
                assert!(refused(Conv1x1::new(&parts)), "{inputs:?} -> {outputs}");
                assert!(refused(TransposedConv2x2::new(&parts)), "{inputs:?} -> {outputs}");
                assert!(refused(WinogradConv3x3::new(&parts, WinogradTile::Two)), "{inputs:?} -> {outputs}");
                assert!(refused(Kn2rowConv3x3::new(&parts)), "{inputs:?} -> {outputs}");
            }
        }
        for channels in [[a, a], [a, 0], [1, a], [a, 1]] {
            for outputs in LARGE.into_iter().chain([1]) {
                let conv = PlanarConv3x3::new(channels, outputs, &[], None, false);
                assert!(refused(conv), "{channels:?} -> {outputs}");
            }
        }
        assert!(refused(FeatureMap::zeros(a, a, a, 1)) && refused(FeatureMap::zeros(a, 1, 1, 1)), "{a}");
    }
}

#[test]
fn bytes_are_foreseen_as_they_are_taken() {
    for (channels, height, width) in [(1, 1, 1), (3, 5, 16), (4, 7, 31), (2, 3, 33)] {
        let planes = Planes::zeros(channels, height, width).bytes();
        assert_eq!(Planes::bytes_of(channels, height, width), planes as u128);
        for halo in [0, 1] {
            let map = FeatureMap::zeros(height, width, channels, halo).expect("a map").bytes();
            assert_eq!(FeatureMap::bytes_of(height, width, channels, halo), map as u128);
        }
        let weight = vec![0.5; 4 * channels * 2 * channels * 9];
        let cell = PlanarConvLstm::new(channels, channels, &weight, None, Squash::Tanh).expect("a cell");
        assert_eq!(cell.state_bytes(height, width), cell.state(height, width).bytes() as u128);
        let (inputs, hidden) = (height, width);
        let parts = LstmParts {
            inputs,
            hidden,
            weight_ih: &vec![0.5; 4 * hidden * inputs],
            weight_hh: &vec![0.5; 4 * hidden * hidden],
            bias_ih: None,
            bias_hh: None,
            squash: Squash::Tanh,
        };
        let lstm = Lstm::new(&parts).expect("a cell");
        assert_eq!(lstm.state_bytes(), lstm.state().bytes());
    }
    assert!(Planes::bytes_of(usize::MAX, 1, 1) > 1 << usize::BITS);
    assert!(FeatureMap::bytes_of(1 << (usize::BITS - 24), 1, 1, 1) > 1 << (usize::BITS - 21));
}

#[test]
fn what_has_no_values_has_no_rows_and_no_windows() {
    assert_eq!((Matrix::zeros(3, 0).rows(), Matrix::zeros(0, 3).rows()), (0, 0));
    let mut none = Planes::zeros(1, 0, 0);
    planar_average_pool(&Planes::zeros(1, 4, 4), usize::MAX, &mut vec![], &mut none);
    assert_eq!(none.values().count(), 0);
    let all = TileRegion { rows: 0..usize::MAX, tiles: 0..usize::MAX };
    assert!(Planes::zeros(2, 3, 20).is_zero_around(&all));
}

#[test]
fn costs_beyond_all_numbers_saturate() {
    assert_eq!(spline_multiply_adds([usize::MAX; 3], usize::MAX, usize::MAX, true, usize::MAX), usize::MAX);
    assert_eq!(spline_multiply_adds([2; 3], 3, 5, true, 4), 4 * 8 * 3 + (8 + 1) * 3 * 5);
    assert_eq!(pointnet_multiply_adds(usize::MAX, usize::MAX, usize::MAX), usize::MAX);
    assert_eq!(pointnet_multiply_adds(3, 5, 4), (4 + 1) * (3 + 3) * 5);
}
