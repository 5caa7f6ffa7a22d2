//! Slices of events into predictions. Nothing here knows iceoryx2.
//!
//! Each record goes from the borrowed slice into the engine: the payload is not copied. A start of
//! the driver is a stream of [`SensorEngine`].

use meissner_engine::{Event, Outcome, Predictor};
use meissner_packets::{AnyNetwork, Gap, PacketError, Reason, SensorEngine};

use crate::wire::{EventRecord, Malformed, PredictionHeader, SliceHeader, check, check_records};

/// A network over the slices of one driver after the other.
pub struct Inference {
    /// Counts and losses of all runs.
    pub engine: SensorEngine<u64>,
    /// The header of the next prediction.
    next: PredictionHeader,
}

/// What a slice brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// Whether a driver has started anew.
    pub is_new_run: bool,
    /// What is missing before it.
    pub gap: Option<Gap>,
    /// Why its events are lost.
    pub refused: Option<Malformed>,
    /// Whether the run ends with it.
    pub is_end: bool,
}

/// Why a slice was not taken.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// It is no slice of events.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// The engine does not take its sensor.
    #[error(transparent)]
    Packets(#[from] PacketError),
}

impl Inference {
    /// Predictions of `network`; `origin` tells them from those of another start.
    pub fn new(network: AnyNetwork, origin: u64) -> Self {
        // Shared memory loses nothing: what is missing was replaced in the full buffer of this
        // process.
        let engine = SensorEngine::new(network, Reason::Queue);
        Self { engine, next: PredictionHeader { origin, ..PredictionHeader::default() } }
    }

    /// Takes a slice that was received at `received_ns` of the shared clock.
    ///
    /// # Errors
    /// The slice does not say where it belongs, or was seen before. It is counted.
    pub fn take(
        &mut self,
        header: &SliceHeader,
        records: &[EventRecord],
        received_ns: u64,
    ) -> Result<Taken, Refused> {
        let &SliceHeader { run, sequence, first_event, due_ns, published_ns, end, .. } = header;
        let sensor = check(header, records.len()).inspect_err(|_| self.engine.refuse())?;
        let is_new_run = self.engine.begin(run, sensor).inspect_err(|_| self.engine.refuse());
        let is_new_run = is_new_run?;
        if is_new_run {
            let PredictionHeader { origin, sequence, .. } = self.next;
            self.next = PredictionHeader { origin, sequence, run, ..PredictionHeader::default() };
        }
        let (first, len, is_end) = (Some(first_event), records.len(), end == 1);
        if let Err(malformed) = check_records(records) {
            let gap = self.engine.lose(sequence, first, len);
            return Ok(Taken { is_new_run, gap, refused: Some(malformed), is_end });
        }
        let was_due = self.engine.is_due();
        let taken = self.engine.take(sequence, first, len, |engine, skip| {
            let events = records[skip..].iter().filter_map(EventRecord::event);
            events.filter(|event: &Event| engine.push(event) == Ok(Outcome::Accepted)).count()
        });
        let Some(taken) = taken else { return Err(Malformed::Repeated { found: sequence }.into()) };
        if !was_due {
            self.next = PredictionHeader { due_ns, published_ns, received_ns, ..self.next };
        }
        let coverage = self.engine.coverage();
        (self.next.taken, self.next.lost) = (coverage.accepted, coverage.lost_events());
        self.next.end = end.into();
        Ok(Taken { is_new_run, gap: taken.gap, refused: None, is_end })
    }

    /// The prediction for what was taken since the last one; `None` if nothing was. Its time is
    /// still to be set.
    ///
    /// # Errors
    /// The prediction is not a number; the next one may be a number again.
    pub fn predict(&mut self) -> Result<Option<(PredictionHeader, &[f32])>, PacketError> {
        let Some(prediction) = self.engine.predict()? else { return Ok(None) };
        let (t_us, nodes) = (prediction.t_us.unwrap_or(0), prediction.nodes as u64);
        let header = PredictionHeader { t_us, nodes, ..self.next };
        self.next.sequence += 1;
        Ok(Some((header, prediction.values)))
    }
}
