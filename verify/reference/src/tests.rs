//! Layers and differences by hand.

use meissner_kernels::{Activation, PointNetConv, PointNetParts, SplineConv, SplineParts};

use crate::convolution::{BatchNorm, Convolution, Edge, hat};
use crate::difference::{Difference, MAX_ULP, ulps};
use crate::frames::{Image, conv, lstm, pooled, sigmoid, step, up_conv};

fn block(kernel: [usize; 3], weight: Vec<f32>, elu: bool) -> Convolution {
    let parts = SplineParts {
        inputs: 1,
        outputs: 1,
        kernel,
        weight,
        root: None,
        bias: Some(vec![0.25]),
        norm: Some((vec![2.0], vec![1.0])),
        elu,
    };
    Convolution::new(&SplineConv::new(&parts).expect("sizes fit").into())
}

#[test]
fn a_row_of_two_edges_is_what_a_hand_computes() {
    let spline = block([2, 1, 1], vec![1.0, 3.0], false);
    let edges = [Edge { row: 0, offset: [-0.5, -1.0, -1.0] }, Edge { row: 1, offset: [1.0, -1.0, -1.0] }];
    // (2 (0.75 + 0.25 3) + 4 3) / 2 + 0.25 = 7.75, times 2, plus 1, plus the skip.
    let row = spline.row(&[vec![2.0], vec![4.0]], 0, &edges, Some(&[0.5]));
    assert_eq!(row, [17.0]);
}

#[test]
fn a_row_without_edges_is_its_bias() {
    assert_eq!(block([2, 1, 1], vec![1.0, 3.0], false).row(&[vec![2.0]], 0, &[], None), [1.5]);
}

#[test]
fn a_pointnet_row_is_what_a_hand_computes() {
    let parts = PointNetParts {
        inputs: 1,
        outputs: 2,
        weight: vec![1.0, 10.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0],
        bias: vec![0.5, -8.0],
        norm: Some((vec![2.0; 2], vec![1.0; 2])),
    };
    let conv = Convolution::new(&PointNetConv::new(&parts).expect("sizes fit").into());
    let edges = [Edge::new(0, [0.5, 0.0, 0.0], 0.25), Edge::new(1, [-0.5, 0.0, 0.0], 0.25)];
    // First channel: 2 + 20 + 0.5 from row 0 exceeds 0 and row 1; second: all are below 0.
    assert_eq!(conv.row(&[vec![2.0], vec![4.0]], 1, &edges, None), [46.0, 1.0]);
    assert_eq!(conv.row(&[vec![2.0], vec![4.0]], 1, &[], Some(&[1.0, 0.0])), [11.0, 1.0]);
}

#[test]
fn the_hats_of_an_axis_sum_to_one() {
    for size in 1..6 {
        for u in [0.0, 0.1, 0.25, 0.5, 0.99, 1.0] {
            let sum: f64 = (0..size).map(|i| hat(u, i, size)).sum();
            assert!((sum - 1.0).abs() < 1e-15, "size {size} at {u}: {sum}");
        }
    }
}

#[test]
fn unfolded_batch_norm_is_the_folded_one() {
    let mut spline = block([1, 1, 1], vec![1.0], true);
    let edge = Edge { row: 0, offset: [0.0; 3] };
    let folded = spline.row(&[vec![0.75]], 0, &[edge], None);
    // (x - 1) / sqrt(0.25) + 3 = 2 x + 1.
    spline.norm =
        BatchNorm { gamma: vec![1.0], beta: vec![3.0], mean: vec![1.0], variance: vec![0.25], epsilon: 0.0 };
    assert_eq!(spline.row(&[vec![0.75]], 0, &[edge], None), folded);
    assert_eq!(folded, [3.0]);
}

#[test]
fn differences_are_relative_to_the_largest_magnitude() {
    let mut difference = Difference::default();
    difference.add_all(&[1.0, 2.5], &[1.0, 2.0]);
    assert_eq!((difference.absolute, difference.relative(), difference.values), (0.5, 0.25, 2));
    assert_eq!(difference.rms(), (0.125f64).sqrt());
}

#[test]
fn what_is_not_finite_is_counted_and_not_measured() {
    let mut difference = Difference::default();
    difference.add_all(&[f32::NAN, f32::INFINITY, 1.0], &[1.0, 1e60, 1.0]);
    assert_eq!((difference.not_numbers, difference.infinite, difference.absolute), (1, 1, 0.0));
    assert_eq!(difference.relative(), 0.0);
}

#[test]
fn the_nearest_value_has_no_error_and_its_neighbour_about_one() {
    let third = 1.0 / 3.0;
    let nearest = third as f32;
    assert_eq!(ulps(nearest, third), 0.0);
    let next = f32::from_bits(nearest.to_bits() + 1);
    assert!((0.5..1.5).contains(&ulps(next, third)), "{}", ulps(next, third));
}

#[test]
fn subnormal_values_are_measured_by_the_smallest_distance() {
    assert_eq!(ulps(0.0, f64::from(f32::from_bits(3))), 3.0);
    assert_eq!(ulps(f32::from_bits(1), f64::from(f32::from_bits(3))), 2.0);
}

#[test]
fn what_is_not_a_number_on_one_side_is_infinitely_wrong() {
    assert_eq!(ulps(f32::NAN, 1.0), f64::INFINITY);
    assert_eq!(ulps(1.0, f64::NAN), f64::INFINITY);
    assert_eq!(ulps(f32::NAN, f64::NAN), 0.0);
}

#[test]
fn the_largest_value_and_infinity_are_as_far_apart_as_the_largest_two() {
    assert_eq!(MAX_ULP, 2f64.powi(104));
    assert_eq!(ulps(f32::INFINITY, f64::from(f32::MAX)), f64::INFINITY);
    assert_eq!(ulps(f32::MAX, f64::from(f32::MAX) - MAX_ULP), 1.0);
}

fn image() -> Image {
    Image::new([1, 2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
}

#[test]
fn a_convolution_sees_zeros_beyond_the_border() {
    let ones = conv(&image(), 3, 1, &[1.0; 9], Some(&[0.5]), false);
    assert_eq!(ones.values, [12.5, 21.5, 16.5, 12.5, 21.5, 16.5]);
    // The first weight reads the pixel above and to the left.
    let mut first = [0.0; 9];
    first[0] = -1.0;
    assert_eq!(conv(&image(), 3, 1, &first, None, false).values, [0.0, 0.0, 0.0, 0.0, -1.0, -2.0]);
    assert_eq!(conv(&image(), 3, 1, &first, None, true).values, [0.0; 6]);
}

#[test]
fn a_transposed_convolution_doubles_the_image() {
    let up = up_conv(&Image::new([1, 1, 2], vec![1.0, 10.0]), 1, &[1.0, 2.0, 3.0, 4.0], None);
    assert_eq!(up, Image::new([1, 2, 4], vec![1.0, 2.0, 10.0, 20.0, 3.0, 4.0, 30.0, 40.0]));
}

#[test]
fn what_does_not_fill_a_window_is_left_out() {
    let largest = pooled(&image(), 2, |window| window.fold(f64::NEG_INFINITY, f64::max));
    assert_eq!(largest, Image::new([1, 1, 1], vec![5.0]));
}

#[test]
fn open_gates_add_up_what_comes() {
    // i, f and o are 1 at a bias of 1000, g is the input: c = tanh(x), then twice that.
    let bias = [1000.0, 1000.0, 0.0, 1000.0];
    let weights: [&[f32]; 3] = [&[0.0, 0.0, 1.0, 0.0], &[0.0; 4], &bias];
    let mut memory = Vec::new();
    assert_eq!(lstm(&[0.5], 1, weights, &mut memory), [0.5f64.tanh().tanh()]);
    assert_eq!(lstm(&[0.5], 1, weights, &mut memory), [(2.0 * 0.5f64.tanh()).tanh()]);
}

#[test]
fn every_peephole_sees_the_cell_before_the_step() {
    // Cell 1, all gates 0: i = sigmoid(2), f = sigmoid(3), o = sigmoid(4), g = 0.
    let mut memory = vec![1.0, 0.0];
    let shown = step(&[0.0; 4], Some(&[2.0, 3.0, 4.0]), Activation::Tanh, &mut memory);
    assert_eq!(memory[0], sigmoid(3.0));
    assert_eq!(shown, [sigmoid(4.0) * sigmoid(3.0).tanh()]);
}
