//! How much of the signal, and of each kind of noise, filters keep.
//!
//! Input: streams of simulated events, each with its cause, and filters. Output: for each cause,
//! the number of events and of those that passed. Filters forget all events between two streams.

use std::path::Path;

use meissner_engine::filters::EventFilter;
use meissner_run::approximations::Approximations;
use meissner_run::provenance::{Header, InputCard};
use meissner_simulator::Cause;
use serde::Serialize;

use crate::error::Result;
use crate::streams::Streams;

/// Numbers of events that filters kept.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub streams: usize,
    /// Names of the filters, in the order in which events pass them.
    pub filters: Vec<&'static str>,
    /// All causes, also those without events.
    pub causes: Vec<Kept>,
}

/// Events of a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Kept {
    pub cause: &'static str,
    /// Events before the filters.
    pub events: u64,
    /// Events that passed all filters.
    pub passed: u64,
}

/// Passes the simulated streams in the safetensors file `events` through `filters`.
///
/// # Errors
/// The file cannot be read, does not fit or has no causes; or a filter refuses its setting.
pub fn judge(events: &Path, filters: &Approximations) -> Result<Report> {
    let (streams, causes) = Streams::with_causes(events)?;
    let mut chain = filters.chain(streams.sensor)?;
    let mut kept = Cause::ALL.map(|cause| Kept { cause: cause.name(), events: 0, passed: 0 });
    let (parts, mut causes) = (streams.parts(), causes.iter());
    for part in &parts {
        chain.reset();
        for (&event, &cause) in part.iter().zip(&mut causes) {
            let kept = &mut kept[cause as usize];
            kept.events += 1;
            kept.passed += u64::from(chain.admit(event));
        }
    }
    let name = events.display().to_string();
    let count = parts.iter().map(|part| part.len() as u64).sum();
    let input = InputCard::events(&name, &"safetensors", streams.sensor, Some(count));
    Ok(Report {
        header: Header::of_many("eval filters", input),
        streams: parts.len(),
        filters: chain.filters().iter().map(EventFilter::name).collect(),
        causes: kept.to_vec(),
    })
}
