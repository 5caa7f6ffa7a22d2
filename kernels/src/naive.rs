//! Scalar twins of the kernels: the documented order, one value at a time, for comparisons bit by
//! bit. They use the platform's fused multiply-add, so that ours is checked too. Twins that only
//! the tests of this crate need are in `tests/naive.rs`.
//!
//! They check nothing: sizes that do not fit lead to panics.

use crate::dense::Activation;
use crate::elementary::{elu, sigmoid, sigmoid_quotients, tanh, tanh_quotients};
use crate::graph::Neighbour;
use crate::isa::Portable;
use crate::recurrent::Squash;
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

/// A dense layer over the concatenated rows of `x`; `weight` has a row per output.
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

fn chain(x: &[f32], weight: &[f32]) -> f32 {
    x.iter().zip(weight).fold(0.0, |sum, (x, w)| x.mul_add(*w, sum))
}

fn in_32_sums(x: &[f32], weight: &[f32]) -> f32 {
    let mut acc = [0.0; 32];
    for (i, (x, w)) in x.iter().zip(weight).enumerate() {
        acc[i % 32] = x.mul_add(*w, acc[i % 32]);
    }
    let v: Vec<f32> = (0..8).map(|i| (acc[i] + acc[i + 8]) + (acc[i + 16] + acc[i + 24])).collect();
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}

/// The sum in pairs, then the results in pairs, until one value is left.
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
