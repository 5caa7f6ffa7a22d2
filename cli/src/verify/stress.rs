//! Streams, weights, states and images that strain the arithmetic: [`meissner_verify::stress`].

use std::io::{self, Write};

use meissner_kernels::{Elementary, Isa};
use meissner_run::provenance::{Header, InputCard};
use meissner_run::text::grouped;
use meissner_verify::stress::{Case, CaseResult, FunctionResult, cases, sweep};
use serde::Serialize;

use super::{StressArgs, VerifyArgs};
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::text::{NONE, Table, cell};

const FUNCTIONS: &str = "functions";

/// The JSON object.
#[derive(Serialize)]
struct Document<'a> {
    header: Header,
    isa: &'static str,
    quick: bool,
    cases: &'a [CaseResult],
    functions: &'a [FunctionResult],
    broken: usize,
}

/// Runs the cases, or lists them.
pub(super) fn stress(args: &VerifyArgs) -> Result<(), CliError> {
    let (VerifyArgs { cases: args, report, .. }, json) = (args, args.report.format.json);
    let asked = |names: &[&str]| {
        args.only.is_empty()
            || args.only.iter().any(|only| names.iter().any(|name| name.contains(only.as_str())))
    };
    let mut cases = cases();
    cases.retain(|case| asked(&[case.group, case.name, &case.network]));
    let functions: Vec<Elementary> =
        Elementary::ALL.into_iter().filter(|function| asked(&[FUNCTIONS, function.name()])).collect();
    if cases.is_empty() && functions.is_empty() {
        let expected = "a part of the name of a group or case (--list shows them)";
        return Err(CliError::usage("--only", expected, &args.only.join(", ")));
    }
    if args.list {
        let mut out = output::out(true);
        for case in &cases {
            writeln!(out, "{}", label(case))?;
        }
        for function in functions {
            writeln!(out, "{FUNCTIONS}: {}", function.name())?;
        }
        return Ok(out.flush()?);
    }
    output::check_all_writable([&report.out])?;
    let tasks = Progress::tasks(cases.len() as u64, json);
    let mut rows = Vec::with_capacity(cases.len());
    for case in &cases {
        tasks.start(label(case));
        rows.push(case.run(args.quick)?);
        tasks.done();
    }
    tasks.finish();
    let functions = sweeps(args, &functions, json)?;
    let broken = rows.iter().map(|row| row.broken.len()).sum::<usize>()
        + functions.iter().map(|row| row.broken.len()).sum::<usize>();
    let header = Header::of_many("stress", InputCard::other("cases of the program", "drawn from seeds"));
    let isa = Isa::best().name();
    let document = Document { header, isa, quick: args.quick, cases: &rows, functions: &functions, broken };
    output::report(report, &document, |out| {
        if args.markdown {
            out.unfold();
        }
        write(out, &rows, &functions, args.markdown)
    })?;
    if broken > 0 { Err(CliError::Broken(broken)) } else { Ok(()) }
}

/// Group, name and network of a case.
fn label(case: &Case) -> String {
    format!("{}: {}: {}", case.group, case.name, case.network)
}

/// The largest errors of `functions`.
fn sweeps(args: &StressArgs, functions: &[Elementary], json: bool) -> Result<Vec<FunctionResult>, CliError> {
    if functions.is_empty() {
        return Ok(Vec::new());
    }
    let pool = args.threads.pool()?;
    let tasks = Progress::tasks(if args.quick { 0 } else { 256 * functions.len() as u64 }, json);
    let rows = functions.iter().map(|&function| {
        tasks.start(format!("{FUNCTIONS}: {}", function.name()));
        pool.install(|| sweep(function, args.quick, || tasks.done()))
    });
    let rows = rows.collect();
    tasks.finish();
    Ok(rows)
}

const CASE_COLUMNS: [&str; 11] = [
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
const FUNCTION_COLUMNS: [&str; 5] = ["function", "inputs", "largest error (ULP)", "at", "stated"];

/// Writes both tables, and the broken promises.
fn write(
    out: &mut dyn Write,
    rows: &[CaseResult],
    functions: &[FunctionResult],
    markdown: bool,
) -> io::Result<()> {
    let mut groups: Vec<&str> = rows.iter().map(|row| row.group).collect();
    groups.dedup();
    for group in groups {
        let cells = rows.iter().filter(|row| row.group == group).map(cells);
        section(out, group, &CASE_COLUMNS, cells.collect(), markdown)?;
    }
    if !functions.is_empty() {
        section(
            out,
            "functions",
            &FUNCTION_COLUMNS,
            functions.iter().map(function_cells).collect(),
            markdown,
        )?;
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
