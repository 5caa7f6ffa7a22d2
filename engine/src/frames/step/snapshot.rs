//! The state of a frame engine as bytes.
//!
//! The bytes hold all values, the layers' memories, and the changes that layers have not processed:
//! with a tolerance, values can depend on the past. Sizes are those of the reading engine and marks
//! lie on its pixels, so layers can run on all values that are read.

use super::{Background, State};
use crate::EngineError;
use crate::counters::FrameLayerCounters;
use crate::frames::buffer::Buffer;
use crate::frames::changes::{Changes, Pending};
use crate::frames::compile::FrameNetwork;
use crate::frames::layers::Memory;
use crate::frames::unlikeness::FrameStatistics;
use crate::snapshot::{Reader, Writer};

impl State {
    pub(in crate::frames) fn write(&self, network: &FrameNetwork, to: &mut Writer) {
        to.counts([self.frames, self.counters.frames, self.counters.predictions]);
        to.size(self.counters.layers.len());
        self.counters.layers.iter().for_each(|layer| to.counts(layer.to_array()));
        for (buffer, &shape) in self.buffers.iter().zip(&network.buffers) {
            if !matches!(buffer, Buffer::Away) {
                let mut values = vec![0.0; shape.values()];
                buffer.flatten(0, shape.sides()[0], &mut values);
                to.values(&values);
            }
        }
        self.memories.iter().for_each(|memory| memory.write(to));
        for Pending { pixels, any } in &self.pending {
            to.flag(*any);
            write_changes(pixels, to);
        }
        for reached in self.background.iter().flat_map(|background| &background.reached).flatten() {
            write_changes(reached, to);
        }
        // A network without statistics of its training writes and expects nothing here.
        if let Some(statistics) = &self.statistics {
            to.size(statistics.sums().len());
            statistics.sums().iter().for_each(|sum| to.u64(sum.to_bits()));
        }
    }

    /// Reads the state from `from`; on an error it is left partly read.
    pub(in crate::frames) fn read(
        &mut self,
        network: &FrameNetwork,
        from: &mut Reader<'_>,
    ) -> Result<(), EngineError> {
        let [frames, pushed, predictions] = from.counts("count of frames")?;
        (self.frames, self.counters.frames, self.counters.predictions) = (frames, pushed, predictions);
        from.exactly("number of layers", self.counters.layers.len())?;
        for layer in &mut self.counters.layers {
            *layer = FrameLayerCounters::from_array(from.counts("count of pixels")?);
        }
        for (i, (buffer, &shape)) in self.buffers.iter_mut().zip(&network.buffers).enumerate() {
            if !matches!(buffer, Buffer::Away) {
                let mut values = vec![0.0; shape.values()];
                from.values(format_args!("values of {:?}", network.value_name(i)), &mut values)?;
                buffer.fill_from(&values);
            }
        }
        for (i, memory) in self.memories.iter_mut().enumerate() {
            memory.read(network.value_name(i + 1), from)?;
        }
        for (i, Pending { pixels, any }) in self.pending.iter_mut().enumerate() {
            let what = format_args!("changes that {:?} has to see", network.value_name(i + 1));
            *any = from.flag(what)?;
            read_changes(pixels, what, from)?;
        }
        if let Some(Background { reached, .. }) = &mut self.background {
            for (i, reached) in reached.iter_mut().enumerate() {
                if let Some(reached) = reached {
                    let what = format_args!("pixels of {:?} that events reach", network.value_name(i));
                    read_changes(reached, what, from)?;
                }
            }
        }
        let mut sums = Vec::new();
        if !from.is_done() {
            let count = from.length("sums of frames", FrameStatistics::MAX_SUMS, size_of::<f64>())?;
            for _ in 0..count {
                let sum = f64::from_bits(from.u64("sum of a frame")?);
                if !sum.is_finite() {
                    return Err(from.refuse("sum of a frame", size_of::<f64>(), "a finite number", sum));
                }
                sums.push(sum);
            }
        }
        if let Some(mut statistics) = self.statistics.take() {
            statistics.set(self.frames, &sums, || self.frame(network));
            self.statistics = Some(statistics);
        }
        // The prediction is copied again from the output of the last layer.
        self.stale = true;
        Ok(())
    }
}

impl Memory {
    fn write(&self, to: &mut Writer) {
        match self {
            // Products are computed again from the values.
            Self::Nothing | Self::Products(_) => {}
            Self::Lstm(state) => {
                to.values(state.hidden());
                to.values(state.cell());
            }
            Self::ConvLstm(state) => {
                to.flag(state.new);
                to.values(&state.cell);
            }
            Self::PlanarConvLstm(state, _) => {
                state.cell().values().for_each(|value| to.values(&[value]));
            }
            Self::Delay(vectors) => to.values(vectors),
        }
    }

    fn read(&mut self, layer: &str, from: &mut Reader<'_>) -> Result<(), EngineError> {
        let what = format_args!("state of {layer:?}");
        match self {
            Self::Nothing => Ok(()),
            Self::Products(products) => {
                products.stale = true;
                Ok(())
            }
            Self::Lstm(state) => {
                let mut both = vec![0.0; 2 * state.cell().len()];
                from.values(what, &mut both)?;
                let (hidden, cell) = both.split_at(both.len() / 2);
                state.set(hidden, cell);
                Ok(())
            }
            Self::ConvLstm(state) => {
                state.new = from.flag(what)?;
                from.values(what, &mut state.cell)
            }
            Self::PlanarConvLstm(state, _) => {
                let cell = state.cell_mut();
                let mut values = vec![0.0; cell.channels() * cell.height() * cell.width()];
                from.values(what, &mut values)?;
                cell.set(&values);
                Ok(())
            }
            Self::Delay(vectors) => from.values(what, vectors),
        }
    }
}

fn write_changes(changes: &Changes, to: &mut Writer) {
    changes.words().iter().for_each(|&word| to.u64(word));
}

fn read_changes(
    changes: &mut Changes,
    what: impl std::fmt::Display,
    from: &mut Reader<'_>,
) -> Result<(), EngineError> {
    for at in 0..changes.words().len() {
        let word = from.u64(&what)?;
        if !changes.set_word(at, word) {
            return Err(from.refuse(what, 8, "marks on pixels", format_args!("{word:#018x}")));
        }
    }
    Ok(())
}
