//! An engine for the streams of one sensor, one after the other, in the caller's thread.
//!
//! A stream begins with an empty window, because its times are unrelated to those of the stream
//! before. Predictions do not depend on how events are grouped into packets: after n events they
//! equal those of any other process that has taken the same n events, bit for bit.

use meissner_engine::{DropReason, EngineError, EventCounters, Prediction, Predictor, Sensor};
use serde::Serialize;

use crate::coverage::{Coverage, Gap, Losses, Reason};
use crate::error::PacketError;
use crate::network::{AnyEngine, AnyNetwork};

/// Counts over all streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Number of started streams.
    pub streams: u64,
    /// Packets that were taken.
    pub packets: u64,
    /// Events that the engine got.
    pub events: u64,
    /// Of those, accepted by the engine.
    pub accepted: u64,
    /// Predictions.
    pub predictions: u64,
    /// Predictions that were not numbers.
    pub not_numbers: u64,
}

/// The result of taking a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The gap before it.
    pub gap: Option<Gap>,
    /// Events that the engine got.
    pub events: usize,
}

/// A network over the streams of one sensor. `S` names a stream.
pub struct SensorEngine<S> {
    network: AnyNetwork,
    /// The reason for lost packets between two that arrive.
    reason: Reason,
    stream: Option<S>,
    /// Made for the first sensor, and again for another one.
    engine: Option<(Sensor, AnyEngine)>,
    coverage: Coverage,
    /// Losses of the streams before.
    past: Losses,
    counts: Counts,
    /// Whether no prediction covers a packet that was taken.
    is_due: bool,
}

impl<S: PartialEq> SensorEngine<S> {
    /// Predictions of `network` from packets, some of which get lost by `reason`.
    pub fn new(network: AnyNetwork, reason: Reason) -> Self {
        let (coverage, past, counts) = (Coverage::new(reason), Losses::default(), Counts::default());
        Self { network, reason, stream: None, engine: None, coverage, past, counts, is_due: false }
    }

    /// Announces a packet of `stream` on `sensor`; returns whether a stream begins with it.
    ///
    /// # Errors
    /// The network does not fit the sensor, or the sensor changes within the stream.
    pub fn begin(&mut self, stream: S, sensor: Sensor) -> Result<bool, PacketError> {
        let known = self.engine.as_ref().map(|&(sensor, _)| sensor);
        if self.stream.as_ref() == Some(&stream)
            && let Some(expected) = known
        {
            let found = sensor;
            return if expected == found { Ok(false) } else { Err(PacketError::Sensor { expected, found }) };
        }
        // An engine allocates all memory when it is made, so a fitting engine is reused.
        match &mut self.engine {
            Some((known, engine)) if *known == sensor => engine.reset(),
            engine => *engine = Some((sensor, self.network.engine(sensor)?)),
        }
        self.past = self.losses();
        self.coverage = Coverage::new(self.reason);
        if self.counts.streams > 0 {
            self.coverage = self.coverage.connected();
        }
        (self.stream, self.is_due) = (Some(stream), false);
        self.counts.streams += 1;
        Ok(true)
    }

    /// Takes the packet of this number, whose `len` events begin with number `first`, of the stream
    /// that [began](Self::begin). `push` gives the engine the events after the known first ones,
    /// and returns the number of accepted ones. `None` if nothing is new.
    pub fn take(
        &mut self,
        number: u64,
        first: Option<u64>,
        len: usize,
        push: impl FnOnce(&mut AnyEngine, usize) -> usize,
    ) -> Option<Taken> {
        let (_, engine) = self.engine.as_mut()?;
        let placed = self.coverage.place(number, first, len)?;
        let events = len - placed.skip;
        self.coverage.take(events);
        self.counts.packets += 1;
        self.counts.events += events as u64;
        self.counts.accepted += push(engine, placed.skip) as u64;
        self.is_due = true;
        Some(Taken { gap: placed.gap, events })
    }

    /// Counts the packet of this number, which cannot be read, as lost. Returns the gap before it.
    pub fn lose(&mut self, number: u64, first: Option<u64>, len: usize) -> Option<Gap> {
        let placed = self.coverage.place(number, first, len)?;
        self.coverage.lose(len - placed.skip, Reason::Malformed);
        placed.gap
    }

    /// Counts a packet without a position.
    pub fn refuse(&mut self) {
        self.coverage.refuse();
    }

    /// The prediction for the packets that were taken; `None` if there are none since the last one.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`]; the next prediction may be a number again.
    pub fn predict(&mut self) -> Result<Option<Prediction<'_>>, EngineError> {
        let (true, Some((_, engine))) = (std::mem::take(&mut self.is_due), &mut self.engine) else {
            return Ok(None);
        };
        let prediction = engine.predict().inspect_err(|_| self.counts.not_numbers += 1)?;
        self.counts.predictions += 1;
        Ok(Some(prediction))
    }

    /// Whether no prediction covers a packet that was taken.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// The stream that began last.
    pub fn stream(&self) -> Option<&S> {
        self.stream.as_ref()
    }

    /// Number of predicted values.
    pub fn outputs(&self) -> usize {
        self.network.outputs()
    }

    /// The known data about the events of the newest stream.
    pub fn coverage(&self) -> &Coverage {
        &self.coverage
    }

    /// The same, to change it.
    pub fn coverage_mut(&mut self) -> &mut Coverage {
        &mut self.coverage
    }

    /// The counts.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Losses over all streams.
    pub fn losses(&self) -> Losses {
        let mut all = self.past;
        for (sum, lost) in all.iter_mut().zip(self.coverage.lost) {
            sum.packets = sum.packets.saturating_add(lost.packets);
            sum.events = sum.events.saturating_add(lost.events);
        }
        all
    }

    /// Events that the engine dropped since its sensor is known, by reason.
    pub fn dropped(&self) -> [(DropReason, u64); EventCounters::DROP_REASONS] {
        let none = || EventCounters::default().dropped();
        self.engine.as_ref().map_or_else(none, |(_, engine)| engine.dropped())
    }
}
