//! Nodes of dora dataflows: events, inference with Meissner, control, records and metrics.
//!
//! ```text
//! source --events--> infer --predictions--> control --commands--> record
//!   |                  |-- predictions, losses, counters --------> record
//!   +---- counters ----+-- predictions, counters ----------------> metrics
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`message`] | messages between the nodes, as Arrow arrays |
//! | [`node`] | numbered messages out and in |
//! | [`source`] | events of a recording or a stream, when they are due |
//! | [`infer`] | an engine for each input: `meissner_packets`, between dora's inputs and outputs |
//! | [`control`] | commands by a deadline |
//! | [`record`], [`metrics`] | messages in a file, and metrics for Prometheus |
//! | [`check`] | a record against a single process; the latencies of hops |
//!
//! Invariant: every event that a source sent is covered by a prediction or counted as dropped with
//! a reason, and a prediction has the bits of an engine in one process with the same events.

mod check;
mod control;
mod infer;
mod message;
mod metrics;
mod node;
mod record;
mod source;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use clap::Parser;
use meissner_run::error::chain;

/// Nodes of dora dataflows, and what to do with their records
#[derive(Parser)]
#[command(version)]
enum Arguments {
    /// Node: sends the events of a recording or of a stream
    Source(source::SourceOptions),
    /// Node: predicts from the events of any number of sensors
    Infer(infer::InferOptions),
    /// Node: turns predictions of contact angles into commands, by a deadline
    Control(control::ControlOptions),
    /// Node: writes predictions, losses, counts and commands to a file
    Record(record::RecordOptions),
    /// Node: serves counts and latencies to Prometheus
    Metrics(metrics::MetricsOptions),
    /// Checks a record against a single process
    Check(check::CheckOptions),
    /// Shows the latencies in a record
    Latency(check::LatencyOptions),
}

fn main() -> ExitCode {
    let done = match Arguments::parse() {
        Arguments::Source(options) => source::run(&options),
        Arguments::Infer(options) => infer::run(&options),
        Arguments::Control(options) => control::run(&options),
        Arguments::Record(options) => record::run(&options),
        Arguments::Metrics(options) => metrics::run(&options),
        Arguments::Check(options) => check::run(&options).map(|found| println!("{found}")),
        Arguments::Latency(options) => check::latencies(&options).map(|table| print!("{table}")),
    };
    let Err(error) = done else { return ExitCode::SUCCESS };
    eprintln!("error: {}", chain(&error));
    ExitCode::FAILURE
}
