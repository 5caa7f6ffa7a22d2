//! For tests: an inference node without a dataflow, which writes its own record.

use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use meissner::{Event, Sensor};

use crate::engine::Network;
use crate::lane::{Lane, LaneOptions};
use crate::message::{Counter, EventsHeader, Loss, PredictionHeader};
use crate::record::Line;
use crate::stream::StreamOptions;

/// Name of the sensor.
pub(crate) const FINGER: &str = "finger";

/// Life of the source.
pub(crate) const STREAM: i64 = 7;

/// Enough for a test on a busy machine.
const DEADLINE: Duration = Duration::from_mins(2);

/// A small network, made once.
pub(crate) fn network() -> Network {
    static NETWORK: OnceLock<Network> = OnceLock::new();
    NETWORK.get_or_init(|| Network::named("tactigraph-past", None).unwrap()).clone()
}

/// A small network over frames of events.
pub(crate) fn frame_network() -> Network {
    Network::named("force-lstm", None).unwrap()
}

/// The sensor and the first events of the embedded recording.
pub(crate) fn recording(events: usize) -> (Sensor, Vec<Event>) {
    let (sensor, mut all) = StreamOptions { runs: 1, ..StreamOptions::default() }.recorded().unwrap();
    all.truncate(events);
    (sensor, all)
}

/// A node with one lane.
pub(crate) struct Node {
    pub(crate) lane: Lane,
    /// Its record.
    pub(crate) lines: Vec<Line>,
    boot: i64,
    order: u64,
    sensor: Sensor,
}

impl Node {
    /// The node in its life `boot`, which goes on from the state in `states`.
    pub(crate) fn start(sensor: Sensor, boot: i64, capacity: usize, states: Option<&Path>) -> Self {
        Self::running(network(), sensor, boot, capacity, states)
    }

    /// The same with another network.
    pub(crate) fn running(
        network: Network,
        sensor: Sensor,
        boot: i64,
        capacity: usize,
        states: Option<&Path>,
    ) -> Self {
        let states = states.map(|folder| (folder.to_owned(), Duration::ZERO));
        let options = LaneOptions { network, capacity, every: Duration::ZERO, states };
        let (lane, refused) = Lane::start(FINGER, &header(sensor, STREAM, 0, 0), &options).unwrap();
        assert!(refused.is_none(), "{refused:?}");
        Self { lane, lines: Vec::new(), boot, order: 0, sensor }
    }

    /// Takes the message of this number, whose events begin with `first`.
    pub(crate) fn take(&mut self, number: u64, first: usize, events: &[Event]) {
        let header = header(self.sensor, STREAM, number, first as u64);
        let losses: Vec<_> = self.lane.take(&header, Some(events), events.len(), 0).unwrap().collect();
        losses.into_iter().for_each(|loss| self.lose(loss));
    }

    /// Takes a message that cannot be read.
    pub(crate) fn take_malformed(&mut self, number: u64, first: usize, len: usize) {
        let header = header(self.sensor, STREAM, number, first as u64);
        let losses: Vec<_> = self.lane.take(&header, None, len, 0).unwrap().collect();
        losses.into_iter().for_each(|loss| self.lose(loss));
    }

    fn lose(&mut self, loss: Loss) {
        let (sensor, order) = (FINGER.to_owned(), self.order);
        self.order += 1;
        self.lines.push(Line::Loss { sensor, stream: STREAM, boot: self.boot, order, loss });
    }

    /// Predicts, if there is something new.
    pub(crate) fn predict(&mut self) {
        let asked = self.lane.ask(DEADLINE);
        let Some(predicted) = self.lane.answer(&asked, DEADLINE).unwrap() else { return };
        let header = PredictionHeader {
            sensor: FINGER.to_owned(),
            stream: STREAM,
            boot: self.boot,
            number: self.order,
            order: self.order,
            next: predicted.place.next,
            accepted: predicted.place.accepted,
            t_us: predicted.t_us,
            nodes: predicted.nodes as u64,
            fresh: predicted.fresh,
            events_sent_ns: 0,
            events_received_ns: 0,
            sent_ns: 0,
        };
        self.order += 1;
        self.lines.push(Line::Prediction { header, recorded_ns: 0, values: predicted.values.to_vec() });
    }

    /// The whole record, with the counts of this node and of a source that sent `sent` events.
    pub(crate) fn record(&self, sent: u64) -> Vec<Line> {
        let mut counters: Vec<_> = self.lane.counters().collect();
        counters.push(Counter::new(FINGER, "events_sent", sent));
        let mut lines = self.lines.clone();
        lines.push(Line::Counters { boot: self.boot, counters });
        lines
    }
}

/// The header of a message.
pub(crate) fn header(sensor: Sensor, boot: i64, number: u64, first: u64) -> EventsHeader {
    EventsHeader { boot, number, first, sent_ns: 0, sensor }
}
