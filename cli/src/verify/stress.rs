//! Streams, weights, states and images that strain the arithmetic. The cases come from
//! [`meissner_verify::stress`].

mod table;

use std::io::Write;

use meissner_kernels::{Elementary, Isa};
use meissner_run::provenance::{Header, InputCard};
use meissner_verify::stress::{Case, CaseResult, FunctionResult, cases, sweep};
use serde::Serialize;

use super::VerifyArgs;
use super::args::StressArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;

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
        table::write(out, &rows, &functions, args.markdown)
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
