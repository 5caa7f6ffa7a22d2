//! Scalar twins of the kernels: the documented order, one value at a time, for tests bit by bit.
//! They use the platform's fused multiply-add, so that ours is checked too.
//!
//! They check nothing: sizes that do not fit lead to panics.

pub mod frames;

use crate::dense::Activation;
use crate::elementary::{elu, sigmoid, sigmoid_quotients, tanh, tanh_quotients};
use crate::graph::{GraphRow, Neighbour};
use crate::isa::Portable;
use crate::pointnet::PointNetParts;
use crate::recurrent::{LstmParts, Squash};
use crate::spline::{SplineParts, locate};

/// B(e, s) of every slot of a kernel.
pub fn basis(kernel: [usize; 3], u: [f32; 3]) -> Vec<Option<f32>> {
    let axis = |d: usize| -> Vec<Option<f32>> {
        if kernel[d] == 1 {
            return vec![Some(1.0)];
        }
        let (lower, upper) = locate(u[d], kernel[d]);
        (0..kernel[d])
            .map(|i| match i {
                i if i == lower => Some(1.0 - upper),
                i if i == lower + 1 => Some(upper),
                _ => None,
            })
            .collect()
    };
    let (x, y, t) = (axis(0), axis(1), axis(2));
    let mut out = Vec::new();
    for t in &t {
        for y in &y {
            out.extend(x.iter().map(|x| Some((((*x)?) * ((*y)?)) * ((*t)?))));
        }
    }
    out
}

/// One row of a spline block; `x(j, c)` is channel c of row j.
pub fn spline_row(
    parts: &SplineParts,
    neighbours: &[Neighbour],
    x: impl Fn(usize, usize) -> f32,
    own: usize,
    skip: Option<&[f32]>,
) -> Vec<f32> {
    let SplineParts { inputs, outputs, kernel, .. } = *parts;
    let slots: usize = kernel.iter().product();
    let mut sums = vec![None; slots * inputs];
    for n in neighbours {
        for (slot, weight) in basis(kernel, n.u).into_iter().enumerate() {
            let Some(weight) = weight else { continue };
            for c in 0..inputs {
                let sum: &mut Option<f32> = &mut sums[slot * inputs + c];
                *sum = Some(weight.mul_add(x(n.row as usize, c), sum.unwrap_or(0.0)));
            }
        }
    }
    let ones = vec![1.0; outputs];
    let zeros = vec![0.0; outputs];
    let (scale, shift) = parts.norm.as_ref().map_or((&ones, &zeros), |(a, b)| (a, b));
    (0..outputs)
        .map(|o| {
            let mut acc = [0.0; 4];
            for (i, sum) in sums.iter().enumerate() {
                if let Some(sum) = sum {
                    acc[i % 4] = sum.mul_add(parts.weight[i * outputs + o], acc[i % 4]);
                }
            }
            let inverse = if neighbours.is_empty() { 0.0 } else { 1.0 / neighbours.len() as f32 };
            let mut y = ((acc[0] + acc[1]) + (acc[2] + acc[3])) * inverse;
            if let Some(root) = &parts.root {
                let mut acc = [0.0; 4];
                for c in 0..inputs {
                    acc[c % 4] = x(own, c).mul_add(root[o * inputs + c], acc[c % 4]);
                }
                y += (acc[0] + acc[1]) + (acc[2] + acc[3]);
            }
            y += parts.bias.as_ref().map_or(0.0, |b| b[o]);
            if parts.elu {
                y = elu(y);
            }
            y = y.mul_add(scale[o], shift[o]);
            skip.map_or(y, |skip| y + skip[o])
        })
        .collect()
}

/// One row of a `PointNet` block; `x(j, c)` is channel c of row j, and `own` is the row itself.
pub fn pointnet_row(
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

/// The points that [`Nearby::find`](crate::Nearby::find) finds, ascending, however many.
pub fn nearby(
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

/// A dense layer over the rows of `x` one after the other; `weight` has a row per output.
pub fn dense(x: &[Vec<f32>], weight: &[Vec<f32>], bias: &[f32], activation: Activation) -> Vec<f32> {
    let output = |(weight, bias): (&Vec<f32>, &f32)| {
        let products = x.iter().zip(weight.chunks(x[0].len()));
        let sum = match x {
            [x] => in_32_sums(x, weight),
            _ => in_pairs(&products.map(|(x, w)| chain(x, w)).collect::<Vec<_>>()),
        };
        let y = sum + bias;
        match activation {
            Activation::Relu if y < 0.0 => 0.0,
            Activation::Identity | Activation::Relu => y,
            Activation::Elu => elu(y),
            Activation::Sigmoid => sigmoid(y),
            Activation::Tanh => tanh(y),
        }
    };
    weight.iter().zip(bias).map(output).collect()
}

/// A dot product in one chain.
fn chain(x: &[f32], weight: &[f32]) -> f32 {
    x.iter().zip(weight).fold(0.0, |sum, (x, w)| x.mul_add(*w, sum))
}

/// A dot product in 32 partial sums.
fn in_32_sums(x: &[f32], weight: &[f32]) -> f32 {
    let mut acc = [0.0; 32];
    for (i, (x, w)) in x.iter().zip(weight).enumerate() {
        acc[i % 32] = x.mul_add(*w, acc[i % 32]);
    }
    let v: Vec<f32> = (0..8).map(|i| (acc[i] + acc[i + 8]) + (acc[i + 16] + acc[i + 24])).collect();
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}

/// The sum in pairs, and the results in pairs, until one is left.
fn in_pairs(sums: &[f32]) -> f32 {
    match sums {
        [sum] => *sum,
        _ => in_pairs(
            &sums
                .chunks(2)
                .map(|pair| pair.iter().copied().reduce(|a, b| a + b).unwrap_or(0.0))
                .collect::<Vec<_>>(),
        ),
    }
}

/// Whether [`replace_rows_beyond`](crate::replace_rows_beyond) stores `new`: not within `tolerance`
/// of `old`.
pub fn replaced_beyond(tolerance: f32, new: &[f32], old: &[f32]) -> bool {
    let near = |(new, old): (&f32, &f32)| new.to_bits() == old.to_bits() || (new - old).abs() <= tolerance;
    !new.iter().zip(old).all(near)
}

/// A weight rounded to bf16, by comparing it with the two nearest bf16.
pub fn bf16(value: f32) -> f32 {
    let below = value.to_bits() & 0xffff_0000;
    let candidates = [below, below + 0x1_0000].map(f32::from_bits);
    let [near, far] = candidates.map(|candidate| (f64::from(candidate) - f64::from(value)).abs());
    // If both are equally near, the one whose last bit is zero.
    let first = if near == far { below & 0x1_0000 == 0 } else { near < far };
    candidates[usize::from(!first)]
}

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
