//! Slices of events into predictions. Nothing here knows iceoryx2.
//!
//! Each record goes from the borrowed slice into the engine: the payload is not copied. A run begins with an empty window, because its times
//! have nothing to do with those of the run before. Predictions do not depend on how slices are grouped: after n events they equal those of
//! any other process that has taken the same n events, bit for bit.

use std::sync::Arc;

use meissner_engine::{Engine, EngineError, EventCounters, Network, Outcome, Sensor};
use serde::Serialize;

use crate::losses::{Gap, Losses, Seen, Watch};
use crate::wire::{EventRecord, Malformed, PredictionHeader, SliceHeader, check};

/// A network over the slices of one driver after the other.
#[derive(Debug)]
pub struct Inference {
    network: Arc<Network>,
    /// Made for the first sensor, and again for another one.
    engine: Option<Engine>,
    watch: Watch,
    counts: Counts,
    /// The header of the next prediction.
    next: PredictionHeader,
    /// Whether something was taken that no prediction covers.
    is_due: bool,
}

/// What was taken, over all runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Runs of drivers.
    pub runs: u64,
    /// Slices with events.
    pub slices: u64,
    /// Events pushed.
    pub events: u64,
    /// Of those, accepted by the engine.
    pub accepted: u64,
    /// Predictions.
    pub predictions: u64,
    /// Predictions that were not numbers.
    pub not_numbers: u64,
}

/// What a slice brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Whether a driver has started anew.
    pub is_new_run: bool,
    /// What is missing before it.
    pub gap: Option<Gap>,
    /// Whether the run ends with it.
    pub is_end: bool,
}

/// Why a slice was not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// It is no slice of events.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// The engine does not take its sensor.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl Inference {
    /// Predictions of `network`; `origin` tells them from those of another start.
    pub fn new(network: impl Into<Arc<Network>>, origin: u64) -> Self {
        Self {
            network: network.into(),
            engine: None,
            watch: Watch::default(),
            counts: Counts::default(),
            next: PredictionHeader { origin, ..PredictionHeader::default() },
            is_due: false,
        }
    }

    /// Takes a slice that was received at `received_ns` of the shared clock.
    ///
    /// # Errors
    /// The slice is refused as a whole, and counted.
    pub fn take(
        &mut self,
        header: &SliceHeader,
        records: &[EventRecord],
        received_ns: u64,
    ) -> Result<Taken, Refused> {
        let sensor = check(header, records).inspect_err(|_| self.watch.refuse(header, records.len()))?;
        let seen = self
            .watch
            .see(header, records.len())
            .inspect_err(|_| self.watch.refuse(header, records.len()))?;
        if seen.is_new_run {
            self.counts.runs += 1;
            let PredictionHeader { origin, sequence, .. } = self.next;
            let run = header.run;
            self.next = PredictionHeader { origin, sequence, run, ..PredictionHeader::default() };
            self.is_due = false;
        }
        let engine = match &mut self.engine {
            Some(engine) if engine.sensor() == sensor => {
                if seen.is_new_run {
                    engine.reset();
                }
                engine
            }
            // A sensor that changes within a run starts anew, too.
            other => other.insert(Engine::new(Arc::clone(&self.network), sensor)?),
        };
        if !self.is_due {
            let &SliceHeader { due_ns, published_ns, .. } = header;
            self.next = PredictionHeader { due_ns, published_ns, received_ns, ..self.next };
            self.is_due = true;
        }
        for event in records.iter().filter_map(EventRecord::event) {
            self.counts.accepted += u64::from(engine.push(event) == Outcome::Accepted);
        }
        let events = records.len() as u64;
        self.counts.events += events;
        self.counts.slices += u64::from(events > 0);
        self.next.taken += events;
        self.next.lost = (header.first_event + events).saturating_sub(self.next.taken);
        self.next.end = header.end.into();
        let Seen { is_new_run, gap } = seen;
        Ok(Taken { is_new_run, gap, is_end: header.end == 1 })
    }

    /// The prediction for what was taken since the last one; `None` if nothing was. Its time is still to be set.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`]; the next prediction may be a number again.
    pub fn predict(&mut self) -> Result<Option<(PredictionHeader, &[f32])>, EngineError> {
        let (true, Some(engine)) = (std::mem::take(&mut self.is_due), &mut self.engine) else {
            return Ok(None);
        };
        let prediction = engine.predict().inspect_err(|_| self.counts.not_numbers += 1)?;
        self.counts.predictions += 1;
        let (t_us, nodes) = (prediction.t_us.unwrap_or(0), prediction.nodes as u64);
        let header = PredictionHeader { t_us, nodes, ..self.next };
        self.next.sequence += 1;
        Ok(Some((header, prediction.values)))
    }

    /// Values of a prediction.
    pub fn outputs(&self) -> usize {
        self.network.outputs()
    }

    /// What was taken.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What is missing.
    pub fn losses(&self) -> Losses {
        self.watch.losses
    }

    /// What the engine dropped, with reasons; zeros before the first slice.
    pub fn engine_counters(&self) -> EventCounters {
        self.engine.as_ref().map_or_else(EventCounters::default, |engine| engine.counters().events)
    }

    /// The sensor of the newest slice.
    pub fn sensor(&self) -> Option<Sensor> {
        self.engine.as_ref().map(Engine::sensor)
    }
}
