//! Packets into predictions. Nothing here knows ROS 2.
//!
//! There is a prediction for each packet, after its events. A new publisher, a number that falls,
//! and another encoding or sensor begin a new stream of [`SensorEngine`].

use meissner_engine::{EngineError, Prediction, Sensor};
use meissner_io::EventPackets;
use meissner_packets::{AnyNetwork, Counts, Reason, SensorEngine};
use serde::Serialize;

use crate::error::Refused;
use crate::messages::EventPacket;
use crate::resync::Resync;

/// A network over the packets of one camera.
pub struct Inference<P> {
    engine: SensorEngine<(P, String, Sensor, u64)>,
    decoder: Option<EventPackets>,
    /// Since a loss, for encoding `evt3`.
    resync: Option<Resync>,
    /// Number of the stream, so that one after a number that falls has another name.
    stream: u64,
    counts: PacketCounts,
}

/// What was taken and lost, over all streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PacketCounts {
    /// What the engine was given.
    #[serde(flatten)]
    pub counts: Counts,
    /// Packets that are missing by their `seq`: lost on the way, or dropped where they wait because
    /// this node was too slow.
    pub packets_lost: u64,
    /// Packets that were refused.
    pub packets_refused: u64,
    /// Events that the engine dropped: earlier than one before them, or too far in time.
    pub events_dropped: u64,
    /// Events without a row or a time after a loss.
    pub events_unplaced: u64,
    /// Words and events that the decoder left out: padding, reserved words, events outside the
    /// sensor or of another system.
    pub left_out: u64,
}

/// What a packet brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Whether a stream begins with it.
    pub is_new: bool,
    /// Packets that are missing before it.
    pub lost: u64,
}

impl<P: PartialEq> Inference<P> {
    /// Predictions of `network`.
    pub fn new(network: AnyNetwork) -> Self {
        // A packet that waits too long is dropped by DDS, which does not say so.
        let engine = SensorEngine::new(network, Reason::QueueOrLink);
        Self { engine, decoder: None, resync: None, stream: 0, counts: PacketCounts::default() }
    }

    /// Takes a packet of this publisher.
    ///
    /// # Errors
    /// The packet is refused and counted. If its events cannot be decoded, those before the fault
    /// are left out too.
    pub fn take(&mut self, publisher: P, packet: &EventPacket) -> Result<Taken, Refused> {
        let taken = self.try_take(publisher, packet);
        self.counts.packets_refused += u64::from(taken.is_err());
        taken
    }

    fn try_take(&mut self, publisher: P, packet: &EventPacket) -> Result<Taken, Refused> {
        let &EventPacket { width, height, seq, time_base, is_bigendian, .. } = packet;
        let side = |pixels: u32| u16::try_from(pixels).ok().filter(|&pixels| pixels > 0);
        let (Some(columns), Some(rows)) = (side(width), side(height)) else {
            return Err(Refused::Sensor { width, height });
        };
        if is_bigendian {
            return Err(Refused::BigEndian);
        }
        let sensor = Sensor::new(columns, rows);
        let falls = self.engine.coverage().next_packet().is_some_and(|next| seq < next);
        let stream = (publisher, packet.encoding.clone(), sensor, self.stream + u64::from(falls));
        if self.decoder.is_none() || self.engine.stream() != Some(&stream) {
            self.decoder = Some(EventPackets::new(&packet.encoding, sensor)?);
            self.resync = None;
        }
        self.stream += u64::from(falls);
        let is_new = self.engine.begin(stream, sensor)?;
        if is_new {
            let coverage = self.engine.coverage_mut();
            *coverage = coverage.from_packet(seq);
        }
        let lost = seq - self.engine.coverage().next_packet().unwrap_or(seq);
        self.counts.packets_lost += lost;
        let is_evt3 = packet.encoding == "evt3";
        if lost > 0 && is_evt3 {
            self.resync = Some(Resync::default());
        }
        let words = match &mut self.resync {
            Some(resync) => resync.words(&packet.events),
            None => packet.events.as_slice().into(),
        };
        self.counts.events_unplaced += self.resync.as_mut().map_or(0, Resync::take_unplaced);
        let Some(decoder) = &mut self.decoder else { unreachable!("it was made") };
        let left_out = |decoder: &EventPackets| decoder.left_out().iter().map(|kind| kind.count).sum::<u64>();
        let before = left_out(decoder);
        if let Err(error) = decoder.decode(time_base, &words) {
            // The state after the fault is unknown, as after a loss.
            self.resync = is_evt3.then(Resync::default);
            self.engine.lose(seq, None, 0);
            return Err(error.into());
        }
        self.counts.left_out += left_out(decoder) - before;
        let events = decoder.events();
        self.engine.take(seq, None, events.len(), |engine, _| engine.push_slice(events));
        Ok(Taken { is_new, lost })
    }

    /// The prediction for the window; `None` before the first packet.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`].
    pub fn predict(&mut self) -> Result<Option<Prediction<'_>>, EngineError> {
        self.engine.predict()
    }

    /// What was taken and lost.
    pub fn counts(&self) -> PacketCounts {
        let counts = self.engine.counts();
        PacketCounts { counts, events_dropped: counts.events - counts.accepted, ..self.counts }
    }
}
