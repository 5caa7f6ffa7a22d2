//! The inference node: events of any number of sensors in, predictions, losses and counts out.
//!
//! Each input is a sensor. In each round the node takes every message that has arrived, then asks the engines of all sensors with news for a
//! prediction, before it waits for the first answer. So a slow machine makes fewer predictions, of more events each.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use dora_node_api::Parameter;
use meissner::Event;

use crate::engine::Network;
use crate::lane::{self, Lane, LaneError, LaneOptions};
use crate::message::{
    Counter, EventsHeader, Loss, PredictionHeader, counters_array, loss_array, metadata, now_ns, read_events,
    values_array,
};
use crate::node::{Failure, Inputs, Message, Outputs, start};

/// Longest wait for what engines still have to do when the dataflow ends.
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
    /// Most events of a sensor that wait for its engine; a message that does not fit is dropped and counted
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
pub(crate) fn run(options: &InferOptions) -> Result<(), Failure> {
    if let Some(folder) = &options.state {
        std::fs::create_dir_all(folder)
            .map_err(|source| Failure::File { path: folder.display().to_string(), source })?;
    }
    let lanes = LaneOptions {
        network: Network::named(&options.network, options.weights.as_deref())?,
        capacity: options.capacity,
        every: Duration::from_millis(options.every_ms),
        states: options.state.clone().map(|folder| (folder, Duration::from_millis(options.save_ms))),
    };
    let (outputs, mut inputs) = start()?;
    let deadline = Duration::from_millis(options.deadline_ms);
    let mut node = Inference::new(outputs, lanes);
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

/// The node with its lanes, by input.
struct Inference {
    outputs: Outputs,
    options: LaneOptions,
    lanes: BTreeMap<String, Lane>,
    /// Messages that queues dropped before the input had a lane.
    dropped: BTreeMap<String, u64>,
    /// Messages that could not be placed, by input.
    refused: BTreeMap<String, u64>,
    /// Messages sent, on any output.
    order: u64,
    events: Vec<Event>,
    saver: Sender<(PathBuf, Vec<u8>)>,
    failed: Receiver<LaneError>,
    saving: thread::JoinHandle<()>,
}

impl Inference {
    fn new(outputs: Outputs, options: LaneOptions) -> Self {
        let (saver, states) = channel::<(PathBuf, Vec<u8>)>();
        let (failing, failed) = channel();
        // A disk may take longer than a prediction.
        let saving = thread::spawn(move || {
            for (path, state) in states {
                // Nobody reads why any more if the node has ended.
                let _ = lane::write(&path, &state).map_err(|error| failing.send(error));
            }
        });
        let (lanes, dropped, refused) = Default::default();
        Self {
            outputs,
            options,
            lanes,
            dropped,
            refused,
            order: 0,
            events: Vec::new(),
            saver,
            failed,
            saving,
        }
    }

    fn note_dropped(&mut self, inputs: &mut Inputs) {
        for (input, count) in inputs.dropped() {
            match self.lanes.get_mut(&input) {
                Some(lane) => lane.dropped(count),
                None => *self.dropped.entry(input).or_default() += count,
            }
        }
    }

    /// Takes a message of events.
    fn take(&mut self, message: &Message, deadline: Duration) -> Result<(), Failure> {
        let input = &message.input;
        let header = match EventsHeader::read(&message.metadata) {
            Ok(header) => header,
            Err(error) => {
                self.refuse(input, &error.to_string());
                return Ok(());
            }
        };
        let failed = |source: LaneError| Failure::Lane { sensor: input.clone(), source: source.into() };
        if let Some(lane) = self.lanes.get(input).filter(|lane| lane.is_other(&header)) {
            if header.boot <= lane.stream() {
                // Of a life of the source that has ended, or of a sensor that changed its size in one life.
                self.refuse(input, "a message of another life of the source");
                return Ok(());
            }
            // What the old life sent is predicted on before it is forgotten.
            self.predict(deadline.max(AT_THE_END), true)?;
            self.lanes.remove(input).map_or(Ok(()), Lane::close).map_err(failed)?;
        }
        if !self.lanes.contains_key(input) {
            let (mut lane, refused) = Lane::start(input, &header, &self.options).map_err(failed)?;
            lane.dropped(self.dropped.remove(input).unwrap_or(0));
            self.lanes.insert(input.clone(), lane);
            if let Some(error) = refused {
                self.outputs.warn(&format!("{input}: the state is not used: {error}"));
            }
        }
        let Some(lane) = self.lanes.get_mut(input) else { return Ok(()) };
        self.events.clear();
        let read = read_events(&message.data, &mut self.events);
        let events = read.is_ok().then_some(&self.events[..]);
        let losses = lane.take(&header, events, message.data.len(), message.received_ns);
        let losses: Vec<Loss> = losses.map_err(failed)?.collect();
        if let Err(error) = read {
            self.refuse(input, &error.to_string());
        }
        losses.iter().try_for_each(|loss| self.lose(input, header.boot, loss))
    }

    /// Counts a message that is none.
    fn refuse(&mut self, input: &str, why: &str) {
        let count = self.refused.entry(input.to_owned()).or_default();
        *count += 1;
        // A source that sends nothing else is reported now and then.
        if count.is_power_of_two() {
            self.outputs.warn(&format!("{input}: {count} messages refused, this one: {why}"));
        }
    }

    fn order(&mut self) -> u64 {
        self.order += 1;
        self.order - 1
    }

    fn lose(&mut self, sensor: &str, stream: i64, loss: &Loss) -> Result<(), Failure> {
        let entries = metadata([
            ("sensor", Parameter::String(sensor.to_owned())),
            ("stream", Parameter::Integer(stream)),
            ("order", Parameter::Integer(self.order() as i64)),
        ]);
        self.outputs.send("losses", entries, loss_array(loss))
    }

    /// Time until the first prediction is due.
    fn until_due(&self) -> Duration {
        self.lanes.values().map(Lane::until_due).min().unwrap_or(Duration::MAX)
    }

    /// Sends a prediction of each sensor for which one is due; with `at_once`, of each sensor with news.
    fn predict(&mut self, deadline: Duration, at_once: bool) -> Result<(), Failure> {
        let is_due = |lane: &Lane| if at_once { lane.has_news() } else { lane.until_due().is_zero() };
        let due = self.lanes.values_mut().filter(|lane| is_due(lane));
        let asked: Vec<_> = due.map(|lane| (lane.ask(deadline), lane)).collect();
        for (asked, lane) in asked {
            let (sensor, stream) = (lane.sensor().to_owned(), lane.stream());
            let answer = lane.answer(&asked, deadline);
            let failed = |source: LaneError| Failure::Lane { sensor: sensor.clone(), source: source.into() };
            let Some(predicted) = answer.map_err(failed)? else { continue };
            let place = predicted.place;
            let header = PredictionHeader {
                sensor,
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
            self.outputs.send("predictions", header.metadata(), values_array(predicted.values))?;
        }
        Ok(())
    }

    /// Has the newest states written.
    fn keep(&mut self) {
        for lane in self.lanes.values_mut() {
            if let Some(state) = lane.collect() {
                // The thread ends with the node.
                let _ = self.saver.send(state);
            }
        }
        for error in self.failed.try_iter() {
            self.outputs.warn(&format!("a state is not kept: {error}"));
        }
    }

    /// Sends the counts.
    fn tell(&mut self) -> Result<(), Failure> {
        let mut counters: Vec<_> = self.lanes.values().flat_map(Lane::counters).collect();
        let refused = self.refused.iter();
        counters.extend(refused.map(|(input, &count)| Counter::new(input, "messages_refused", count)));
        self.outputs.send("counters", metadata([]), counters_array(&counters))
    }

    /// Predicts on what is left, sends the last counts and writes the states.
    fn end(mut self) -> Result<(), Failure> {
        self.predict(AT_THE_END, true)?;
        self.tell()?;
        let Self { lanes, saver, saving, .. } = self;
        drop(saver);
        // It has not panicked, or has said so.
        let _ = saving.join();
        for (sensor, lane) in lanes {
            lane.close().map_err(|source| Failure::Lane { sensor, source: source.into() })?;
        }
        Ok(())
    }
}
