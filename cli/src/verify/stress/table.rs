//! A table of cases and one of functions, as text or in Markdown.

use std::io::{self, Write};

use meissner_run::text::grouped;
use meissner_verify::stress::{CaseResult, FunctionResult};

use crate::text::{NONE, Table, cell};

const CASES: [&str; 11] = [
    "case",
    "network",
    "steps",
    "compared",
    "equal",
    "error",
    "relative",
    "RMS",
    "worst layer",
    "largest",
    "us (x ordinary)",
];
const FUNCTIONS: [&str; 5] = ["function", "inputs", "largest error (ULP)", "at", "stated"];

/// Writes both tables, and the broken promises.
pub(super) fn write(
    out: &mut dyn Write,
    rows: &[CaseResult],
    functions: &[FunctionResult],
    markdown: bool,
) -> io::Result<()> {
    let mut groups: Vec<&str> = rows.iter().map(|row| row.group).collect();
    groups.dedup();
    for group in groups {
        let cells = rows.iter().filter(|row| row.group == group).map(cells);
        section(out, group, &CASES, cells.collect(), markdown)?;
    }
    if !functions.is_empty() {
        section(out, "functions", &FUNCTIONS, functions.iter().map(function_cells).collect(), markdown)?;
    }
    let broken = rows.iter().flat_map(|row| {
        row.broken.iter().map(|broken| format!("{}, {}, {}: {broken}", row.group, row.case, row.network))
    });
    let of_functions = functions
        .iter()
        .flat_map(|row| row.broken.iter().map(|broken| format!("{}: {broken}", row.function)));
    for broken in broken.chain(of_functions) {
        writeln!(out, "broken: {broken}")?;
    }
    Ok(())
}

fn section(
    out: &mut dyn Write,
    title: &str,
    headings: &[&str],
    rows: Vec<Vec<String>>,
    markdown: bool,
) -> io::Result<()> {
    if markdown {
        writeln!(out, "### {title}\n\n| {} |", headings.join(" | "))?;
        writeln!(out, "|{}", "---|".repeat(headings.len()))?;
        for row in rows {
            writeln!(out, "| {} |", row.join(" | "))?;
        }
    } else {
        writeln!(out, "{title}")?;
        let mut table = Table::new(headings);
        rows.into_iter().for_each(|row| table.row(row));
        table.write(out)?;
    }
    writeln!(out)
}

/// A number with two digits.
fn short(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

fn cells(row: &CaseResult) -> Vec<String> {
    let errors = row.prediction.as_ref();
    let equal = match (row.compared, row.different) {
        (0, _) => NONE.to_owned(),
        (_, 0) => "all".to_owned(),
        (_, different) => format!("not {different}"),
    };
    let of = |value: Option<f64>| cell(value, short);
    let layer = row.layer.as_ref().map(|l| format!("{} {}", l.layer, short(l.relative)));
    let time = row.us.zip(row.times_ordinary);
    vec![
        row.case.to_owned(),
        row.network.clone(),
        grouped(row.steps),
        grouped(row.compared),
        equal,
        outcome(row).unwrap_or_else(|| of(errors.map(|e| e.absolute))),
        of(errors.map(|e| e.relative)),
        of(errors.map(|e| e.rms)),
        layer.unwrap_or_else(|| NONE.to_owned()),
        short(row.largest_activation),
        cell(time, |(us, times)| format!("{us:.1} ({times:.2})")),
    ]
}

/// The text instead of an error if not all predictions are finite.
fn outcome(row: &CaseResult) -> Option<String> {
    let refused = (row.refused > 0).then(|| format!("{} refused (NaN)", row.refused));
    let infinite = (row.infinite + row.infinite_inside > 0)
        .then(|| format!("{} inf, {} inside", row.infinite, row.infinite_inside));
    let parts: Vec<String> = [refused, infinite].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

fn function_cells(row: &FunctionResult) -> Vec<String> {
    vec![
        row.function.to_owned(),
        grouped(row.inputs),
        format!("{:.3}", row.ulps),
        format!("{:e}", row.at),
        format!("{}", row.bound),
    ]
}
