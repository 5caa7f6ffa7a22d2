//! Packets into predictions. Nothing here knows ROS 2.
//!
//! There is a prediction for each packet, after its events. A new publisher, a number that falls, and another encoding or sensor begin a new
//! stream: its times have nothing to do with those before, so that the window is empty again.

use std::sync::Arc;

use meissner_engine::{Engine, EngineError, Network, Prediction, Sensor};
use meissner_io::EventPackets;
use serde::Serialize;

use crate::error::Refused;
use crate::messages::EventPacket;
use crate::resync::Resync;

/// A network over the packets of one camera.
#[derive(Debug)]
pub struct Inference<P> {
    network: Arc<Network>,
    stream: Option<Stream<P>>,
    counts: Counts,
}

/// A stream of packets.
#[derive(Debug)]
struct Stream<P> {
    publisher: P,
    encoding: String,
    next_seq: u64,
    packets: EventPackets,
    /// Since a loss, for encoding `evt3`.
    resync: Option<Resync>,
    engine: Engine,
}

/// What was taken and lost, over all streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Streams that began.
    pub streams: u64,
    /// Packets that were taken.
    pub packets: u64,
    /// Packets that are missing by their `seq`: lost on the way, or dropped where they wait because this node was too slow.
    pub packets_lost: u64,
    /// Packets that were refused.
    pub packets_refused: u64,
    /// Events pushed.
    pub events: u64,
    /// Of those, dropped by the engine: earlier than one before them, or too far in time.
    pub events_dropped: u64,
    /// Events without a row or a time after a loss.
    pub events_unplaced: u64,
    /// Words and events that the decoder left out: padding, reserved words, events outside the sensor or of another system.
    pub left_out: u64,
    /// Predictions.
    pub predictions: u64,
}

/// What a packet brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Whether a stream begins with it.
    pub is_new: bool,
    /// Packets that are missing before it.
    pub lost: u64,
    /// Events pushed.
    pub events: u64,
}

impl<P: PartialEq> Inference<P> {
    /// Predictions of `network`.
    pub fn new(network: impl Into<Arc<Network>>) -> Self {
        Self { network: network.into(), stream: None, counts: Counts::default() }
    }

    /// Takes a packet of this publisher.
    ///
    /// # Errors
    /// The packet is refused and counted. If its events cannot be decoded, those before the fault are left out too.
    pub fn take(&mut self, publisher: P, packet: &EventPacket) -> Result<Taken, Refused> {
        let taken = self.try_take(publisher, packet);
        match &taken {
            Ok(_) => self.counts.packets += 1,
            Err(_) => self.counts.packets_refused += 1,
        }
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
        let goes_on = self.stream.as_ref().is_some_and(|stream| {
            stream.publisher == publisher
                && stream.encoding == packet.encoding
                && stream.engine.sensor() == sensor
                && stream.next_seq <= seq
        });
        if !goes_on {
            let packets = EventPackets::new(&packet.encoding, sensor)?;
            // Everything of an engine is allocated when it is made: the one that is there is used again if it fits.
            let engine = match self.stream.take().map(|stream| stream.engine) {
                Some(mut engine) if engine.sensor() == sensor => {
                    engine.reset();
                    engine
                }
                _ => Engine::new(Arc::clone(&self.network), sensor)?,
            };
            let (encoding, next_seq, resync) = (packet.encoding.clone(), seq, None);
            self.stream = Some(Stream { publisher, encoding, next_seq, packets, resync, engine });
            self.counts.streams += 1;
        }
        let Some(stream) = &mut self.stream else { unreachable!("it was made") };
        let lost = seq - stream.next_seq;
        stream.next_seq = seq.saturating_add(1);
        self.counts.packets_lost += lost;
        let is_evt3 = packet.encoding == "evt3";
        if lost > 0 && is_evt3 {
            stream.resync = Some(Resync::default());
        }
        let words = match &mut stream.resync {
            Some(resync) => resync.words(&packet.events),
            None => packet.events.as_slice().into(),
        };
        self.counts.events_unplaced += stream.resync.as_mut().map_or(0, Resync::take_unplaced);
        let left_out = |packets: &EventPackets| packets.left_out().iter().map(|kind| kind.count).sum::<u64>();
        let before = left_out(&stream.packets);
        stream.packets.decode(time_base, &words).inspect_err(|_| {
            // The state after the fault is unknown, as after a loss.
            stream.resync = is_evt3.then(Resync::default);
        })?;
        self.counts.left_out += left_out(&stream.packets) - before;
        let events = stream.packets.events();
        let accepted = stream.engine.push_slice(events) as u64;
        let events = events.len() as u64;
        self.counts.events += events;
        self.counts.events_dropped += events - accepted;
        Ok(Taken { is_new: !goes_on, lost, events })
    }

    /// The prediction for the window; `None` before the first packet.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`].
    pub fn predict(&mut self) -> Result<Option<Prediction<'_>>, EngineError> {
        let Some(stream) = &mut self.stream else { return Ok(None) };
        let prediction = stream.engine.predict()?;
        self.counts.predictions += 1;
        Ok(Some(prediction))
    }

    /// What was taken and lost.
    pub fn counts(&self) -> Counts {
        self.counts
    }
}
