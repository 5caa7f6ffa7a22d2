//! How long events took from the source to the record, hop by hop.

use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use meissner_run::latency::Latency;

use crate::node::Failure;
use crate::record::{Line, read};

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
pub(crate) fn run(options: &LatencyOptions) -> Result<String, Failure> {
    let (mut hops, mut predictions) = (HOPS.map(|_| Latency::new()), 0);
    for line in read(&options.record)? {
        let Line::Prediction { header, recorded_ns, .. } = line else { continue };
        predictions += 1;
        let times = [header.events_sent_ns, header.events_received_ns, header.sent_ns, recorded_ns];
        for (hop, (_, from, to)) in hops.iter_mut().zip(HOPS) {
            // A clock that was set back between the two makes no time negative.
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
