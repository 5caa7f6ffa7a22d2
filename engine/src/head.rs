//! A network's head: dense layers over the readout, or a frame network that reads it as an image.
//!
//! Input: the readout, newest time cell first, and its changed cells. Output: the prediction. The
//! first dense layer or the frame network recomputes only the values that a changed cell reaches.

use std::sync::Arc;

use meissner_kernels::{Isa, Lanes, Matrix, is_nan};

use crate::EngineError;
use crate::frames::{Cell, FrameEngine, FrameNetwork, FrameOptions};
use crate::memory::Memory;
use crate::network::Network;

#[derive(Clone, Debug)]
pub(crate) enum Head {
    /// Outputs of each dense layer, and the sums that the first keeps.
    Dense(Vec<Matrix>, Vec<Lanes>),
    Image(Box<ImageHead>),
}

#[derive(Clone, Debug)]
pub(crate) struct ImageHead {
    engine: FrameEngine,
    /// The whole frame, if all of it must be pushed.
    image: Vec<f32>,
    /// Whether the last frame was refused, so that changes since the one before are missing.
    lacks_changes: bool,
    failure: Option<EngineError>,
}

impl Head {
    pub(crate) fn new(network: &Network, isa: Isa, memory: &mut Memory) -> Self {
        let parts = network.parts();
        if let Some(head) = &parts.head {
            let image = head.input().values() * size_of::<f32>() + size_of::<ImageHead>();
            memory.add(head.engine_bytes(FrameOptions::default()) + image as u128);
            if !memory.counts_only {
                return Self::Image(Box::new(ImageHead::new(head, isa)));
            }
        }
        let outputs = |layer: usize| parts.dense[layer].dense.outputs();
        let sums = parts.dense.first().map_or(0, |first| first.dense.sums());
        Self::Dense(
            memory.each(parts.dense.len(), |memory, layer| memory.matrix(1, outputs(layer))),
            memory.copies(Lanes::ZERO, sums),
        )
    }

    pub(crate) fn set_isa(&mut self, isa: Isa) {
        if let Self::Image(head) = self {
            head.engine.set_isa(isa);
        }
    }

    /// Computes the prediction from `readout`, grids of `cells` rows that differ from the last
    /// call's (at first from zeros) in `changed`.
    pub(crate) fn run(
        &mut self,
        network: &Network,
        isa: Isa,
        readout: &Matrix,
        cells: usize,
        changed: &[u32],
        prediction: &mut Vec<f32>,
    ) {
        match self {
            Self::Dense(hidden, sums) => {
                let (mut inputs, mut sums) = (readout.lanes(), &mut sums[..]);
                for (layer, out) in network.parts().dense.iter().zip(&mut *hidden) {
                    layer.dense.update(isa, inputs, changed, std::mem::take(&mut sums), out.row_mut(0));
                    inputs = out.lanes();
                }
                if let Some(last) = hidden.last() {
                    prediction.clear();
                    prediction.extend(last.values(0));
                }
            }
            Self::Image(head) => {
                head.failure = head.run(readout, cells, changed, prediction).err();
            }
        }
    }

    pub(crate) fn failure(&self, network: &Network) -> Option<EngineError> {
        match self {
            Self::Dense(hidden, _) => {
                let layer = hidden.iter().position(|values| is_nan(values.lanes()))?;
                let layer = network.parts().dense[layer].name.clone();
                Some(EngineError::NotANumber { layer, rows: 1 })
            }
            Self::Image(head) => head.failure.clone(),
        }
    }
}

impl ImageHead {
    /// Its memory counts as part of the event engine's memory, and is checked against that limit.
    /// Never fails: the maps are small enough, and no other option is out of range.
    fn new(network: &Arc<FrameNetwork>, isa: Isa) -> Self {
        let options = FrameOptions::new().with_isa(isa).with_memory_limit(u128::MAX);
        let mut engine =
            FrameEngine::with_options(Arc::clone(network), options).expect("every map can be made");
        let mut image = vec![0.0; network.input().values()];
        // Working space grows on use: compute everything now, so that it does not grow later.
        for value in [1.0, 0.0] {
            image.fill(value);
            engine.push(&image).expect("finite values");
            let _ = engine.predict();
        }
        engine.reset();
        Self { image, engine, lacks_changes: false, failure: None }
    }

    fn run(
        &mut self,
        readout: &Matrix,
        cells: usize,
        changed: &[u32],
        prediction: &mut Vec<f32>,
    ) -> Result<(), EngineError> {
        let channels = readout.columns();
        let pushed = if self.lacks_changes {
            for row in 0..readout.rows() {
                let (age, cell) = (row / cells, row % cells);
                for (c, value) in readout.values(row).enumerate() {
                    self.image[(age * channels + c) * cells + cell] = value;
                }
            }
            self.engine.push(&self.image)
        } else {
            self.engine.push_cells(changed.iter().map(|&row| {
                let (age, pixel) = (row as usize / cells, row as usize % cells);
                Cell { pixel, first: age * channels, values: readout.slice(row as usize) }
            }))
        };
        // The only error is a value that is not finite: the readout ignores NaN, not infinity.
        self.lacks_changes = pushed.is_err();
        if self.lacks_changes {
            return Err(EngineError::NotANumber { layer: "readout".to_owned(), rows: 1 });
        }
        let values = self.engine.predict()?.values;
        prediction.clear();
        prediction.extend_from_slice(values);
        Ok(())
    }
}
