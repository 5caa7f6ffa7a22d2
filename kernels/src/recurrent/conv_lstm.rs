//! The convolutional LSTM cell over planes (Shi et al. 2015, without peepholes): an image x and a
//! state h, c to a new state.
//!
//! gates = w * [x, h] + b as in [`PlanarConv3x3`], then the gates' update, row by row. A new row of
//! h is held back until the row below has read the old one: the state is replaced in place.

use super::{Squash, Update};
use crate::error::KernelError;
use crate::isa::{Isa, Simd, Task, flat_wide_mut};
use crate::lanes::Wide;
use crate::planar::{Occupancy, PlanarConv3x3, Planes, RowOut, TILE};

/// A convolutional LSTM cell of few channels.
#[derive(Clone, Debug)]
pub struct PlanarConvLstm {
    gates: PlanarConv3x3,
    hidden: usize,
    squash: Squash,
}

/// The cell state c of a convolutional LSTM, and scratch. The caller owns the hidden state h.
#[derive(Clone, Debug)]
pub struct PlanarConvLstmState {
    cell: Planes,
    /// A row of every gate, then the new row of h.
    row: Vec<Wide>,
}

impl PlanarConvLstm {
    /// A cell with `inputs` and `hidden` channels. `weight` is (4 x hidden, inputs + hidden, 3, 3)
    /// with gates i, f, g, o and inputs before the state; `bias` is (4 x hidden).
    ///
    /// # Errors
    /// A size of zero, a tensor of the wrong length, or a value that is not finite.
    pub fn new(
        inputs: usize,
        hidden: usize,
        weight: &[f32],
        bias: Option<&[f32]>,
        squash: Squash,
    ) -> Result<Self, KernelError> {
        let gates = PlanarConv3x3::new([inputs, hidden], hidden.saturating_mul(4), weight, bias, false)?;
        Ok(Self { gates, hidden, squash })
    }

    /// Bytes of a state.
    pub fn state_bytes(&self, height: usize, width: usize) -> u128 {
        let row = 5 * self.hidden as u128 * width.div_ceil(TILE) as u128;
        Planes::bytes_of(self.hidden, height, width) + row * size_of::<Wide>() as u128
    }

    /// The state before the first step: zeros, as the caller's hidden state must be.
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn state(&self, height: usize, width: usize) -> PlanarConvLstmState {
        let cell = Planes::zeros(self.hidden, height, width);
        let row = vec![Wide::ZERO; 5 * self.hidden * cell.tiles()];
        PlanarConvLstmState { cell, row }
    }

    /// One step: reads `x`, replaces `state` and `hidden`. `None` is an image of zeros. Where `x`
    /// is `None` or `occupied` says empty, it costs less with the same bits. O(height x width x 9 x
    /// (inputs + hidden) x 4 hidden).
    ///
    /// # Panics
    /// If `x`, `state` or `hidden` does not have this cell's sizes.
    pub fn step(
        &self,
        isa: Isa,
        x: Option<&Planes>,
        occupied: Option<&Occupancy>,
        state: &mut PlanarConvLstmState,
        hidden: &mut Planes,
    ) {
        self.gates.check([x, Some(hidden)], occupied, state.cell.height(), state.cell.width());
        assert_eq!(state.cell.channels(), self.hidden, "the state must have the cell's channels");
        isa.run(Step { lstm: self, x, occupied, state, hidden });
    }
}

impl PlanarConvLstmState {
    /// The cell state, c.
    pub fn cell(&self) -> &Planes {
        &self.cell
    }

    /// The cell state, c, to write.
    pub fn cell_mut(&mut self) -> &mut Planes {
        &mut self.cell
    }

    /// Sets the state to zeros.
    pub fn reset(&mut self) {
        self.cell.clear();
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        self.cell.bytes() + size_of_val(&*self.row)
    }
}

struct Step<'a> {
    lstm: &'a PlanarConvLstm,
    x: Option<&'a Planes>,
    occupied: Option<&'a Occupancy>,
    state: &'a mut PlanarConvLstmState,
    hidden: &'a mut Planes,
}

impl Task for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { lstm, x, occupied, state: PlanarConvLstmState { cell, row }, hidden } = self;
        let (height, width, tiles) = (hidden.height(), hidden.width(), hidden.tiles());
        let (gates, next) = row.split_at_mut(4 * lstm.hidden * tiles);
        let (gates, next) = (flat_wide_mut(gates), flat_wide_mut(next));
        // Whole tiles, so that every vector is full.
        let columns = if tiles == 0 { 0 } else { next.len() / lstm.hidden };
        for y in 0..height {
            let out = RowOut { values: gates, stride: columns };
            lstm.gates.row(simd, [x, Some(hidden)], occupied, y, 0..tiles, out);
            if y > 0 {
                publish(hidden, y - 1, next, columns);
            }
            for channel in 0..lstm.hidden {
                let gate = |gate: usize| &gates[(gate * lstm.hidden + channel) * columns..][..columns];
                let cell = &mut cell.padded_mut(channel, y)[..columns];
                Update {
                    gates: std::array::from_fn(gate),
                    peephole: None,
                    squash: lstm.squash,
                    cell: &mut *cell,
                    hidden: &mut next[channel * columns..][..columns],
                }
                .run(simd);
                cell[width..].fill(0.0);
            }
        }
        if height > 0 {
            publish(hidden, height - 1, next, columns);
        }
    }
}

/// Writes row `y` of every plane.
#[inline(always)]
fn publish(hidden: &mut Planes, y: usize, next: &[f32], columns: usize) {
    let width = hidden.width();
    for channel in 0..hidden.channels() {
        hidden.row_mut(channel, y).copy_from_slice(&next[channel * columns..][..width]);
    }
}
