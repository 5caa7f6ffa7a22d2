//! Converts packets to predictions, one for each packet. Nothing here depends on ROS 2.
//!
//! A new publisher, encoding or sensor, and a falling number begin a new stream.

use meissner_engine::{EngineError, Prediction, Sensor};
use meissner_io::EventPackets;
use meissner_packets::{AnyNetwork, Counts, PacketError, Reason, SensorEngine};
use serde::Serialize;

use crate::messages::EventPacket;

/// A network over the packets of one camera.
pub(crate) struct Inference<P> {
    engine: SensorEngine<(P, String, Sensor, u64)>,
    /// Decoder of the newest stream.
    decoder: Option<EventPackets>,
    /// Number of the stream, so that a stream that begins after a falling number has another name.
    stream: u64,
    counts: PacketCounts,
}

/// Counts of taken and lost data, over all streams.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct PacketCounts {
    /// Counts of the data that the engine got.
    #[serde(flatten)]
    counts: Counts,
    /// Packets that are missing by their `seq`: lost, or dropped because this node was slow.
    packets_lost: u64,
    packets_refused: u64,
    /// Events that the engine dropped: earlier than one before them, or too far in time.
    events_dropped: u64,
    /// Events without a row or a time, at the start of a stream or after a loss.
    events_unplaced: u64,
    /// Words and events that the decoder left out, such as padding.
    left_out: u64,
}

/// The result of taking a packet.
pub(crate) struct Taken {
    /// Whether a stream begins with it.
    pub(crate) is_new: bool,
    /// Packets that are missing before it.
    pub(crate) lost: u64,
}

impl<P: PartialEq> Inference<P> {
    pub(crate) fn new(network: AnyNetwork) -> Self {
        // DDS silently drops a packet that waits too long.
        let engine = SensorEngine::new(network, Reason::QueueOrLink);
        Self { engine, decoder: None, stream: 0, counts: PacketCounts::default() }
    }

    /// Takes a packet of this publisher.
    ///
    /// # Errors
    /// The packet is refused and counted. If its events cannot be decoded, none of it is taken.
    pub(crate) fn take(&mut self, publisher: P, packet: &EventPacket) -> Result<Taken, PacketError> {
        let taken = self.try_take(publisher, packet);
        self.counts.packets_refused += u64::from(taken.is_err());
        taken
    }

    fn try_take(&mut self, publisher: P, packet: &EventPacket) -> Result<Taken, PacketError> {
        let &EventPacket { width, height, seq, time_base, is_bigendian, .. } = packet;
        let side = |pixels: u32| u16::try_from(pixels).ok().filter(|&pixels| pixels > 0);
        let (Some(columns), Some(rows)) = (side(width), side(height)) else {
            let found = format!("{width}x{height}");
            return Err(PacketError::unexpected("sensor", "1 to 65535 pixels a side", &found));
        };
        if is_bigendian {
            let expected = "the least significant byte first";
            return Err(PacketError::unexpected("events", expected, "is_bigendian"));
        }
        let sensor = Sensor::new(columns, rows);
        let falls = self.engine.coverage().next_packet().is_some_and(|next| seq < next);
        let stream = (publisher, packet.encoding.clone(), sensor, self.stream + u64::from(falls));
        if self.engine.stream() != Some(&stream) {
            self.decoder = Some(EventPackets::new(&packet.encoding, sensor)?);
        }
        self.stream += u64::from(falls);
        let is_new = self.engine.begin(stream, sensor)?;
        if is_new {
            let coverage = self.engine.coverage_mut();
            *coverage = coverage.from_packet(seq);
        }
        let lost = seq - self.engine.coverage().next_packet().unwrap_or(seq);
        self.counts.packets_lost += lost;
        let decoder = self.decoder.as_mut().expect("a stream has one");
        if lost > 0 {
            decoder.resync();
        }
        let left_out = |decoder: &EventPackets| decoder.left_out().iter().map(|kind| kind.count).sum::<u64>();
        let (unplaced_before, left_out_before) = (decoder.unplaced(), left_out(decoder));
        if let Err(error) = decoder.decode(time_base, &packet.events) {
            // The following words lack its words, as after a loss.
            decoder.resync();
            self.engine.lose(seq, None, 0);
            return Err(error.into());
        }
        self.counts.events_unplaced += decoder.unplaced() - unplaced_before;
        self.counts.left_out += left_out(decoder) - left_out_before;
        let events = decoder.events();
        self.engine.take(seq, None, events.len(), |engine, _| engine.push_slice(events));
        Ok(Taken { is_new, lost })
    }

    /// The prediction for the window; `None` before the first packet.
    pub(crate) fn predict(&mut self) -> Result<Option<Prediction<'_>>, EngineError> {
        self.engine.predict()
    }

    /// Counts of taken and lost data.
    pub(crate) fn counts(&self) -> PacketCounts {
        let counts = self.engine.counts();
        PacketCounts { counts, events_dropped: counts.events - counts.accepted, ..self.counts }
    }
}
