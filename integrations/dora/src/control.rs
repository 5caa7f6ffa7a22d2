//! The controller: in each cycle, the newest prediction of each sensor by a deadline, and a command from it.
//!
//! A cycle waits for predictions until its deadline, or until every known sensor has a new one. A sensor whose prediction is new gets a command
//! of the [law](crate::law). One whose newest prediction is of events older than the limit gets a command that turns nothing, so that what it
//! moves stops; between the two, the command of a cycle without news turns nothing either, since its prediction was already acted on.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use clap::Args;
use dora_node_api::Parameter;

use crate::law::Law;
use crate::message::{Counter, PredictionHeader, counters_array, metadata, now_ns, read_values, turn_array};
use crate::node::{Failure, Inputs, Outputs, start};

/// Options of the controller.
#[derive(Clone, Debug, Args)]
pub(crate) struct ControlOptions {
    /// Milliseconds between two cycles
    #[arg(long, value_name = "MS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    period_ms: u64,
    /// Milliseconds from the begin of a cycle until its command is sent at the latest
    #[arg(long, value_name = "MS", default_value_t = 5)]
    deadline_ms: u64,
    /// Share of a predicted angle that one command turns
    #[arg(long, default_value_t = 0.1)]
    gain: f64,
    /// Largest turn of one command in radians
    #[arg(long, value_name = "RADIANS", default_value_t = 0.05)]
    limit: f64,
    /// Milliseconds after which events are too old to act on
    #[arg(long, value_name = "MS", default_value_t = 100)]
    oldest_ms: u64,
}

/// What the controller knows of a sensor.
#[derive(Debug, Default)]
struct Known {
    /// When the events of its newest prediction were sent, and its values.
    newest: Option<(i64, Vec<f32>)>,
    /// Whether no command was made of it.
    is_new: bool,
    /// Cycles with a new prediction, without one, and with one of events that were too old.
    cycles: [u64; 3],
}

/// Names of the counts of [`Known::cycles`].
const CYCLES: [&str; 3] = ["fresh", "repeated", "too_old"];

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The daemon cannot be reached.
pub(crate) fn run(options: &ControlOptions) -> Result<(), Failure> {
    let (mut outputs, mut inputs) = start()?;
    let law = Law { gain: options.gain, limit: options.limit };
    let [period, deadline, oldest] =
        [options.period_ms, options.deadline_ms, options.oldest_ms].map(Duration::from_millis);
    let mut known = BTreeMap::<String, Known>::new();
    let (mut due, mut told) = (Instant::now(), Instant::now());
    while !inputs.have_ended() {
        wait(&mut inputs, &mut known, due, due, &outputs);
        wait(&mut inputs, &mut known, due + deadline, due, &outputs);
        for (sensor, known) in &mut known {
            command(&mut outputs, sensor, known, law, oldest)?;
        }
        if told.elapsed() >= Duration::from_millis(200) {
            told = Instant::now();
            tell(&mut outputs, &known)?;
        }
        // A cycle that was missed is not made up for.
        due = (due + period).max(Instant::now());
    }
    tell(&mut outputs, &known)
}

/// Takes predictions until `until`, or, from `due` on, until every sensor has a new one.
fn wait(
    inputs: &mut Inputs,
    known: &mut BTreeMap<String, Known>,
    until: Instant,
    due: Instant,
    outputs: &Outputs,
) {
    loop {
        let now = Instant::now();
        let complete = !known.is_empty() && known.values().all(|known| known.is_new);
        if inputs.have_ended() || now >= until || (now >= due && complete) {
            return;
        }
        for message in inputs.take(until - now) {
            let read = PredictionHeader::read(&message.metadata)
                .and_then(|header| Ok((header, read_values(&message.data)?)));
            match read {
                Ok((header, values)) => {
                    let known = known.entry(header.sensor).or_default();
                    known.newest = Some((header.events_sent_ns, values));
                    known.is_new = true;
                }
                Err(error) => outputs.warn(&format!("{}: {error}", message.input)),
            }
        }
    }
}

/// Sends the command of this cycle for a sensor.
fn command(
    outputs: &mut Outputs,
    sensor: &str,
    known: &mut Known,
    law: Law,
    oldest: Duration,
) -> Result<(), Failure> {
    let Some((sent_ns, values)) = &known.newest else { return Ok(()) };
    let age_ns = now_ns() - sent_ns;
    let is_old = u128::try_from(age_ns).is_ok_and(|age| age > oldest.as_nanos());
    let fresh = std::mem::take(&mut known.is_new) && !is_old;
    known.cycles[if is_old { 2 } else { usize::from(!fresh) }] += 1;
    let entries = metadata([
        ("sensor", Parameter::String(sensor.to_owned())),
        ("fresh", Parameter::Bool(fresh)),
        ("age_ns", Parameter::Integer(age_ns)),
    ]);
    outputs.send("commands", entries, turn_array(if fresh { law.turn(values) } else { [0.0; 2] }))
}

fn tell(outputs: &mut Outputs, known: &BTreeMap<String, Known>) -> Result<(), Failure> {
    let cycles = |(sensor, known): (&String, &Known)| {
        let counts = CYCLES.into_iter().zip(known.cycles);
        let counter =
            |(name, count): (&str, u64)| Counter::with_reason(sensor, "control_cycles", name, count);
        counts.map(counter).collect::<Vec<_>>()
    };
    let counters: Vec<_> = known.iter().flat_map(cycles).collect();
    outputs.send("counters", metadata([]), counters_array(&counters))
}
