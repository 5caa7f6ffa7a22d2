//! How long events took from the source to the record, hop by hop.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use hdrhistogram::Histogram;

use crate::node::Failure;
use crate::record::{Line, read};

/// Options of the latencies.
#[derive(Clone, Debug, Args)]
pub(crate) struct LatencyOptions {
    /// The record; all nodes must have had the same clock
    record: PathBuf,
}

/// Hops, in their order.
const HOPS: [&str; 4] = ["source -> inference", "inference", "inference -> recorder", "all"];

/// Longest time that is told from others, in nanoseconds: ten minutes.
const LONGEST: u64 = 600_000_000_000;

/// A table of the latencies in a record.
///
/// # Errors
/// It cannot be read.
pub(crate) fn run(options: &LatencyOptions) -> Result<String, Failure> {
    let empty = || Histogram::<u64>::new_with_bounds(1, LONGEST, 3).expect("the bounds are valid");
    let mut hops = HOPS.map(|_| empty());
    for line in read(&options.record)? {
        let Line::Prediction { header, recorded_ns, .. } = line else { continue };
        let times = [header.events_sent_ns, header.events_received_ns, header.sent_ns, recorded_ns];
        let ends = [(0, 1), (1, 2), (2, 3), (0, 3)];
        for (hop, (from, to)) in hops.iter_mut().zip(ends) {
            // A clock that was set back between the two makes no time negative.
            hop.saturating_record((times[to] - times[from]).max(1) as u64);
        }
    }
    let mut table =
        format!("| hop, {} predictions | p50 us | p99 us | largest us |\n|---|---|---|---|\n", hops[0].len());
    for (name, hop) in HOPS.iter().zip(&hops) {
        let us = |ns: u64| ns / 1000;
        let (p50, p99) = (us(hop.value_at_quantile(0.5)), us(hop.value_at_quantile(0.99)));
        writeln!(table, "| {name} | {p50} | {p99} | {} |", us(hop.max())).expect("a string takes everything");
    }
    Ok(table)
}
