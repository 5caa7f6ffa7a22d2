//! Sizes that no tensor has are refused like any other that does not fit, and do not overflow.

use meissner_kernels::{
    Activation, Conv1x1, Conv3x3, ConvParts, Dense, FeatureMap, KernelError, Kn2rowConv3x3, Lstm, LstmParts,
    Matrix, PlanarConv3x3, PlanarConvLstm, Planes, PointNetConv, PointNetParts, SplineConv, SplineParts,
    Squash, SqueezeExcite, TileRegion, TransposedConv2x2, WinogradConv3x3, WinogradTile, planar_average_pool,
    pointnet_multiply_adds, spline_multiply_adds,
};

/// Products of two of them overflow, one to 0 and one to 1.
const LARGE: [usize; 4] = [usize::MAX, usize::MAX / 2 + 1, 1 << 32, 1 << 31];

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
    assert!(Planes::bytes_of(usize::MAX, 1, 1) > 1 << 64 && FeatureMap::bytes_of(1 << 40, 1, 1, 1) > 1 << 43);
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
