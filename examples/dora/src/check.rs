//! Checks of records: whether a record accounts for every event and has the bits of a single
//! process, and the latencies of events, hop by hop.
//!
//! An engine in this process ([`Replay`]) gets the events that were accepted according to the
//! record, and predicts where the record has a prediction.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use meissner::{Event, Sensor};
use meissner_packets::{AnyNetwork, Gap, PacketError, Replay};
use meissner_run::latency::Latency;
use serde::Serialize;

use crate::message::PredictionHeader;
use crate::record::{Line, read};
use crate::source::StreamOptions;

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

/// The results of a check.
#[derive(Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Found {
    pub(crate) sensors: usize,
    /// Lives of their sources.
    pub(crate) streams: usize,
    /// Predictions that were compared, bit for bit.
    pub(crate) predictions: u64,
    /// Events that the sources sent.
    pub(crate) sent: u64,
    /// Events that were given to engines.
    pub(crate) accepted: u64,
    /// Events that were not accepted, by reason.
    pub(crate) dropped: BTreeMap<String, u64>,
    /// Lives of the inference node.
    pub(crate) lives: usize,
    /// Messages of the inference node that are not in the record.
    pub(crate) missed: u64,
}

/// Checks the record, and returns the results as text.
///
/// # Errors
/// An event is unaccounted for, a count is wrong, or a prediction has other bits.
pub(crate) fn run(options: &CheckOptions) -> Result<String, PacketError> {
    let network = AnyNetwork::named(&options.network, options.weights.as_deref())?;
    let (sensor, events) = options.stream.recorded()?;
    let found = check(&read(&options.record)?, &network, sensor, &events)?;
    Ok(serde_json::to_string(&found).expect("counts are written without errors"))
}

/// Messages of the inference node about a sensor, in their order.
enum Said<'a> {
    Prediction(&'a PredictionHeader, &'a [f32]),
    Loss(Gap),
}

/// Checks the lines of a record of sources that each sent `events` of `sensor`.
pub(crate) fn check(
    lines: &[Line],
    network: &AnyNetwork,
    sensor: Sensor,
    events: &[Event],
) -> Result<Found, PacketError> {
    check_lines(lines, network, sensor, events).map_err(|error| {
        let missed = lines.iter().filter_map(|line| match line {
            Line::Missed { input, messages, .. } => Some(format!("{messages} of {input}")),
            _ => None,
        });
        let missed: Vec<_> = missed.collect();
        if missed.is_empty() {
            return error;
        }
        PacketError::Record(format!("{error}; the record lacks messages: {}", missed.join(", ")))
    })
}

fn check_lines(
    lines: &[Line],
    network: &AnyNetwork,
    sensor: Sensor,
    events: &[Event],
) -> Result<Found, PacketError> {
    let mut found = Found::default();
    let mut said = BTreeMap::<(&str, i64), Vec<((i64, u64), Said<'_>)>>::new();
    let mut told = BTreeMap::<(&str, &str, &str), u64>::new();
    let mut lives = BTreeSet::new();
    for line in lines {
        match line {
            Line::Prediction { header, values, .. } => {
                let of_sensor = said.entry((&header.sensor, header.stream)).or_default();
                of_sensor.push(((header.boot, header.order), Said::Prediction(header, values)));
                lives.insert(header.boot);
            }
            Line::Loss { header, boot, gap } => {
                let of_sensor = said.entry((&header.sensor, header.stream)).or_default();
                of_sensor.push(((*boot, header.order), Said::Loss(*gap)));
            }
            Line::Counters { counters, .. } => {
                told.extend(counters.iter().map(|c| ((&*c.sensor, &*c.name, &*c.reason), c.value)));
            }
            Line::Missed { messages, .. } => found.missed += messages,
            Line::Command { .. } => (),
        }
    }
    found.lives = lives.len();
    let streams: Vec<_> = said.keys().copied().collect();
    found.streams = streams.len();
    for (&(name, _, _), &sent) in told.iter().filter(|((_, what, _), _)| *what == "events_sent") {
        if sent > 0 && !streams.iter().any(|&(known, _)| known == name) {
            return Err(PacketError::Record(format!("{name}: nothing is said of its {sent} events")));
        }
    }
    for ((name, stream), mut said) in said {
        said.sort_by_key(|&(place, _)| place);
        let wrong = |what: String| PacketError::Record(format!("{name}: {what}"));
        let mut replay = Replay::new(network, sensor, events)?;
        for (_, said) in said {
            match said {
                Said::Loss(gap) => replay.lose(gap)?,
                Said::Prediction(header, values) => {
                    let (place, state) =
                        ((header.next, header.accepted), (values, header.t_us, header.nodes));
                    replay.compare(place, state).map_err(wrong)?;
                    found.predictions += 1;
                }
            }
        }
        // The number of events that a source sent before a restart is not known.
        if streams.iter().any(|&(other, later)| other == name && later > stream) {
            continue;
        }
        found.sensors += 1;
        let count = |what: &str, reason: &str| told.get(&(name, what, reason)).copied();
        let sent =
            count("events_sent", "").ok_or_else(|| wrong("the source has told no count".to_owned()))?;
        let accepted = replay.end(sent).map_err(wrong)?;
        let mut dropped = BTreeMap::new();
        for gap in replay.gaps() {
            *dropped.entry(gap.reason.name().to_owned()).or_default() += gap.until - gap.from;
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

/// Options of the latencies.
#[derive(Clone, Debug, Args)]
pub(crate) struct LatencyOptions {
    /// The record; all nodes must have had the same clock
    record: PathBuf,
}

/// Hops with their ends, in their order.
const HOPS: [(&str, usize, usize); 4] =
    [("source -> inference", 0, 1), ("inference", 1, 2), ("inference -> recorder", 2, 3), ("all", 0, 3)];

/// A table of the latencies in a record.
///
/// # Errors
/// It cannot be read.
pub(crate) fn latencies(options: &LatencyOptions) -> Result<String, PacketError> {
    let (mut hops, mut predictions) = (HOPS.map(|_| Latency::new()), 0);
    for line in read(&options.record)? {
        let Line::Prediction { header, recorded_ns, .. } = line else { continue };
        predictions += 1;
        let times = [header.events_sent_ns, header.events_received_ns, header.sent_ns, recorded_ns];
        for (hop, (_, from, to)) in hops.iter_mut().zip(HOPS) {
            // Times stay positive even if a clock was set back between the two.
            hop.record(Duration::from_nanos((times[to] - times[from]).max(1) as u64));
        }
    }
    let mut table =
        format!("| hop, {predictions} predictions | p50 us | p99 us | largest us |\n|---|---|---|---|\n");
    for ((name, ..), hop) in HOPS.iter().zip(&hops) {
        let [p50, p99, largest] = hop.quantiles().map_or([0.0; 3], |found| [found.p50, found.p99, found.max]);
        writeln!(table, "| {name} | {p50:.0} | {p99:.0} | {largest:.0} |")
            .expect("a string takes everything");
    }
    Ok(table)
}
