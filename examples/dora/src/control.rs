//! The controller: in each cycle, the newest prediction of each sensor by a deadline, and a command
//! from it.
//!
//! A cycle waits for predictions until its deadline, or until every known sensor has a new one. A
//! sensor whose prediction is new gets a command of the [`Law`]. One whose newest prediction is of
//! events older than the limit gets a command that turns nothing, so that what it moves stops;
//! between the two, the command of a cycle without news turns nothing either, since its prediction
//! was already acted on.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use clap::Args;
use meissner_packets::now_ns;

use crate::message::{CommandHeader, Counter, PredictionHeader, read, read_values, texts_array, turn_array};
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

/// The law: from predicted angles to a turn.
///
/// A network for contact angles predicts by which roll and pitch the touched plane is tilted.
/// Turning the fingertip by that levels it. The law turns by a share of the prediction, so that
/// errors of single predictions are averaged, and by no more than a limit in one command.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    /// Share of the predicted angle, for each command.
    gain: f64,
    /// Largest turn of a command in radians, in each direction.
    limit: f64,
}

impl Law {
    /// The turn in radians about x and y for a prediction of roll and pitch in radians. Without two
    /// finite values there is no turn.
    fn turn(&self, predicted: &[f32]) -> [f64; 2] {
        let turn = |angle: f32| (self.gain * f64::from(angle)).clamp(-self.limit, self.limit);
        match *predicted {
            [roll, pitch] if roll.is_finite() && pitch.is_finite() => [turn(roll), turn(pitch)],
            _ => [0.0; 2],
        }
    }
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
            let read = read::<PredictionHeader>(&message.metadata);
            match read.and_then(|header| Ok((header, read_values(&message.data)?))) {
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
    let header = CommandHeader { sensor: sensor.to_owned(), fresh, age_ns };
    outputs.send("commands", &header, turn_array(if fresh { law.turn(values) } else { [0.0; 2] }))
}

fn tell(outputs: &mut Outputs, known: &BTreeMap<String, Known>) -> Result<(), Failure> {
    let cycles = |(sensor, known): (&String, &Known)| {
        let counts = CYCLES.into_iter().zip(known.cycles);
        let counter =
            |(name, count): (&str, u64)| Counter::with_reason(sensor, "control_cycles", name, count);
        counts.map(counter).collect::<Vec<_>>()
    };
    let counters: Vec<_> = known.iter().flat_map(cycles).collect();
    outputs.send("counters", &(), texts_array(&counters))
}

#[cfg(test)]
mod tests {
    use super::Law;

    #[test]
    fn a_turn_is_a_share_of_the_prediction_within_the_limit_and_what_is_no_pair_of_angles_turns_nothing() {
        let law = Law { gain: 0.5, limit: 0.1 };
        assert_eq!(law.turn(&[0.125, -0.0625]), [0.0625, -0.03125]);
        assert_eq!(law.turn(&[7.0, -7.0]), [0.1, -0.1]);
        for predicted in [&[][..], &[0.1], &[0.1, 0.1, 0.1], &[f32::NAN, 0.1], &[0.1, f32::INFINITY]] {
            assert_eq!(law.turn(predicted), [0.0; 2]);
        }
    }
}
