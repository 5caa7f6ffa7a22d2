//! The source node: events of a recording at a speed, or of a stream, as messages.
//!
//! Each message has the number of its first event. While there is nothing to send, messages without
//! events contain the next number, so that a receiver knows which events it has missed.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use meissner::io::ReadOptions;
use meissner::{Event, Sensor};
use meissner_packets::{FeedOptions, PacketError, feed};
use meissner_run::RunError;
use meissner_run::source::Source;
use meissner_run::text::sensor;

use crate::message::{Counter, EventsHeader, events_array, texts_array};
use crate::node::{Outputs, start};

/// Longest time until an end of the dataflow is noticed.
const NAP: Duration = Duration::from_millis(50);

/// Stream time between two runs of a recording, in microseconds.
pub(crate) const PAUSE_US: i64 = 10_000;

/// Which events a source sends.
#[derive(Clone, Debug, Args)]
#[cfg_attr(test, derive(Default))]
pub(crate) struct StreamOptions {
    /// A recording, or a stream such as udp://HOST:PORT; without it, the embedded recording of a
    /// simulated press
    pub(crate) recording: Option<PathBuf>,
    /// Columns and rows of the sensor, for a recording or a stream that does not state them
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = sensor)]
    pub(crate) sensor: Option<Sensor>,
    /// How often a recording is sent, one run after the other; its times go on
    #[arg(long, default_value_t = 1)]
    pub(crate) runs: u32,
}

impl StreamOptions {
    /// The source and the geometry of its sensor. Waits for the first event of a stream unless the
    /// geometry is given.
    fn open(&self) -> Result<(Sensor, Source), RunError> {
        let source =
            Source::open(self.recording.as_deref(), &ReadOptions::default(), self.sensor.is_some(), false)?;
        Ok((source.sensor(self.sensor)?, source))
    }

    /// The sensor of a recording and all events of its runs.
    ///
    /// # Errors
    /// The recording cannot be read, or its geometry is not known.
    pub(crate) fn recorded(&self) -> Result<(Sensor, Vec<Event>), RunError> {
        let (sensor, source) = self.open()?;
        let events = source.collect::<Result<Vec<_>, _>>()?;
        Ok((sensor, repeated(&events, self.runs)))
    }
}

/// `events`, `runs` times; each run begins a pause after the end of the run before.
pub(crate) fn repeated(events: &[Event], runs: u32) -> Vec<Event> {
    let times = || events.iter().map(|event| event.t_us);
    let (Some(first), Some(last)) = (times().min(), times().max()) else { return Vec::new() };
    let span = last.saturating_sub(first).saturating_add(PAUSE_US);
    let run = |run: u32| {
        let later = span.saturating_mul(run.into());
        events.iter().map(move |&event| Event { t_us: event.t_us.saturating_add(later), ..event })
    };
    (0..runs).flat_map(run).collect()
}

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
pub(crate) fn run(options: &SourceOptions) -> Result<(), PacketError> {
    let (sensor, source) = options.stream.open()?;
    let is_live = source.is_live();
    let events: Box<dyn Iterator<Item = _> + Send> = if is_live {
        Box::new(source)
    } else {
        let events = source.collect::<Result<Vec<_>, _>>()?;
        Box::new(repeated(&events, options.stream.runs).into_iter().map(Ok))
    };
    let (outputs, mut inputs) = start()?;
    let idle = Duration::from_millis(options.idle_ms);
    let (now, name) = (Instant::now(), outputs.name());
    let counts = [0, 0, 0];
    let mut node = Node { outputs, sensor, name, idle, sent: now, told: now, counts };
    // A source has no inputs; the only event is the end of the dataflow.
    let mut has_ended = || {
        inputs.take(Duration::ZERO);
        inputs.have_ended()
    };
    let (every, max_wait) = (Duration::from_micros(options.every_us), idle.min(NAP));
    let feeding =
        FeedOptions { is_live, speed: options.speed, every, max_wait, max_events: options.most as usize };
    feed(events, feeding, &mut has_ended, |events, due| node.pass_on(events, due))?;
    let until = Instant::now() + Duration::from_millis(options.linger_ms);
    while Instant::now() < until && !has_ended() {
        node.pass_on(&[], Instant::now())?;
        std::thread::sleep(max_wait);
    }
    node.tell()
}

/// Names of the counts of a [`Node`].
const COUNTS: [&str; 3] = ["events_sent", "messages_sent", "lag_us"];

struct Node {
    outputs: Outputs,
    sensor: Sensor,
    name: String,
    idle: Duration,
    /// Times of the last message and of the last counts.
    sent: Instant,
    told: Instant,
    /// Events and messages that were sent, and the longest delay of an event in microseconds.
    counts: [u64; 3],
}

impl Node {
    /// Sends and counts events, the first of which was due at `due`, or an empty message if one is
    /// due.
    fn pass_on(&mut self, events: &[Event], due: Instant) -> Result<(), PacketError> {
        if !events.is_empty() || self.sent.elapsed() >= self.idle {
            let [width, height] = [self.sensor.width, self.sensor.height]
                .map(|side| side.try_into().expect("a sensor has pixels"));
            let header = EventsHeader { first: self.counts[0], width, height };
            self.sent = Instant::now();
            self.counts[2] = self.counts[2].max(due.elapsed().as_micros() as u64);
            self.outputs.send("events", &header, events_array(events))?;
            self.counts[0] += events.len() as u64;
            self.counts[1] += 1;
        }
        if self.told.elapsed() >= self.idle { self.tell() } else { Ok(()) }
    }

    fn tell(&mut self) -> Result<(), PacketError> {
        self.told = Instant::now();
        let counters =
            COUNTS.iter().zip(self.counts).map(|(name, count)| Counter::new(&self.name, name, count));
        self.outputs.send("counters", &(), texts_array(&counters.collect::<Vec<_>>()))
    }
}
