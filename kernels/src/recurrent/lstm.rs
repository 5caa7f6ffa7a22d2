//! The LSTM cell over vectors (`PyTorch`'s `nn.LSTM`, one layer): x (I) and h, c (H) to h, c.
//!
//! gates = (Wx x + Wh h) + b with b = `bias_ih` + `bias_hh`, then the gates' update. Order: four
//! partial sums from +0, x's input k into sum k mod 4, then h's element k into sum k mod 4,
//! ascending, each product rounded once with its sum; (s0 + s1) + (s2 + s3); + b. b is never -0, so
//! a zero partial sum's sign affects nothing: terms of an x or h of zeros can be skipped.

use super::{Squash, Update};
use crate::error::{KernelError, check, check_sizes};
use crate::isa::{Isa, Simd, Task, Vector, accumulate_in_four, flat, flat_mut, flat_wide, flat_wide_mut};
use crate::lanes::{LANES, Lanes, Wide};

/// An LSTM cell's parameters, in `PyTorch`'s layout; gates in the order i, f, g, o.
#[derive(Clone, Debug)]
pub struct LstmParts<'a> {
    /// I, input values.
    pub inputs: usize,
    /// H, hidden values.
    pub hidden: usize,
    /// (4 H, I).
    pub weight_ih: &'a [f32],
    /// (4 H, H).
    pub weight_hh: &'a [f32],
    /// (4 H).
    pub bias_ih: Option<&'a [f32]>,
    /// (4 H).
    pub bias_hh: Option<&'a [f32]>,
    /// Activation of the candidate and of the output.
    pub squash: Squash,
}

/// An LSTM cell.
#[derive(Clone, Debug)]
pub struct Lstm {
    inputs: usize,
    hidden: usize,
    /// Weights in blocks of sixteen gates: (blocks, I).
    on_input: Vec<Wide>,
    /// (blocks, H).
    on_hidden: Vec<Wide>,
    bias: Vec<Wide>,
    squash: Squash,
}

/// The state of an LSTM cell, and scratch for its gates.
#[derive(Clone, Debug)]
pub struct LstmState {
    count: usize,
    hidden: Vec<Lanes>,
    cell: Vec<Lanes>,
    gates: Vec<Wide>,
}

impl Lstm {
    /// Packs the parameters.
    ///
    /// # Errors
    /// A size of zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(parts: &LstmParts<'_>) -> Result<Self, KernelError> {
        let &LstmParts { inputs, hidden, weight_ih, weight_hh, bias_ih, bias_hh, squash } = parts;
        check_sizes([("inputs", inputs), ("hidden", hidden)])?;
        // No tensor has the length of a product that saturates.
        let gates = hidden.saturating_mul(4);
        check("weight_ih", weight_ih, gates.saturating_mul(inputs))?;
        check("weight_hh", weight_hh, gates.saturating_mul(hidden))?;
        let zeros = vec![0.0; 4 * hidden];
        let (bias_ih, bias_hh) = (bias_ih.unwrap_or(&zeros), bias_hh.unwrap_or(&zeros));
        check("bias_ih", bias_ih, 4 * hidden)?;
        check("bias_hh", bias_hh, 4 * hidden)?;
        let mut bias = vec![Wide::ZERO; blocks(hidden)];
        for (row, (ih, hh)) in bias_ih.iter().zip(bias_hh).enumerate() {
            // Adding +0 turns -0 into +0.
            flat_wide_mut(&mut bias)[place(hidden, row)] = (ih + hh) + 0.0;
        }
        let pack = |weight: &[f32], columns: usize| {
            let mut packed = vec![Wide::ZERO; blocks(hidden) * columns];
            for (row, weights) in weight.chunks_exact(columns).enumerate() {
                let (block, lane) = (place(hidden, row) / WIDTH, place(hidden, row) % WIDTH);
                for (column, &weight) in weights.iter().enumerate() {
                    packed[block * columns + column].0[lane] = weight;
                }
            }
            packed
        };
        let (on_input, on_hidden) = (pack(weight_ih, inputs), pack(weight_hh, hidden));
        Ok(Self { inputs, hidden, on_input, on_hidden, bias, squash })
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of hidden values.
    pub fn hidden(&self) -> usize {
        self.hidden
    }

    /// Bytes of a state.
    pub fn state_bytes(&self) -> usize {
        2 * Lanes::count(self.hidden) * size_of::<Lanes>() + size_of_val(&*self.bias)
    }

    /// The state before the first step: zeros.
    pub fn state(&self) -> LstmState {
        let lanes = Lanes::count(self.hidden);
        LstmState {
            count: self.hidden,
            hidden: vec![Lanes::ZERO; lanes],
            cell: vec![Lanes::ZERO; lanes],
            gates: vec![Wide::ZERO; self.bias.len()],
        }
    }

    /// One step: reads `x`, replaces `state`. O(4 H (I + H)); O(4 H H) if `x` is zero.
    ///
    /// # Panics
    /// If `x` or `state` does not have this cell's sizes.
    pub fn step(&self, isa: Isa, x: &[f32], state: &mut LstmState) {
        assert_eq!(x.len(), self.inputs, "the input must have the cell's size");
        assert_eq!(state.count, self.hidden, "the state must have the cell's size");
        isa.run(Step { lstm: self, x, state });
    }
}

impl LstmState {
    /// The hidden state, h.
    pub fn hidden(&self) -> &[f32] {
        &flat(&self.hidden)[..self.count]
    }

    /// The hidden state, packed in lanes, with zero padding.
    pub fn hidden_lanes(&self) -> &[Lanes] {
        &self.hidden
    }

    /// The cell state, c.
    pub fn cell(&self) -> &[f32] {
        &flat(&self.cell)[..self.count]
    }

    /// Sets the hidden state and the cell state.
    ///
    /// # Panics
    /// If a slice does not have the cell's size.
    pub fn set(&mut self, hidden: &[f32], cell: &[f32]) {
        for (to, from) in [(&mut self.hidden, hidden), (&mut self.cell, cell)] {
            flat_mut(to)[..self.count].copy_from_slice(from);
        }
    }

    /// Sets the state to zeros.
    pub fn reset(&mut self) {
        self.hidden.fill(Lanes::ZERO);
        self.cell.fill(Lanes::ZERO);
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        2 * size_of_val(&*self.hidden) + size_of_val(&*self.gates)
    }
}

const WIDTH: usize = 2 * LANES;

/// Blocks of gates: each gate is padded to whole lanes, so all four are whole blocks.
fn blocks(hidden: usize) -> usize {
    4 * Lanes::count(hidden) * LANES / WIDTH
}

/// Index among the padded gates of `PyTorch`'s weight row `row`.
fn place(hidden: usize, row: usize) -> usize {
    row / hidden * Lanes::count(hidden) * LANES + row % hidden
}

struct Step<'a> {
    lstm: &'a Lstm,
    x: &'a [f32],
    state: &'a mut LstmState,
}

impl Task for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { lstm, x, state } = self;
        let x = if is_zero(x) { &[] } else { x };
        let h = &flat(&state.hidden)[..state.count];
        let h = if is_zero(h) { &[] } else { h };
        let mut block = 0;
        // As many blocks as there are registers for their partial sums share each broadcast value.
        while S::WIDE && block + 4 <= lstm.bias.len() {
            lstm.gates::<S, 4>(simd, x, h, block, &mut state.gates);
            block += 4;
        }
        while S::WIDE && block + 2 <= lstm.bias.len() {
            lstm.gates::<S, 2>(simd, x, h, block, &mut state.gates);
            block += 2;
        }
        while block < lstm.bias.len() {
            lstm.gates::<S, 1>(simd, x, h, block, &mut state.gates);
            block += 1;
        }
        let padded = Lanes::count(state.count) * LANES;
        let gates = flat_wide(&state.gates);
        Update {
            gates: std::array::from_fn(|gate| &gates[gate * padded..][..padded]),
            peephole: None,
            squash: lstm.squash,
            cell: flat_mut(&mut state.cell),
            hidden: flat_mut(&mut state.hidden),
        }
        .run(simd);
        // A sigmoid candidate is not zero if its gate is zero.
        flat_mut(&mut state.cell)[state.count..].fill(0.0);
        flat_mut(&mut state.hidden)[state.count..].fill(0.0);
    }
}

impl Lstm {
    /// Sums of B blocks of gates; an empty `x` or `h` counts as zeros.
    #[inline(always)]
    fn gates<S: Simd, const B: usize>(&self, simd: S, x: &[f32], h: &[f32], block: usize, out: &mut [Wide]) {
        let mut acc = [[S::V16::splat(simd, 0.0); B]; 4];
        for (values, weights, columns) in
            [(x, &self.on_input, self.inputs), (h, &self.on_hidden, self.hidden)]
        {
            if !values.is_empty() {
                let panel = |b: usize| &weights[(block + b) * columns..][..columns];
                accumulate_in_four(simd, &mut acc, values, std::array::from_fn::<_, B, _>(panel));
            }
        }
        for b in 0..B {
            let sum = (acc[0][b].add(acc[1][b])).add(acc[2][b].add(acc[3][b]));
            sum.add(S::V16::load(simd, &self.bias[block + b])).store(&mut out[block + b]);
        }
    }
}

/// Whether every value is zero, of either sign.
#[inline(always)]
fn is_zero(values: &[f32]) -> bool {
    // In chunks: the first value that is not zero is usually near the start.
    values.chunks(64).all(|values| values.iter().fold(0, |bits, v| bits | v.to_bits() << 1) == 0)
}
