//! Scalar twins for the tests, in addition to those of [`meissner_kernels::naive`].
//!
//! Images are (channels, height, width). Sizes that do not fit lead to panics.

pub(crate) mod frames;

pub(crate) use meissner_kernels::naive::*;
use meissner_kernels::{GraphRow, LstmParts, PointNetParts, Squash};

/// One row of a `PointNet` block; `x(j, c)` is channel c of row j, and `own` is the row itself.
pub(crate) fn pointnet_row(
    parts: &PointNetParts,
    row: &GraphRow<'_>,
    x: impl Fn(usize, usize) -> f32,
    own: usize,
    skip: Option<&[f32]>,
) -> Vec<f32> {
    let mut read: Vec<(usize, [f32; 3])> = vec![(own, [0.0; 3])];
    read.extend(row.neighbours.iter().zip(row.offsets).map(|(n, &offset)| (n.row as usize, offset)));
    let (scale, shift) = parts.norm.clone().unwrap_or((vec![1.0; parts.outputs], vec![0.0; parts.outputs]));
    let output = |o: usize| {
        let weight = &parts.weight[o * (parts.inputs + 3)..][..parts.inputs + 3];
        let mut y = 0.0f32;
        for &(row, offset) in &read {
            let mut sum = parts.bias[o];
            for (c, w) in weight[..parts.inputs].iter().enumerate() {
                sum = x(row, c).mul_add(*w, sum);
            }
            for (d, w) in offset.iter().zip(&weight[parts.inputs..]) {
                sum = d.mul_add(*w, sum);
            }
            if sum > y || sum.is_nan() {
                y = sum;
            }
        }
        let y = y.mul_add(scale[o], shift[o]);
        skip.map_or(y, |skip| y + skip[o])
    };
    (0..parts.outputs).map(output).collect()
}

/// The points that `Nearby::find` finds, ascending, however many.
pub(crate) fn nearby(
    weights: [f32; 3],
    points: [&[f32]; 3],
    place: [f32; 3],
    except: usize,
    most: usize,
    guess: f32,
) -> Option<Vec<u32>> {
    let term = |d: usize, i: usize| {
        let difference = points[d][i] - place[d];
        difference * difference * weights[d]
    };
    let distances: Vec<(u32, f32)> = (0..points[0].len())
        .filter(|&i| i != except)
        .map(|i| (i as u32, (term(0, i) + term(1, i)) + term(2, i)))
        .collect();
    let within = |bound: f32| distances.iter().filter(move |(_, e)| *e <= bound).map(|(i, _)| *i);
    let bound =
        (0..16).map(|l| guess * (0.4 + 0.08 * l as f32)).find(|&bound| within(bound).count() >= most)?;
    Some(within(bound * (1.0 + 1.0 / 262_144.0)).collect())
}

/// Whether `replace_rows_beyond` stores `new`: not within `tolerance`
/// of `old`.
pub(crate) fn replaced_beyond(tolerance: f32, new: &[f32], old: &[f32]) -> bool {
    let near = |(new, old): (&f32, &f32)| new.to_bits() == old.to_bits() || (new - old).abs() <= tolerance;
    !new.iter().zip(old).all(near)
}

/// One step of an LSTM cell; replaces `h` and `c`.
pub(crate) fn lstm(parts: &LstmParts<'_>, x: &[f32], h: &mut [f32], c: &mut [f32]) {
    let hidden = parts.hidden;
    let gates: Vec<f32> = (0..4 * hidden)
        .map(|row| {
            let mut acc = [0.0f32; 4];
            for (k, x) in x.iter().enumerate() {
                acc[k % 4] = x.mul_add(parts.weight_ih[row * parts.inputs + k], acc[k % 4]);
            }
            for (k, h) in h.iter().enumerate() {
                acc[k % 4] = h.mul_add(parts.weight_hh[row * hidden + k], acc[k % 4]);
            }
            let bias = parts.bias_ih.map_or(0.0, |b| b[row]) + parts.bias_hh.map_or(0.0, |b| b[row]);
            ((acc[0] + acc[1]) + (acc[2] + acc[3])) + (bias + 0.0)
        })
        .collect();
    for j in 0..hidden {
        let gates = std::array::from_fn(|gate| gates[gate * hidden + j]);
        (c[j], h[j]) = lstm_update(gates, None, parts.squash, c[j]);
    }
}

/// 3 x 3 convolution with padding 1 of `channels` planes; `weight` is (outputs, channels, 3, 3).
pub(crate) fn planar_conv(
    (channels, height, width): (usize, usize, usize),
    image: &[f32],
    weight: &[f32],
    bias: &[f32],
    relu: bool,
) -> Vec<f32> {
    let pixel = |c: usize, y: usize, x: usize| {
        let inside = (1..=height).contains(&y) && (1..=width).contains(&x);
        if inside { image[(c * height + y - 1) * width + x - 1] } else { 0.0 }
    };
    let mut out = Vec::new();
    for (o, bias) in bias.iter().enumerate() {
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mut sum = 0.0;
            for tap in 0..channels * 9 {
                let (c, dy, dx) = (tap / 9, tap / 3 % 3, tap % 3);
                sum = weight[o * channels * 9 + tap].mul_add(pixel(c, y + dy, x + dx), sum);
            }
            let y = sum + (bias + 0.0);
            out.push(if relu && y < 0.0 { 0.0 } else { y });
        }
    }
    out
}

/// One step of a convolutional LSTM cell over `size` = (height, width); replaces `h` and `c`.
pub(crate) fn planar_conv_lstm(
    size: (usize, usize),
    (weight, bias): (&[f32], &[f32]),
    by: Squash,
    x: &[f32],
    h: &mut [f32],
    c: &mut [f32],
) {
    let both = [x, h].concat();
    let gates = planar_conv((both.len() / (size.0 * size.1), size.0, size.1), &both, weight, bias, false);
    let count = c.len();
    for j in 0..count {
        let gates = std::array::from_fn(|gate| gates[gate * count + j]);
        (c[j], h[j]) = lstm_update(gates, None, by, c[j]);
    }
}

/// The largest value of each 2 x 2 window; NaN if any of them is.
pub(crate) fn maximum_pool((channels, height, width): (usize, usize, usize), image: &[f32]) -> Vec<f32> {
    let mut out = Vec::new();
    for (c, y) in (0..channels).flat_map(|c| (0..height / 2).map(move |y| (c, y))) {
        for x in 0..width / 2 {
            let window = (0..4).map(|i| image[(c * height + 2 * y + i / 2) * width + 2 * x + i % 2]);
            out.push(window.fold(f32::NEG_INFINITY, |m, v| if v > m || v.is_nan() { v } else { m }) + 0.0);
        }
    }
    out
}

/// The mean of each `size` x `size` window.
pub(crate) fn average_pool(
    (channels, height, width): (usize, usize, usize),
    image: &[f32],
    size: usize,
) -> Vec<f32> {
    let mut out = Vec::new();
    for (c, y) in (0..channels).flat_map(|c| (0..height / size).map(move |y| (c, y))) {
        for x in 0..width / size {
            let pixel = |dy: usize, dx: usize| image[(c * height + y * size + dy) * width + x * size + dx];
            let column = |dx: usize| (1..size).fold(pixel(0, dx), |sum, dy| sum + pixel(dy, dx));
            out.push((0..size).fold(0.0, |sum, dx| sum + column(dx)) / (size * size) as f32);
        }
    }
    out
}
