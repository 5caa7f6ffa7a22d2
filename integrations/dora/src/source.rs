//! The source node: events of a recording at real speed or another, or those that arrive on a stream, as messages.
//!
//! Every event has a number, and each message that of its first event. While there is nothing to send, messages without events tell the number
//! of the next one, so that a receiver knows what it has missed, also at the end.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use clap::Args;
use dora_node_api::Parameter;
use meissner::{Event, Sensor};
use meissner_pipeline::PipelineError;
use meissner_pipeline::clock::Clock;

use crate::message::{Counter, counters_array, events_array, metadata};
use crate::node::{Failure, Inputs, Outputs, start};
use crate::stream::{Stream, StreamOptions};

/// Longest time until an end of the dataflow is noticed.
const NAP: Duration = Duration::from_millis(50);

/// Options of the source node.
#[derive(Clone, Debug, Args)]
pub(crate) struct SourceOptions {
    #[command(flatten)]
    stream: StreamOptions,
    /// Seconds of stream time per second; 0 sends a recording as fast as the node can
    #[arg(long, default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Microseconds between two messages: events that come in this time are sent together
    #[arg(long, value_name = "US", default_value_t = 1000)]
    every_us: u64,
    /// Most events of a message
    #[arg(long, value_name = "EVENTS", default_value_t = 2048, value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    most: u64,
    /// Milliseconds between two messages without events, while there is nothing to send
    #[arg(long, value_name = "MS", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    idle_ms: u64,
    /// Milliseconds for which messages without events are sent after the end
    #[arg(long, value_name = "MS", default_value_t = 1000)]
    linger_ms: u64,
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed: &f64| speed.is_finite() && *speed >= 0.0);
    speed.ok_or_else(|| format!("expected a number of at least 0, got {text}"))
}

/// Runs the node until everything was sent, or the dataflow ends.
///
/// # Errors
/// The recording cannot be read, or the daemon cannot be reached.
pub(crate) fn run(options: &SourceOptions) -> Result<(), Failure> {
    let (sensor, stream) = options.stream.open()?;
    let (outputs, inputs) = start()?;
    let mut node = Node::new(outputs, inputs, sensor, options);
    match stream {
        Stream::Recorded(events) => node.play(&events, options.speed)?,
        Stream::Arriving(events) => node.pass_on(&events)?,
    }
    let until = Instant::now() + Duration::from_millis(options.linger_ms);
    while Instant::now() < until && !node.has_ended() {
        node.idle()?;
        std::thread::sleep(node.idle.min(NAP));
    }
    node.tell()
}

struct Node {
    outputs: Outputs,
    inputs: Inputs,
    sensor: Sensor,
    name: String,
    most: usize,
    every: Duration,
    idle: Duration,
    /// When the last message was sent, and the last counts.
    sent: Instant,
    told: Instant,
    events: u64,
    messages: u64,
    /// Longest time from when an event was due until it was sent.
    lag: Duration,
}

impl Node {
    fn new(outputs: Outputs, inputs: Inputs, sensor: Sensor, options: &SourceOptions) -> Self {
        let (name, now) = (outputs.name(), Instant::now());
        Self {
            outputs,
            inputs,
            sensor,
            name,
            most: options.most as usize,
            every: Duration::from_micros(options.every_us),
            idle: Duration::from_millis(options.idle_ms),
            sent: now,
            told: now,
            events: 0,
            messages: 0,
            lag: Duration::ZERO,
        }
    }

    fn has_ended(&mut self) -> bool {
        // A source has no inputs; what comes is the end of the dataflow.
        self.inputs.take(Duration::ZERO);
        self.inputs.have_ended()
    }

    /// Sends each of `events` when it is due. One whose time steps back is sent with the event before it.
    fn play(&mut self, events: &[Event], speed: f64) -> Result<(), Failure> {
        let start = Instant::now();
        let clock = Clock::new(start, events.first().map_or(0, |event| event.t_us), speed);
        let at = |event: &Event| if speed > 0.0 { clock.at(event.t_us) } else { start };
        let mut rest = events;
        while !rest.is_empty() && !self.has_ended() {
            let now = Instant::now();
            let due = rest.iter().take_while(|event| at(event) <= now).count();
            let (sent, later) = rest.split_at(due);
            rest = later;
            if let Some(event) = sent.first() {
                self.lag = self.lag.max(now.saturating_duration_since(at(event)));
            }
            self.send(sent)?;
            self.idle()?;
            let next = rest.first().map_or(now, at).max(now + self.every);
            std::thread::sleep(next.saturating_duration_since(Instant::now()).min(self.idle.min(NAP)));
        }
        Ok(())
    }

    /// Sends what arrives, until the stream ends.
    fn pass_on(&mut self, events: &Receiver<Result<Event, PipelineError>>) -> Result<(), Failure> {
        let mut taken = Vec::with_capacity(self.most);
        while !self.has_ended() {
            let ended = loop {
                match events.try_recv() {
                    Ok(event) => taken.push(event?),
                    Err(error) => break error == TryRecvError::Disconnected,
                }
                if taken.len() == self.most {
                    break false;
                }
            };
            self.send(&taken)?;
            taken.clear();
            self.idle()?;
            if ended {
                break;
            }
            std::thread::sleep(self.every);
        }
        Ok(())
    }

    /// Sends `events` in messages.
    fn send(&mut self, events: &[Event]) -> Result<(), Failure> {
        for events in events.chunks(self.most) {
            self.send_one(events)?;
        }
        Ok(())
    }

    /// Sends a message without events, and counts, if it is time.
    fn idle(&mut self) -> Result<(), Failure> {
        if self.sent.elapsed() >= self.idle {
            self.send_one(&[])?;
        }
        if self.told.elapsed() >= self.idle { self.tell() } else { Ok(()) }
    }

    fn send_one(&mut self, events: &[Event]) -> Result<(), Failure> {
        let header = metadata([
            ("first", Parameter::Integer(self.events as i64)),
            ("width", Parameter::Integer(self.sensor.width.into())),
            ("height", Parameter::Integer(self.sensor.height.into())),
        ]);
        self.sent = Instant::now();
        self.outputs.send("events", header, events_array(events))?;
        self.events += events.len() as u64;
        self.messages += 1;
        Ok(())
    }

    fn tell(&mut self) -> Result<(), Failure> {
        self.told = Instant::now();
        let counters = [
            Counter::new(&self.name, "events_sent", self.events),
            Counter::new(&self.name, "messages_sent", self.messages),
            Counter::new(&self.name, "lag_us", self.lag.as_micros() as u64),
        ];
        self.outputs.send("counters", metadata([]), counters_array(&counters))
    }
}
