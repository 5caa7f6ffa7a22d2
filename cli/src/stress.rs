//! `meissner stress`: runs streams, weights, states and images that strain the arithmetic. The cases come from
//! [`meissner_verify::stress`].

mod args;
mod table;

use std::io::{self, Write};

use meissner_kernels::{Elementary, Isa};
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_verify::stress::{Case, CaseResult, FunctionResult, cases, sweep};
use serde::Serialize;

pub(crate) use args::StressArgs;

use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::text::Folded;
use crate::threads;

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

/// Runs the subcommand.
pub(crate) fn stress(args: &StressArgs) -> Result<(), CliError> {
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
    let mut out = Folded::new(io::stdout().lock(), !args.json && !args.markdown);
    if args.list {
        for case in &cases {
            writeln!(out, "{}", label(case))?;
        }
        for function in functions {
            writeln!(out, "{FUNCTIONS}: {}", function.name())?;
        }
        return Ok(());
    }
    let tasks = Progress::tasks(cases.len() as u64, args.json);
    let mut rows = Vec::with_capacity(cases.len());
    for case in &cases {
        tasks.start(label(case));
        rows.push(case.run(args.quick)?);
        tasks.done();
    }
    tasks.finish();
    let functions = sweeps(args, &functions)?;
    let broken = rows.iter().map(|row| row.broken.len()).sum::<usize>()
        + functions.iter().map(|row| row.broken.len()).sum::<usize>();
    if args.json {
        let isa = Isa::best().name();
        let header = Header::of_many("stress", InputCard::other("cases of the program", "drawn from seeds"));
        let document =
            Document { header, isa, quick: args.quick, cases: &rows, functions: &functions, broken };
        out.write_all(&output::json(&document)?)?;
    } else {
        table::write(&mut out, &rows, &functions, args.markdown)?;
    }
    out.flush()?;
    if broken > 0 { Err(CliError::Broken(broken)) } else { Ok(()) }
}

/// Group, name and network of a case.
fn label(case: &Case) -> String {
    format!("{}: {}: {}", case.group, case.name, case.network)
}

/// The largest errors of `functions`.
fn sweeps(args: &StressArgs, functions: &[Elementary]) -> Result<Vec<FunctionResult>, CliError> {
    if functions.is_empty() {
        return Ok(Vec::new());
    }
    let pool = threads::pool(args.threads)?;
    let tasks = Progress::tasks(if args.quick { 0 } else { 256 * functions.len() as u64 }, args.json);
    let rows = functions.iter().map(|&function| {
        tasks.start(format!("{FUNCTIONS}: {}", function.name()));
        pool.install(|| sweep(function, args.quick, || tasks.done()))
    });
    let rows = rows.collect();
    tasks.finish();
    Ok(rows)
}
