//! Pages of results, and refused files.

mod pages;
mod reading;

use crate::{Outcome, ReportError, Truths, read};

/// A header of `command` with an output in `unit`.
pub(super) fn header(command: &str, unit: &str) -> String {
    format!(
        r#"{{"header":{{"meissner":"0.1.0","schema":1,"command":"{command}","input":{{"name":"a/press.es","format":"ES","sensor":[32,24],"events":9}},"made":{{"arguments":["meissner","{command}","it's"],"machine":{{"processor":"P","processors":2,"system":"linux x86_64","isa":"avx2"}}}},"network":{{"name":"own"}},"outputs":[{{"name":"force","unit":"{unit}","range":null}}],"classes":null,"warnings":[]}}}}"#
    )
}

/// A prediction.
pub(super) fn prediction(t_us: u64, value: f64) -> String {
    format!(
        r#"{{"t_us":{t_us},"value":[{value}],"unlike":0.5,"nodes":{},"rows":[1,2],"update_us":3.5}}"#,
        t_us / 10
    )
}

pub(super) const SUMMARY: &str = r#"{"summary":{"events":9,"dropped":{"late":2},"predictions":3,"real_time":4.0,"latency_us":{"push":{"p50":1,"p90":2,"p99":3,"p999":4,"max":5},"predict":null},"skips":{"rows_recomputed":6,"rows_kept":94,"layers":[{"name":"conv1","recomputed":2,"unchanged":1,"within_tolerance":0,"kept":40},{"name":"conv2","recomputed":4,"unchanged":0,"within_tolerance":0,"kept":54}]},"warnings":[]}}"#;

/// A run of three predictions.
pub(super) fn run() -> String {
    let predictions = (1..=3_u32).map(|i| prediction(u64::from(i) * 1000, f64::from(i) / 4.0));
    let lines: Vec<String> =
        std::iter::once(header("run", "N")).chain(predictions).chain([SUMMARY.to_owned()]).collect();
    lines.join("\n") + "\n"
}

/// The results in `text`.
pub(super) fn outcomes(text: &str) -> Result<Vec<Outcome>, ReportError> {
    read("result.json", text.as_bytes(), &Truths::default())
}
