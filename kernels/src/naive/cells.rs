//! Scalar twins of cells, planar convolutions and poolings: the documented order, one value at a
//! time. Images are (channels, height, width) unless stated otherwise.

use crate::elementary::{sigmoid, sigmoid_quotients, tanh_quotients};
use crate::isa::Portable;
use crate::recurrent::{LstmParts, Squash};

/// Numerator and denominator.
fn quotient(squash: Squash, x: f32) -> [f32; 2] {
    let (above, below) = match squash {
        Squash::Tanh => tanh_quotients(Portable, [[x; 8]]),
        Squash::Sigmoid => sigmoid_quotients(Portable, [[x; 8]]),
    };
    [above[0][0], below[0][0]]
}

/// The product of two quotients, with a single division.
fn times(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] * b[0]) / (a[1] * b[1])
}

/// An element's gates i, f, g, o and weights of i, f, o on its cell; the new cell and output.
pub fn lstm_update(gates: [f32; 4], peephole: Option<[f32; 3]>, by: Squash, c: f32) -> (f32, f32) {
    let [mut i, mut f, g, mut o] = gates;
    if let Some([on_i, on_f, on_o]) = peephole {
        i = on_i.mul_add(c, i);
        f = on_f.mul_add(c, f);
        o = on_o.mul_add(c, o);
    }
    let c = sigmoid(f).mul_add(c, times(quotient(Squash::Sigmoid, i), quotient(by, g)));
    (c, times(quotient(Squash::Sigmoid, o), quotient(by, c)))
}

/// One step of an LSTM cell; replaces `h` and `c`.
pub fn lstm(parts: &LstmParts<'_>, x: &[f32], h: &mut [f32], c: &mut [f32]) {
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
pub fn planar_conv(
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
pub fn planar_conv_lstm(
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
pub fn maximum_pool((channels, height, width): (usize, usize, usize), image: &[f32]) -> Vec<f32> {
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
pub fn average_pool(
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
