//! Several sensors side by side, whose engines other threads run.
//!
//! Input: events and predictions, as they are reported. Output: a frame, if a page waits for one
//! and the last is old enough. It shows all sensors, and one that a page selects in detail.
//! Invariant: no engine is read, and none waits.

use std::collections::VecDeque;

use meissner_engine::{Event, Sensor};

use crate::command::Command;
use crate::facts::{Facts, Info, SensorFacts};
use crate::frame::{Bytes, FrameWriter, LIVE, PLAYING};
use crate::latency::Latency;
use crate::networks::Chosen;
use crate::pace::Pace;
use crate::series::Series;
use crate::server::Server;

/// Number of shown events of the selected sensor.
const EVENTS: usize = 2048;
/// Number of shown events of another sensor.
const FEW: usize = 400;

/// Whether a prediction is up to date.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// It covers all events.
    #[default]
    Fresh,
    /// It covers only some events.
    Behind,
    /// It is an earlier prediction.
    Old,
}

/// A prediction of a sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Report<'a> {
    /// Stream time since the first event in microseconds.
    pub elapsed_us: i64,
    /// A value for each output.
    pub values: &'a [f32],
    /// Events in the window.
    pub nodes: usize,
    /// How unlike the window is to those of the training, if that is known.
    pub unlike: Option<f32>,
    /// Duration of the prediction, or of the wait for it, in microseconds.
    pub took_us: f64,
    /// Whether the prediction is up to date.
    pub state: State,
    /// Events that wait.
    pub waiting: u64,
    /// Events that the queue dropped since the previous report.
    pub dropped: u64,
    /// Events that the engine dropped since the previous report.
    pub lost: u64,
}

/// The known data of a sensor.
#[derive(Debug)]
struct Watched {
    /// The newest events.
    window: VecDeque<Event>,
    taken: u64,
    elapsed_us: i64,
    values: Vec<f32>,
    nodes: usize,
    unlike: Option<f32>,
    state: State,
    waiting: u64,
    dropped: u64,
    lost: u64,
    series: Series,
    latency: Latency,
    /// Its p50 and p99 some frames ago.
    quantiles_us: [f32; 2],
}

impl Watched {
    fn new() -> Self {
        Self {
            window: VecDeque::with_capacity(EVENTS),
            taken: 0,
            elapsed_us: 0,
            values: Vec::new(),
            nodes: 0,
            unlike: None,
            state: State::Fresh,
            waiting: 0,
            dropped: 0,
            lost: 0,
            series: Series::new(None),
            latency: Latency::default(),
            quantiles_us: [f32::NAN; 2],
        }
    }

    /// Writes its newest `count` events of the last `span_us`, oldest first: EVNT.
    fn write(&self, count: usize, span_us: i64, to: &mut Bytes<'_>) {
        let shown = self.shown(count, span_us);
        let now_us = self.window.back().map_or(0, |event| event.t_us);
        for event in self.window.range(self.window.len() - shown..) {
            let age = now_us.saturating_sub(event.t_us).clamp(0, i64::from(i32::MAX)) as u32;
            to.u16(event.x);
            to.u16(event.y);
            to.u32(age << 1 | u32::from(event.on));
        }
    }

    /// Number of these events.
    fn shown(&self, count: usize, span_us: i64) -> usize {
        let now_us = self.window.back().map_or(0, |event| event.t_us);
        let newest = self.window.iter().rev().take(count);
        newest.take_while(|event| now_us.saturating_sub(event.t_us) <= span_us).count()
    }
}

/// Shows sensors on a page.
#[derive(Debug)]
pub struct Sensors {
    server: Server,
    outputs: usize,
    span_us: i64,
    watched: Vec<Watched>,
    selected: usize,
    /// The sensor whose quantiles are computed next.
    turn: usize,
    pace: Pace,
}

impl Sensors {
    /// Shows sensors with these names on `server`'s page. Their engines run the network `chosen`,
    /// called `name`.
    pub fn new<N>(
        server: Server,
        sensors: &[(String, Sensor)],
        span_us: i64,
        name: &str,
        chosen: &Chosen<N>,
    ) -> Self {
        let fact = |(name, sensor): &(String, Sensor)| SensorFacts {
            name: name.clone(),
            size: [sensor.width, sensor.height],
        };
        let input = match sensors {
            [(name, _)] => name.clone(),
            _ => format!("{} sensors", sensors.len()),
        };
        let size = sensors.first().map_or([1, 1], |(_, sensor)| [sensor.width, sensor.height]);
        let facts = Facts {
            kind: "sensors",
            span_us,
            sensors: sensors.iter().map(fact).collect(),
            ..Facts::empty(&input, size, name, chosen)
        };
        let mut to = FrameWriter::new();
        to.json(*b"FACT", &facts);
        server.hub().set_facts(to.finish());
        let (outputs, watched) = (chosen.outputs.len(), sensors.iter().map(|_| Watched::new()).collect());
        Self { server, outputs, span_us, watched, selected: 0, turn: 0, pace: Pace::default() }
    }

    /// Takes an event of a sensor.
    pub fn event(&mut self, sensor: usize, event: Event) {
        let Some(of) = self.watched.get_mut(sensor) else { return };
        if of.window.len() == EVENTS {
            of.window.pop_front();
        }
        of.window.push_back(event);
        of.taken += 1;
    }

    /// Takes a prediction of a sensor, and shows all sensors if a frame is due.
    pub fn report(&mut self, sensor: usize, report: &Report<'_>) {
        let Some(of) = self.watched.get_mut(sensor) else { return };
        of.elapsed_us = report.elapsed_us;
        of.values.clear();
        of.values.extend_from_slice(report.values);
        (of.nodes, of.unlike, of.state, of.waiting) =
            (report.nodes, report.unlike, report.state, report.waiting);
        of.dropped += report.dropped;
        of.lost += report.lost;
        of.latency.record(report.took_us);
        of.series.add(report.elapsed_us, report.values);
        if self.server.hub().wants_frame() {
            while let Some(command) = self.server.hub().command() {
                self.obey(&command);
            }
            if self.pace.is_due() {
                self.show();
                self.pace.done();
            }
        }
    }

    fn obey(&mut self, command: &str) {
        if let Ok(Command::Select { sensor }) = serde_json::from_str(command) {
            self.selected = sensor.min(self.watched.len().saturating_sub(1));
            self.pace.hurry();
        }
    }

    /// Computes the quantiles of one sensor per call, because all together would take milliseconds.
    fn measure(&mut self) {
        self.turn = (self.turn + 1) % self.watched.len().max(1);
        for (i, of) in self.watched.iter_mut().enumerate() {
            if i == self.turn || of.latency.measured() < FEW as u64 {
                of.quantiles_us = of.latency.quantiles_us([0.5, 0.99]);
            }
        }
    }

    fn show(&mut self) {
        self.measure();
        let Some(of) = self.watched.get(self.selected) else { return };
        let mut to = FrameWriter::new();
        to.section(*b"TIME", |to| {
            let (now, taken) = (of.elapsed_us as f64, of.taken as f64);
            [now, now, taken, taken].into_iter().for_each(|value| to.f64(value));
            to.f32(1.0);
            to.u32(PLAYING | LIVE);
        });
        to.section(*b"TIPS", |to| self.all(to));
        to.section(*b"EVNT", |to| of.write(EVENTS, self.span_us, to));
        to.section(*b"PRED", |to| {
            to.count(self.outputs);
            to.count(of.nodes);
            to.f32(of.unlike.unwrap_or(f32::NAN));
            to.f32(of.latency.newest_us().unwrap_or(f32::NAN));
            self.values(of, to);
            (0..self.outputs).for_each(|_| to.f32(f32::NAN));
        });
        to.section(*b"SERS", |to| of.series.write(self.outputs, to));
        to.section(*b"LATE", |to| of.latency.write(to));
        let dropped = [("by_the_engine", of.lost)].into_iter().filter(|(_, count)| *count > 0).collect();
        to.json(*b"INFO", &Info { dropped, queue: Some((of.waiting, of.dropped)), ..Info::default() });
        self.server.hub().publish(to.finish());
    }

    fn values(&self, of: &Watched, to: &mut Bytes<'_>) {
        (0..self.outputs).for_each(|i| to.f32(of.values.get(i).copied().unwrap_or(f32::NAN)));
    }

    /// The section TIPS.
    fn all(&self, to: &mut Bytes<'_>) {
        to.count(self.watched.len());
        to.count(self.selected);
        to.count(self.outputs);
        for of in &self.watched {
            to.u32(of.state as u32);
            to.f32s(&of.quantiles_us);
            to.f32(of.latency.newest_us().unwrap_or(f32::NAN));
            [of.taken, of.dropped, of.lost].into_iter().for_each(|count| to.f64(count as f64));
            self.values(of, to);
            to.count(of.shown(FEW, self.span_us));
            of.write(FEW, self.span_us, to);
        }
    }
}
