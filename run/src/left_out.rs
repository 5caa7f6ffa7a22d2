//! What a reader left out of a recording or took for granted, told to the user.

use meissner_io::{LeftOut, LeftOutKind, Recording};
use serde::Serialize;

use crate::text::grouped;

/// What was left out of a recording for one reason.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutSummary {
    /// `outside_sensor`, `other_words`, `other_events`, `malformed` or `lines`.
    kind: &'static str,
    /// How many.
    count: u64,
    /// The first of them, with its place.
    first: String,
}

impl From<&LeftOut> for LeftOutSummary {
    fn from(left_out: &LeftOut) -> Self {
        let first = left_out.first.first().cloned().unwrap_or_default();
        Self { kind: left_out.kind.name(), count: left_out.count, first }
    }
}

/// A sentence about what was left out.
pub fn sentence(LeftOut { kind, count, first }: &LeftOut) -> String {
    let first = first.first().map_or_else(String::new, |first| format!("; the first: {first}"));
    format!("{} {kind} left out{first}", grouped(*count))
}

/// Logs what was left out of the recording called `name`, and what was taken for granted.
pub(crate) fn warn(name: &str, recording: &Recording) {
    for assumed in &recording.assumed {
        tracing::warn!("{name}: {assumed}");
    }
    for left_out in &recording.left_out {
        if left_out.kind != LeftOutKind::Lines {
            tracing::warn!("{name}: {}", sentence(left_out));
            continue;
        }
        for problem in &left_out.first {
            tracing::warn!("{name}: {problem}");
        }
        if left_out.count > left_out.first.len() as u64 {
            tracing::warn!("{name}: more lines are refused; the summary says how many");
        }
    }
}
