//! Whether a record accounts for every event, and has the bits of a single process.
//!
//! An engine in this process is given the events that the record says were accepted, and predicts where the record has a prediction. After a
//! restart of the inference node, the record goes back to the event that the restored state ends with; so does this engine.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use meissner::live::Predictor;
use meissner::{Event, Sensor};
use meissner_pipeline::PipelineError;
use serde::Serialize;

use crate::engine::{Engine, Network};
use crate::message::{Loss, PredictionHeader};
use crate::node::Failure;
use crate::record::{Line, read};
use crate::stream::StreamOptions;

/// Options of the check.
#[derive(Clone, Debug, Args)]
pub(crate) struct CheckOptions {
    /// The record
    record: PathBuf,
    #[command(flatten)]
    stream: StreamOptions,
    /// The network that predicted
    #[arg(long, default_value = "tactigraph-past")]
    network: String,
    /// File with its weights
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
}

/// What a check has found.
#[derive(Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Found {
    /// Sensors in the record.
    pub(crate) sensors: usize,
    /// Lives of their sources.
    pub(crate) streams: usize,
    /// Predictions that were compared, bit for bit.
    pub(crate) predictions: u64,
    /// Events that the sources sent.
    pub(crate) sent: u64,
    /// Events that were given to engines.
    pub(crate) accepted: u64,
    /// Events that were not, by reason.
    pub(crate) dropped: BTreeMap<String, u64>,
    /// Lives of the inference node.
    pub(crate) lives: usize,
    /// Messages of the inference node that are not in the record.
    pub(crate) missed: u64,
}

/// Checks the record, and prints what was found.
///
/// # Errors
/// An event is neither predicted on nor counted as dropped, a count is wrong, or a prediction has other bits.
pub(crate) fn run(options: &CheckOptions) -> Result<String, Failure> {
    let network = Network::named(&options.network, options.weights.as_deref())?;
    let (sensor, events) = options.stream.recorded()?;
    let found = check(&read(&options.record)?, &network, sensor, &events)?;
    Ok(serde_json::to_string(&found).expect("counts are written without errors"))
}

/// What the inference node said of a sensor, in the order in which it did.
enum Said<'a> {
    Prediction(&'a PredictionHeader, &'a [f32]),
    Loss(&'a Loss),
}

/// Checks the lines of a record of sources that each sent `events` of `sensor`.
pub(crate) fn check(
    lines: &[Line],
    network: &Network,
    sensor: Sensor,
    events: &[Event],
) -> Result<Found, Failure> {
    check_lines(lines, network, sensor, events).map_err(|failure| {
        let missed = lines.iter().filter_map(|line| match line {
            Line::Missed { input, messages, .. } => Some(format!("{messages} of {input}")),
            _ => None,
        });
        let missed: Vec<_> = missed.collect();
        if missed.is_empty() {
            return failure;
        }
        Failure::Check(format!("{failure}; the record lacks messages: {}", missed.join(", ")))
    })
}

fn check_lines(
    lines: &[Line],
    network: &Network,
    sensor: Sensor,
    events: &[Event],
) -> Result<Found, Failure> {
    let mut found = Found::default();
    let mut said = BTreeMap::<(&str, i64), Vec<((i64, u64), Said<'_>)>>::new();
    let mut told = BTreeMap::<(&str, &str, &str), u64>::new();
    let mut lives = Vec::new();
    for line in lines {
        match line {
            Line::Prediction { header, values, .. } => {
                let of_sensor = said.entry((&header.sensor, header.stream)).or_default();
                of_sensor.push(((header.boot, header.order), Said::Prediction(header, values)));
                lives.push(header.boot);
            }
            Line::Loss { sensor, stream, boot, order, loss } => {
                said.entry((sensor, *stream)).or_default().push(((*boot, *order), Said::Loss(loss)));
            }
            Line::Counters { counters, .. } => {
                told.extend(counters.iter().map(|c| ((&*c.sensor, &*c.name, &*c.reason), c.value)));
            }
            Line::Missed { messages, .. } => found.missed += messages,
            Line::Command { .. } => (),
        }
    }
    lives.sort_unstable();
    lives.dedup();
    found.lives = lives.len();
    let streams: Vec<_> = said.keys().copied().collect();
    found.streams = streams.len();
    for (&(name, _, _), &sent) in told.iter().filter(|((_, what, _), _)| *what == "events_sent") {
        if sent > 0 && !streams.iter().any(|&(known, _)| known == name) {
            return Err(Failure::Check(format!("{name}: nothing is said of its {sent} events")));
        }
    }
    for ((name, stream), mut said) in said {
        said.sort_by_key(|&(place, _)| place);
        let wrong = |what: String| Failure::Check(format!("{name}: {what}"));
        let mut judge = Judge::new(network, sensor, events)?;
        for (_, said) in said {
            match said {
                Said::Loss(loss) => judge.lose(loss)?,
                Said::Prediction(header, values) => {
                    judge.predict(header, values).map_err(wrong)?;
                    found.predictions += 1;
                }
            }
        }
        // A source that was restarted has several streams. How much of the earlier ones it sent is not known.
        if streams.iter().any(|&(other, later)| other == name && later > stream) {
            continue;
        }
        found.sensors += 1;
        let count = |what: &str, reason: &str| told.get(&(name, what, reason)).copied();
        let sent =
            count("events_sent", "").ok_or_else(|| wrong("the source has told no count".to_owned()))?;
        let accepted = judge.end(sent).map_err(wrong)?;
        let mut dropped = BTreeMap::new();
        for loss in &judge.losses {
            *dropped.entry(loss.reason.clone()).or_default() += loss.until - loss.from;
        }
        let of_node = (count("events_known", ""), count("events_accepted", ""));
        if of_node != (Some(sent), Some(accepted)) {
            return Err(wrong(format!(
                "expected counts of {sent} known and {accepted} accepted, got {of_node:?}"
            )));
        }
        for (&(_, _, reason), &value) in
            told.iter().filter(|((of, what, _), _)| (*of, *what) == (name, "events_dropped"))
        {
            let expected = dropped.get(reason).copied().unwrap_or(0);
            if value != expected {
                return Err(wrong(format!("dropped for {reason}: expected {expected}, got {value}")));
            }
        }
        found.sent += sent;
        found.accepted += accepted;
        dropped.into_iter().for_each(|(reason, count)| *found.dropped.entry(reason).or_default() += count);
    }
    Ok(found)
}

/// The single process that a sensor's predictions are compared with.
struct Judge<'a> {
    network: &'a Network,
    sensor: Sensor,
    events: &'a [Event],
    engine: Engine,
    /// Number of the next event.
    next: u64,
    /// In order, without overlaps.
    losses: Vec<Loss>,
}

impl<'a> Judge<'a> {
    fn new(network: &'a Network, sensor: Sensor, events: &'a [Event]) -> Result<Self, PipelineError> {
        let engine = network.engine(sensor)?;
        Ok(Self { network, sensor, events, engine, next: 0, losses: Vec::new() })
    }

    /// Takes a loss. One that begins before what is known is that of a restored node, which knows nothing after the state that it restored.
    fn lose(&mut self, loss: &Loss) -> Result<(), PipelineError> {
        self.losses.retain(|known| known.from < loss.from);
        if let Some(last) = self.losses.last_mut() {
            last.until = last.until.min(loss.from);
        }
        if loss.from < self.next {
            self.engine = self.network.engine(self.sensor)?;
            self.next = 0;
            self.advance(loss.from);
        }
        self.losses.push(loss.clone());
        Ok(())
    }

    /// Events that were lost before the event of this number.
    fn lost_before(&self, next: u64) -> u64 {
        let losses = self.losses.iter().filter(|loss| loss.from < next);
        losses.map(|loss| loss.until.min(next) - loss.from).sum()
    }

    /// Gives the engine the accepted events before the event of this number.
    fn advance(&mut self, next: u64) {
        for number in self.next..next {
            let place = self.losses.partition_point(|loss| loss.until <= number);
            if self.losses.get(place).is_none_or(|loss| number < loss.from) {
                self.engine.push(self.events[number as usize]);
            }
        }
        self.next = self.next.max(next);
    }

    /// Compares a prediction with that of the engine.
    fn predict(&mut self, header: &PredictionHeader, values: &[f32]) -> Result<(), String> {
        let PredictionHeader { next, accepted, .. } = *header;
        let most = self.events.len() as u64;
        if next < self.next || next > most {
            return Err(format!("expected a prediction up to event {} to {most}, got {next}", self.next));
        }
        self.advance(next);
        let expected = next - self.lost_before(next);
        if accepted != expected {
            return Err(format!("up to event {next}: expected {expected} accepted events, got {accepted}"));
        }
        let own = self.engine.predict().map_err(|error| error.to_string())?;
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let (is_equal, t_us, nodes) = (bits(own.values) == bits(values), own.t_us, own.nodes as u64);
        if (true, t_us, nodes) != (is_equal, header.t_us, header.nodes) {
            let [own, found] = [own.values, values].map(|values| format!("{values:?}"));
            return Err(format!(
                "up to event {next}: expected {own} of {nodes} events at {t_us:?}, got {found} of {} at {:?}",
                header.nodes, header.t_us
            ));
        }
        Ok(())
    }

    /// Whether every one of `sent` events is predicted on or lost; the number of those that were accepted.
    fn end(&self, sent: u64) -> Result<u64, String> {
        let mut covered = self.next;
        for loss in &self.losses {
            if loss.from > covered {
                return Err(format!(
                    "events {covered} to {} are neither predicted on nor dropped",
                    loss.from
                ));
            }
            covered = covered.max(loss.until);
        }
        if covered != sent || sent > self.events.len() as u64 {
            return Err(format!("expected {sent} events, of {}, got {covered}", self.events.len()));
        }
        Ok(sent - self.lost_before(sent))
    }
}

#[cfg(test)]
mod tests;
