//! `meissner eval filters`: how much of a simulated signal and of each kind of noise filters keep.

use std::io::{self, Write};
use std::path::PathBuf;

use meissner_evaluate::filters::{Kept, Report, judge};
use meissner_plot::percent;
use meissner_run::text::grouped;

use crate::args::FilterArgs;
use crate::error::CliError;
use crate::output::{self, ReportArgs};
use crate::text::{Table, cell, columns};

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  EVENTS has streams as `meissner simulate markers` writes them, or `simulate images` into a file that ends in .safetensors: each event has its cause. All streams pass all filters that are given; filters forget all events between two streams.

Examples:
  meissner simulate images frames/ --lux 10 --out events.safetensors
  meissner eval filters events.safetensors --activity-filter 5ms";

/// `meissner eval filters`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct FiltersArgs {
    /// Simulated events with their causes (safetensors).
    #[arg(value_name = "EVENTS")]
    events: PathBuf,
    #[command(flatten)]
    filters: FilterArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub(super) fn eval(args: &FiltersArgs) -> Result<(), CliError> {
    let filters = args.filters.values();
    if filters.is_exact() {
        return Err(CliError::usage(
            "eval filters",
            "at least one filter, such as --activity-filter 5ms",
            "none",
        ));
    }
    output::check_all_writable([&args.report.out])?;
    let report = judge(&args.events, &filters)?;
    output::report(&args.report, &report, |out| table(out, &report))
}

fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    writeln!(out, "data         {}: {} streams", report.header.input.name, grouped(report.streams as u64))?;
    writeln!(out, "filters      {}\n", report.filters.join(", "))?;
    let share = |part: u64, all: u64| cell((all > 0).then_some(all), |all| percent(part as f64 / all as f64));
    let sum = |count: fn(&Kept) -> u64| report.causes.iter().map(count).sum::<u64>();
    let (all, all_passed) = (sum(|kept| kept.events), sum(|kept| kept.passed));
    let mut table =
        Table::new(&columns("cause | events | passed | kept (%) | of all before (%) | after (%)"));
    let rows = report.causes.iter().map(|kept| (kept.cause, kept.events, kept.passed));
    for (name, events, passed) in rows.chain([("all", all, all_passed)]) {
        let counts = [name.to_owned(), grouped(events), grouped(passed), share(passed, events)];
        table.row(counts.into_iter().chain([share(events, all), share(passed, all_passed)]));
    }
    table.write(out)
}
