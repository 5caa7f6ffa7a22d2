//! Recurrent cells (Hochreiter and Schmidhuber 1997; Shi et al. 2015), with gates in the order i, f, g, o:
//!
//! ```text
//! i = sigmoid(i), f = sigmoid(f), o = sigmoid(o)      with peepholes: of i + Vi c, f + Vf c, o + Vo c
//! c = f c + i act(g)
//! h = o act(c)
//! ```
//!
//! Every peephole reads the cell before the step. A memory is the cells followed by the outputs; empty means zeros.

use meissner_kernels::Activation;

use super::dense;
use super::image::{Image, conv};
use crate::activation::{activated, sigmoid};

/// One step of `cells` cells whose gates are the quarters of `gates`; returns the outputs.
fn step(gates: &[f64], peepholes: Option<&[f32]>, activation: Activation, memory: &mut [f64]) -> Vec<f64> {
    let count = gates.len() / 4;
    let (cells, shown) = memory.split_at_mut(count);
    for j in 0..count {
        let peep = |gate: usize| peepholes.map_or(0.0, |v| f64::from(v[gate * count + j]) * cells[j]);
        let (i, f) = (sigmoid(gates[j] + peep(0)), sigmoid(gates[count + j] + peep(1)));
        let o = sigmoid(gates[3 * count + j] + peep(2));
        cells[j] = f * cells[j] + i * activated(activation, gates[2 * count + j]);
        shown[j] = o * activated(activation, cells[j]);
    }
    shown.to_vec()
}

/// One step of an LSTM of `hidden` cells; weights (4 hidden, inputs), (4 hidden, hidden), (4 hidden).
pub(super) fn lstm(
    x: &[f64],
    hidden: usize,
    [weight_ih, weight_hh, bias]: [&[f32]; 3],
    memory: &mut Vec<f64>,
) -> Vec<f64> {
    memory.resize(2 * hidden, 0.0);
    let from_x = dense(x, 4 * hidden, weight_ih, Some(bias));
    let from_h = dense(&memory[hidden..], 4 * hidden, weight_hh, None);
    let gates: Vec<f64> = from_x.iter().zip(&from_h).map(|(a, b)| a + b).collect();
    step(&gates, None, Activation::Tanh, memory)
}

/// One step of a convolutional LSTM of `hidden` channels; weight (4 hidden, inputs + hidden, 3, 3), bias (4 hidden),
/// peepholes (3, hidden, height, width).
pub(super) fn conv_lstm(
    x: &Image,
    hidden: usize,
    (weight, bias, peepholes): (&[f32], &[f32], Option<&[f32]>),
    activation: Activation,
    memory: &mut Vec<f64>,
) -> Image {
    let [_, height, width] = x.size;
    let size = [hidden, height, width];
    let cells = hidden * height * width;
    memory.resize(2 * cells, 0.0);
    let shown = Image::new(size, memory[cells..].to_vec());
    let gates = conv(&x.beside(&shown), 3, 4 * hidden, weight, Some(bias), false);
    Image::new(size, step(&gates.values, peepholes, activation, memory))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_gates_add_up_what_comes() {
        // i, f and o are 1 at a bias of 1000, and g is the input: c = tanh(x) after one step, twice that after two.
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
}
