//! `meissner stress`: streams, weights, states and images that are built to hurt, and what they do to results.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for |
//! | `streams`, `weights` | cases of networks over events, as data |
//! | `recurrent`, `winograd` | cases of frame networks, as data |
//! | `events`, `frames` | running a case: incremental, from scratch, in f64 |
//! | `functions` | elementary functions over all inputs |
//! | `row`, `table` | what came of it, and which promises are broken |

mod args;
mod events;
mod frames;
mod functions;
mod recurrent;
mod row;
mod streams;
mod table;
mod weights;
mod winograd;

use std::io::{self, Write};

use meissner_kernels::{Elementary, Isa};
use serde::Serialize;

pub(crate) use args::StressArgs;

use crate::error::CliError;
use crate::output;
use crate::progress::Tasks;
use crate::text::Folded;
use crate::threads;
use functions::FunctionRow;
use row::Row;

/// Largest relative error of a prediction, as the contract has it for whole networks against their reference.
const WITHIN: f64 = 1e-4;
const FUNCTIONS: &str = "functions";

/// How long cases are.
#[derive(Clone, Copy, Debug)]
struct Size {
    events: usize,
    frames: u64,
    /// Of timing.
    passes: usize,
}

/// Runs a case.
type Run = Box<dyn Fn(&Size) -> Result<Row, CliError>>;

/// A case by its names, and how to run it.
struct Entry {
    group: &'static str,
    case: &'static str,
    variant: String,
    run: Run,
}

/// The result of a whole run.
#[derive(Serialize)]
struct Report<'a> {
    isa: &'static str,
    quick: bool,
    cases: &'a [Row],
    functions: &'a [FunctionRow],
    broken: usize,
}

/// All cases but the functions.
fn entries() -> Vec<Entry> {
    let mut all = Vec::new();
    for shape in streams::SHAPES {
        for network in streams::NETWORKS {
            let run = move |size: &Size| streams::case(shape, network, size)?.run(size.passes);
            all.push(Entry {
                group: "streams",
                case: shape.name,
                variant: network.to_owned(),
                run: Box::new(run),
            });
        }
    }
    for altered in weights::ALTERED {
        for network in weights::NETWORKS {
            let run = move |size: &Size| weights::case(altered, network, size)?.run(size.passes);
            all.push(Entry {
                group: "weights",
                case: altered.name,
                variant: network.to_owned(),
                run: Box::new(run),
            });
        }
    }
    for gates in recurrent::GATES {
        for cell in recurrent::CELLS {
            let run = move |size: &Size| recurrent::case(cell, gates, size).run(size.passes);
            let variant = cell.name().to_owned();
            all.push(Entry { group: "recurrent", case: gates.name, variant, run: Box::new(run) });
        }
    }
    for images in winograd::IMAGES {
        for (way, convolution) in winograd::WAYS.iter().enumerate() {
            let run = move |size: &Size| winograd::case(images, way, size).run(size.passes);
            let variant = format!("{convolution:?}");
            all.push(Entry { group: "winograd", case: images.name, variant, run: Box::new(run) });
        }
    }
    all
}

/// Runs the subcommand.
pub(crate) fn stress(args: &StressArgs) -> Result<(), CliError> {
    let asked = |names: &[&str]| {
        args.only.is_empty()
            || args.only.iter().any(|only| names.iter().any(|name| name.contains(only.as_str())))
    };
    let entries: Vec<Entry> =
        entries().into_iter().filter(|e| asked(&[e.group, e.case, &e.variant])).collect();
    let functions: Vec<Elementary> =
        Elementary::ALL.into_iter().filter(|function| asked(&[FUNCTIONS, function.name()])).collect();
    if entries.is_empty() && functions.is_empty() {
        let expected = "a part of the name of a group or case (--list shows them)".to_owned();
        return Err(CliError::Option { option: "--only", expected, found: args.only.join(", ") });
    }
    let mut out = Folded::new(io::stdout().lock(), !args.json && !args.markdown);
    if args.list {
        for Entry { group, case, variant, .. } in &entries {
            writeln!(out, "{group}: {case}: {variant}")?;
        }
        for function in functions {
            writeln!(out, "{FUNCTIONS}: {}", function.name())?;
        }
        return Ok(());
    }
    let size = if args.quick {
        Size { events: 160, frames: 3_000, passes: 1 }
    } else {
        Size { events: 640, frames: 1_000_000, passes: 5 }
    };
    let tasks = Tasks::new(entries.len() as u64, args.json);
    let mut rows = Vec::with_capacity(entries.len());
    for entry in &entries {
        tasks.start(format!("{}: {}: {}", entry.group, entry.case, entry.variant));
        rows.push((entry.run)(&size)?);
        tasks.done();
    }
    tasks.finish();
    let functions = sweep(args, &functions)?;
    let broken = rows.iter().map(|row| row.broken.len()).sum::<usize>()
        + functions.iter().map(|row| row.broken.len()).sum::<usize>();
    if args.json {
        let isa = Isa::best().name();
        let report = Report { isa, quick: args.quick, cases: &rows, functions: &functions, broken };
        out.write_all(&output::json(&report)?)?;
    } else {
        table::write(&mut out, &rows, &functions, args.markdown)?;
    }
    out.flush()?;
    if broken > 0 { Err(CliError::Broken(broken)) } else { Ok(()) }
}

/// The largest errors of `functions`.
fn sweep(args: &StressArgs, functions: &[Elementary]) -> Result<Vec<FunctionRow>, CliError> {
    if functions.is_empty() {
        return Ok(Vec::new());
    }
    let pool = threads::pool(args.threads)?;
    let tasks = Tasks::new(if args.quick { 0 } else { 256 * functions.len() as u64 }, args.json);
    let rows = functions.iter().map(|&function| {
        tasks.start(format!("{FUNCTIONS}: {}", function.name()));
        pool.install(|| functions::sweep(function, args.quick, || tasks.done()))
    });
    let rows = rows.collect();
    tasks.finish();
    Ok(rows)
}
