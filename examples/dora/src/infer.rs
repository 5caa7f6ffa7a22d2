//! The inference node: events of any number of sensors in, predictions, losses and counts out.
//!
//! Each input is a sensor. In each round the node takes every message that has arrived. Then it
//! requests a prediction from the engines of all sensors with news, before it waits for the first
//! answer. So a slow machine makes fewer predictions, each of more events.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use meissner::Event;
use meissner_packets::{
    AnyNetwork, Gap, LiveOptions, LiveSensor, PacketError, Reason, StateWriter, failed, now_ns,
};
use meissner_run::error::chain;

use crate::message::{
    Counter, EventsHeader, LossHeader, PredictionHeader, Stamp, read, read_events, texts_array, values_array,
};
use crate::node::{Inputs, Message, Outputs, start};

/// Longest wait for the remaining work of engines when the dataflow ends.
const AT_THE_END: Duration = Duration::from_secs(2);

/// Options of the inference node.
#[derive(Clone, Debug, Args)]
pub(crate) struct InferOptions {
    /// Name of a shipped network over events or frames of them, or path of its description
    #[arg(long, default_value = "tactigraph-past")]
    network: String,
    /// File with its weights; without it, those that are shipped
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Milliseconds that a prediction may take; then it covers the events that the engine has taken
    #[arg(long, value_name = "MS", default_value_t = 20)]
    deadline_ms: u64,
    /// Milliseconds between two predictions of a sensor; 0 predicts whenever there is news
    #[arg(long, value_name = "MS", default_value_t = 0)]
    every_ms: u64,
    /// Most events of a sensor that wait for its engine; a message that does not fit is dropped and
    /// counted
    #[arg(long, value_name = "EVENTS", default_value_t = 65_536)]
    capacity: usize,
    /// Folder where the state of each sensor's engine is kept, from which a restarted node goes on
    #[arg(long, value_name = "FOLDER")]
    state: Option<PathBuf>,
    /// Milliseconds between two states
    #[arg(long, value_name = "MS", default_value_t = 100)]
    save_ms: u64,
    /// Milliseconds between two messages of counts
    #[arg(long, value_name = "MS", default_value_t = 200)]
    counters_ms: u64,
}

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The daemon cannot be reached, a state cannot be read, or an engine fails.
pub(crate) fn run(options: &InferOptions) -> Result<(), PacketError> {
    if let Some(folder) = &options.state {
        std::fs::create_dir_all(folder).map_err(failed(folder.display().to_string()))?;
    }
    let sensors = LiveOptions {
        network: AnyNetwork::named(&options.network, options.weights.as_deref())?,
        capacity: options.capacity,
        every: Duration::from_millis(options.every_ms),
        states: options.state.clone().map(|folder| (folder, Duration::from_millis(options.save_ms))),
    };
    let (outputs, mut inputs) = start()?;
    let deadline = Duration::from_millis(options.deadline_ms);
    let mut node = Inference::new(outputs, sensors);
    let every = Duration::from_millis(options.counters_ms);
    let mut told = Instant::now();
    while !inputs.have_ended() {
        let messages = inputs.take(node.until_due().min(every));
        node.note_dropped(&mut inputs);
        for message in messages {
            node.take(&message, deadline)?;
        }
        node.predict(deadline, false)?;
        node.keep();
        if told.elapsed() >= every {
            told = Instant::now();
            node.tell()?;
        }
    }
    node.end()
}

/// The node with its sensors, by input.
struct Inference {
    outputs: Outputs,
    options: LiveOptions,
    sensors: BTreeMap<String, LiveSensor>,
    /// Messages that queues dropped before the input had a sensor.
    dropped: BTreeMap<String, u64>,
    /// Messages that could not be assigned, by input.
    refused: BTreeMap<String, u64>,
    /// Messages sent, on any output.
    order: u64,
    events: Vec<Event>,
    writer: StateWriter,
}

/// An engine of `sensor` cannot continue.
fn of_sensor(sensor: &str) -> impl FnOnce(PacketError) -> PacketError {
    failed(format!("sensor {sensor}"))
}

impl Inference {
    fn new(outputs: Outputs, options: LiveOptions) -> Self {
        let (sensors, dropped, refused, events, writer) = Default::default();
        Self { outputs, options, sensors, dropped, refused, order: 0, events, writer }
    }

    fn note_dropped(&mut self, inputs: &mut Inputs) {
        for (input, count) in inputs.dropped() {
            match self.sensors.get_mut(&input) {
                Some(sensor) => sensor.dropped(count),
                None => *self.dropped.entry(input).or_default() += count,
            }
        }
    }

    /// Takes a message of events.
    fn take(&mut self, message: &Message, deadline: Duration) -> Result<(), PacketError> {
        let input = &message.input;
        let headers = read::<Stamp>(&message.metadata)
            .and_then(|stamp| Ok((stamp, read::<EventsHeader>(&message.metadata)?)));
        let (stamp, header) = match headers {
            Ok(headers) => headers,
            Err(error) => {
                self.refuse(input, &chain(&error));
                return Ok(());
            }
        };
        let geometry = header.sensor();
        if let Some(sensor) = self.sensors.get(input).filter(|sensor| sensor.is_other(stamp.boot, geometry)) {
            if stamp.boot <= sensor.stream() {
                // The message belongs to an ended life of the source, or to a sensor that changed
                // its size in one life.
                self.refuse(input, "a message of another life of the source");
                return Ok(());
            }
            // The events of the old life get a prediction before they are forgotten.
            self.predict(deadline.max(AT_THE_END), true)?;
            self.sensors.remove(input).map_or(Ok(()), LiveSensor::close).map_err(of_sensor(input))?;
        }
        if !self.sensors.contains_key(input) {
            let started = LiveSensor::start(input, stamp.boot, geometry, &self.options);
            let (mut sensor, refused) = started.map_err(of_sensor(input))?;
            sensor.dropped(self.dropped.remove(input).unwrap_or(0));
            self.sensors.insert(input.clone(), sensor);
            if let Some(error) = refused {
                self.outputs.warn(&format!("{input}: the state is not used: {error}"));
            }
        }
        let Some(sensor) = self.sensors.get_mut(input) else { return Ok(()) };
        self.events.clear();
        let events = read_events(&message.data, &mut self.events);
        let place = (stamp.number, header.first, message.data.len());
        let times_ns = [stamp.sent_ns, message.received_ns];
        let gaps = sensor.take(place, events.is_ok().then_some(&self.events[..]), times_ns);
        let gaps: Vec<Gap> = gaps.map_err(of_sensor(input))?.collect();
        if let Err(error) = events {
            self.refuse(input, &chain(&error));
        }
        gaps.into_iter().try_for_each(|gap| self.lose(input, stamp.boot, gap))
    }

    /// Counts a malformed message.
    fn refuse(&mut self, input: &str, why: &str) {
        let count = self.refused.entry(input.to_owned()).or_default();
        *count += 1;
        // A source that sends nothing else is reported from time to time.
        if count.is_power_of_two() {
            self.outputs.warn(&format!("{input}: {count} messages refused, this one: {why}"));
        }
    }

    fn lose(&mut self, sensor: &str, stream: i64, gap: Gap) -> Result<(), PacketError> {
        let header = LossHeader { sensor: sensor.to_owned(), stream, order: self.order };
        self.order += 1;
        self.outputs.send("losses", &header, texts_array(&[gap]))
    }

    /// Time until the first prediction is due.
    fn until_due(&self) -> Duration {
        self.sensors.values().map(LiveSensor::until_due).min().unwrap_or(Duration::MAX)
    }

    /// Sends due predictions of the sensors; with `at_once`, of all sensors with news.
    fn predict(&mut self, deadline: Duration, at_once: bool) -> Result<(), PacketError> {
        let is_due = |sensor: &LiveSensor| {
            if at_once { sensor.has_news() } else { sensor.until_due().is_zero() }
        };
        let due = self.sensors.values_mut().filter(|sensor| is_due(sensor));
        let asked: Vec<_> = due.map(|sensor| (sensor.ask(deadline), sensor)).collect();
        for (asked, sensor) in asked {
            let (name, stream) = (sensor.name().to_owned(), sensor.stream());
            let answer = sensor.answer(&asked, deadline).map_err(of_sensor(&name))?;
            let Some(predicted) = answer else { continue };
            let place = predicted.place;
            let header = PredictionHeader {
                sensor: name,
                stream,
                boot: self.outputs.boot(),
                number: 0,
                order: self.order,
                next: place.next,
                accepted: place.accepted,
                t_us: predicted.t_us,
                nodes: predicted.nodes as u64,
                fresh: predicted.fresh,
                events_sent_ns: place.sent_ns,
                events_received_ns: place.received_ns,
                sent_ns: now_ns(),
            };
            self.order += 1;
            self.outputs.send("predictions", &header, values_array(predicted.values))?;
        }
        Ok(())
    }

    /// Starts writing the newest states.
    fn keep(&mut self) {
        self.sensors.values_mut().filter_map(LiveSensor::collect).for_each(|state| self.writer.write(state));
        for error in self.writer.failures() {
            self.outputs.warn(&format!("a state is not kept: {error}"));
        }
    }

    /// Sends the counts.
    fn tell(&mut self) -> Result<(), PacketError> {
        let mut all: Vec<_> = self.sensors.values().flat_map(counters).collect();
        let refused = self.refused.iter();
        all.extend(refused.map(|(input, &count)| Counter::new(input, "messages_refused", count)));
        self.outputs.send("counters", &(), texts_array(&all))
    }

    /// Predicts for the remaining events, sends the last counts and writes the states.
    fn end(mut self) -> Result<(), PacketError> {
        self.predict(AT_THE_END, true)?;
        self.tell()?;
        self.writer.close();
        self.sensors.into_iter().try_for_each(|(name, sensor)| sensor.close().map_err(of_sensor(&name)))
    }
}

/// Counts of a sensor since the start of its source.
pub(crate) fn counters(sensor: &LiveSensor) -> Vec<Counter> {
    let ((predictions, ignored), coverage, name) = (sensor.counts(), sensor.coverage(), sensor.name());
    let mut counters = vec![
        Counter::new(name, "events_known", coverage.next),
        Counter::new(name, "events_accepted", coverage.accepted),
        Counter::new(name, "messages_late", coverage.late),
        Counter::new(name, "predictions", predictions),
    ];
    let dropped = Reason::ALL.into_iter().map(Reason::name).zip(coverage.lost.map(|lost| lost.events));
    // Accepted events that the engine does not use.
    let ignored = ignored.into_iter().map(|(reason, count)| ("events_ignored", reason.name(), count));
    let by_reason = dropped.map(|(reason, count)| ("events_dropped", reason, count)).chain(ignored);
    counters.extend(by_reason.map(|(what, reason, count)| Counter::with_reason(name, what, reason, count)));
    counters
}
