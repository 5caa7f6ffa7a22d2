//! The controller: in each cycle, the newest prediction of each sensor, and a command.
//!
//! A cycle waits for predictions until its deadline, or until every known sensor has a new one. A
//! sensor whose prediction is new gets a command of [`ControlOptions::turn`]. If its newest
//! prediction is of events older than the limit, it gets a command that turns nothing, so that its
//! motion stops. Between the two, the command of a cycle without news also turns nothing, because
//! its prediction was already used.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use clap::Args;
use meissner_packets::{PacketError, now_ns};

use crate::message::{CommandHeader, Counter, PredictionHeader, read, read_values, texts_array, turn_array};
use crate::node::{Inputs, Outputs, start};

/// Options of the controller.
#[derive(Clone, Debug, Args)]
pub(crate) struct ControlOptions {
    /// Milliseconds between two cycles
    #[arg(long, value_name = "MS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) period_ms: u64,
    /// Milliseconds from the begin of a cycle until its command is sent at the latest
    #[arg(long, value_name = "MS", default_value_t = 5)]
    pub(crate) deadline_ms: u64,
    /// Share of a predicted angle that one command turns
    #[arg(long, default_value_t = 0.1)]
    pub(crate) gain: f64,
    /// Largest turn of one command in radians
    #[arg(long, value_name = "RADIANS", default_value_t = 0.05)]
    pub(crate) limit: f64,
    /// Milliseconds after which events are too old to act on
    #[arg(long, value_name = "MS", default_value_t = 100)]
    pub(crate) oldest_ms: u64,
}

impl ControlOptions {
    /// The turn in radians about x and y for a prediction of roll and pitch: a share of it, which
    /// averages errors. Without two finite values there is no turn.
    pub(crate) fn turn(&self, predicted: &[f32]) -> [f64; 2] {
        let turn = |angle: f32| (self.gain * f64::from(angle)).clamp(-self.limit, self.limit);
        match *predicted {
            [roll, pitch] if roll.is_finite() && pitch.is_finite() => [turn(roll), turn(pitch)],
            _ => [0.0; 2],
        }
    }
}

/// The controller's data about a sensor.
#[derive(Debug, Default)]
struct Known {
    /// Sending time of the events of its newest prediction, and its values.
    newest: Option<(i64, Vec<f32>)>,
    /// Whether no command was made from it yet.
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
pub(crate) fn run(options: &ControlOptions) -> Result<(), PacketError> {
    let (mut outputs, mut inputs) = start()?;
    let [period, deadline] = [options.period_ms, options.deadline_ms].map(Duration::from_millis);
    let mut known = BTreeMap::<String, Known>::new();
    let (mut due, mut told) = (Instant::now(), Instant::now());
    while !inputs.have_ended() {
        wait(&mut inputs, &mut known, due, due, &outputs);
        wait(&mut inputs, &mut known, due + deadline, due, &outputs);
        for (sensor, known) in &mut known {
            command(&mut outputs, sensor, known, options)?;
        }
        if told.elapsed() >= Duration::from_millis(200) {
            told = Instant::now();
            tell(&mut outputs, &known)?;
        }
        // A missed cycle is not repeated.
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
            let read = read::<PredictionHeader>(&message.metadata);
            match read.and_then(|header| Ok((header, read_values(&message.data)?))) {
                Ok((header, values)) => {
                    let known = known.entry(header.sensor).or_default();
                    known.newest = Some((header.events_sent_ns, values));
                    known.is_new = true;
                }
                Err(error) => outputs.warn_of(&message, &error),
            }
        }
    }
}

/// Sends the command of this cycle for a sensor.
fn command(
    outputs: &mut Outputs,
    sensor: &str,
    known: &mut Known,
    options: &ControlOptions,
) -> Result<(), PacketError> {
    let Some((sent_ns, values)) = &known.newest else { return Ok(()) };
    let age_ns = now_ns() - sent_ns;
    let is_old = age_ns > options.oldest_ms as i64 * 1_000_000;
    let fresh = std::mem::take(&mut known.is_new) && !is_old;
    known.cycles[if is_old { 2 } else { usize::from(!fresh) }] += 1;
    let header = CommandHeader { sensor: sensor.to_owned(), fresh, age_ns };
    outputs.send("commands", &header, turn_array(if fresh { options.turn(values) } else { [0.0; 2] }))
}

fn tell(outputs: &mut Outputs, known: &BTreeMap<String, Known>) -> Result<(), PacketError> {
    let cycles = known.iter().flat_map(|(sensor, known)| {
        let counts = CYCLES.into_iter().zip(known.cycles);
        counts.map(|(name, count)| Counter::with_reason(sensor, "control_cycles", name, count))
    });
    outputs.send("counters", &(), texts_array(&cycles.collect::<Vec<_>>()))
}
