//! The inference process: takes slices from shared memory, and writes predictions into it.
//!
//! Each record goes from the borrowed slice into the engine: the payload is not copied. A start of
//! the driver is a stream of [`SensorEngine`].

use std::collections::BTreeMap;

use meissner_engine::{Event, Outcome, Predictor};
use meissner_iceoryx2::channel::{Channel, Receiver, Sender};
use meissner_iceoryx2::driver::{events_of, now_ns, predictions_of};
use meissner_iceoryx2::wire::{EventRecord, PredictionHeader, SliceHeader, check, check_records};
use meissner_packets::{AnyNetwork, Counts, Gap, Lost, PacketError, Reason, SensorEngine, by_reason};
use meissner_run::interrupt;
use serde::Serialize;

use crate::NAP;

/// Maximum number of gaps in a summary.
const GAPS: usize = 1000;

/// The results of the process.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    #[serde(flatten)]
    counts: Counts,
    /// Missing events, by reason.
    lost: BTreeMap<&'static str, Lost>,
    /// The first thousand gaps, with their runs.
    gaps: Vec<(u64, Gap)>,
    /// Events that the engine dropped since its sensor is known, by reason.
    dropped: BTreeMap<&'static str, u64>,
}

/// Infers under this name until a driver ends (`once`), or until the program is asked to end. Up to
/// `buffer` slices may wait. A refused slice is not an error: it is counted and reported.
pub(crate) fn infer(
    name: &str,
    network: AnyNetwork,
    buffer: usize,
    once: bool,
) -> Result<Summary, PacketError> {
    let outputs = network.outputs();
    let mut inference = Inference::new(network, now_ns());
    let predictions: Sender<f32, PredictionHeader> = Channel::open(&predictions_of(name))?.sender(outputs)?;
    let events: Receiver<EventRecord, SliceHeader> = Channel::open(&events_of(name))?.receiver(buffer)?;
    eprintln!("ready");
    let mut is_over = false;
    while !is_over && !interrupt::requested() {
        events.wait(NAP)?;
        let mut has_ended = false;
        // At most the slices that fit, so that predictions still appear under a flood.
        for _ in 0..buffer {
            let Some(slice) = events.take()? else { break };
            match inference.take(slice.user_header(), slice.payload(), now_ns()) {
                Ok(()) => has_ended = slice.user_header().end == 1,
                Err(error) => eprintln!("a slice was refused: {error}"),
            }
            if has_ended {
                break;
            }
        }
        match inference.predict() {
            Ok(Some((header, values))) => {
                let header = PredictionHeader { predicted_ns: now_ns(), ..header };
                predictions.publish(header, values.len(), |index| values[index])?;
            }
            Ok(None) => {}
            Err(error) => eprintln!("no prediction: {error}"),
        }
        if has_ended {
            eprintln!("the driver has ended");
            is_over = once;
        }
    }
    let Inference { engine, gaps, .. } = inference;
    let dropped = engine.dropped().into_iter().map(|(reason, count)| (reason.name(), count)).collect();
    Ok(Summary { counts: engine.counts(), lost: by_reason(&engine.losses()), gaps, dropped })
}

/// A network over the slices of one driver after the other.
struct Inference {
    engine: SensorEngine<u64>,
    /// The header of the next prediction.
    next: PredictionHeader,
    gaps: Vec<(u64, Gap)>,
}

impl Inference {
    /// Predictions of `network`; `origin` distinguishes them from those of another start.
    fn new(network: AnyNetwork, origin: u64) -> Self {
        // Shared memory loses nothing: missing slices were replaced in the full buffer.
        let engine = SensorEngine::new(network, Reason::Queue);
        Self { engine, next: PredictionHeader { origin, ..PredictionHeader::default() }, gaps: Vec::new() }
    }

    /// Takes a slice that was received at `received_ns` of the shared clock. A slice with a record
    /// that is not an event is lost completely.
    fn take(
        &mut self,
        header: &SliceHeader,
        records: &[EventRecord],
        received_ns: u64,
    ) -> Result<(), PacketError> {
        let &SliceHeader { run, sequence, first_event, due_ns, published_ns, end, .. } = header;
        let sensor = check(header, records.len()).inspect_err(|_| self.engine.refuse())?;
        let begun = self.engine.begin(run, sensor);
        if begun.inspect_err(|_| self.engine.refuse())? {
            eprintln!("run {run}: a driver has started");
            let PredictionHeader { origin, sequence, .. } = self.next;
            self.next = PredictionHeader { origin, sequence, run, ..PredictionHeader::default() };
        }
        let (first, len) = (Some(first_event), records.len());
        if let Err(error) = check_records(records) {
            let gap = self.engine.lose(sequence, first, len);
            self.note(run, gap);
            eprintln!("a slice was refused: {error}");
            return Ok(());
        }
        let was_due = self.engine.is_due();
        let taken = self.engine.take(sequence, first, len, |engine, skip| {
            let events = records[skip..].iter().filter_map(EventRecord::event);
            events.filter(|event: &Event| engine.push(event) == Ok(Outcome::Accepted)).count()
        });
        let late = || PacketError::unexpected("slice", "one that is new", &format!("number {sequence}"));
        let gap = taken.ok_or_else(late)?.gap;
        self.note(run, gap);
        if !was_due {
            self.next = PredictionHeader { due_ns, published_ns, received_ns, ..self.next };
        }
        let coverage = self.engine.coverage();
        (self.next.taken, self.next.lost) = (coverage.accepted, coverage.lost_events());
        self.next.end = end.into();
        Ok(())
    }

    /// Reports and stores a gap.
    fn note(&mut self, run: u64, gap: Option<Gap>) {
        let Some(gap @ Gap { from, until, packets, reason }) = gap else { return };
        eprintln!("run {run}: {} events in {packets} slices lost: {}", until - from, reason.name());
        if self.gaps.len() < GAPS {
            self.gaps.push((run, gap));
        }
    }

    /// The prediction for the slices since the last one, if any; the caller sets its time.
    fn predict(&mut self) -> Result<Option<(PredictionHeader, &[f32])>, PacketError> {
        let Some(prediction) = self.engine.predict()? else { return Ok(None) };
        let (t_us, nodes) = (prediction.t_us.unwrap_or(0), prediction.nodes as u64);
        let header = PredictionHeader { t_us, nodes, ..self.next };
        self.next.sequence += 1;
        Ok(Some((header, prediction.values)))
    }
}
