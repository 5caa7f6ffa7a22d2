//! `meissner report`: a page of results.

use std::fs::File;
use std::io::{BufReader, stdin};
use std::path::{Path, PathBuf};

use meissner_io::LabelTable;
use meissner_models::AnyDescription;
use meissner_report::{Drawing, Outcome, Page, ReportError, Truth, Truths, read};
use meissner_run::RunError;
use meissner_run::model::describe_any;
use meissner_run::press::Press;
use meissner_run::streams::{STDIN_NAME, is_stdin};

use crate::args::{INPUT, NETWORK, OUTPUT};
use crate::error::CliError;
use crate::output;
use crate::stderr::tell;

/// At the end of the long help.
const METHOD: &str = "\
What it shows:
  The page begins with an answer: how good, how fast, whether promises hold. Then come pictures and tables: predictions over time with the truth where it is known, predicted over true values, rows that each layer computed and kept, latencies, skips, learning curves, confusions, run time against error, errors beside their bounds, goal and course of control, the drawing of the network, and how the result was made: command, machine, versions, weights. Several results are compared.
  The page is one file of at most 3 MB without scripts. It loads nothing, prints well, and follows the light or dark scheme of the reader.
  Streams of predictions are read in bounded memory, however long they are; lines keep their peaks. A last line that is cut short is left out and told.
  A table of labels (--truth) is one that `fit` and `prepare presses` read, with times of the sensor: CSV with the column t_us, a column for each output by its name, and where it is of several recordings the column recording.

Examples:
  meissner run RECORDING --every 1ms --json > run.json
  meissner report run.json --out run.html
  meissner report fast.json exact.json --out compared.html
  meissner run RECORDING --json | meissner report - --truth labels.csv --out run.html";

/// `meissner report`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(crate) struct ReportArgs {
    /// Result in JSON; - reads it from standard input.
    ///
    /// It is what run, play, bench, eval, fit, pareto, verify or simulate loop wrote with --json or
    /// --out.
    #[arg(value_name = "RESULT", required = true)]
    results: Vec<PathBuf>,
    /// Table of what was true (CSV), to compare predictions with.
    ///
    /// It may be given several times. What was true of the press that the program holds is known.
    #[arg(long, value_name = "FILE", help_heading = INPUT)]
    truth: Vec<PathBuf>,
    /// Description file of a network to draw, beyond shipped ones.
    ///
    /// It may be given several times. Networks are found by their names.
    #[arg(long = "network", value_name = "FILE", help_heading = NETWORK)]
    networks: Vec<String>,
    /// File to write (HTML).
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    out: PathBuf,
}

/// Writes the page of the results.
pub(crate) fn report(args: &ReportArgs) -> Result<(), CliError> {
    output::check_writable(&args.out)?;
    let truths = truths(&args.truth)?;
    let own = args.networks.iter().map(|network| Ok(describe_any(network)?.0));
    let own: Vec<AnyDescription> = own.collect::<Result<_, CliError>>()?;
    let mut results = Vec::new();
    for path in &args.results {
        results.extend(outcomes(path, &truths)?);
    }
    for (result, note) in results.iter().flat_map(|of| of.notes.iter().map(move |note| (of, note))) {
        tell(format_args!("note: {}: {note}", result.name));
    }
    let drawings = drawings(&results, &own);
    let page = Page { results: &results, drawings: &drawings }.html()?;
    output::write(&args.out, page)
}

/// The results in the file at `path`.
fn outcomes(path: &Path, truths: &Truths) -> Result<Vec<Outcome>, CliError> {
    if is_stdin(path) {
        return Ok(read(STDIN_NAME, stdin().lock(), truths)?);
    }
    let name = path.display().to_string();
    if path.is_dir() {
        return Err(ReportError::Other { name, found: "a folder".to_owned() }.into());
    }
    let file = File::open(path).map_err(|source| ReportError::Read { name: name.clone(), source })?;
    Ok(read(&name, BufReader::with_capacity(1 << 16, file), truths)?)
}

/// The known truth: from tables, and of the embedded press.
fn truths(tables: &[PathBuf]) -> Result<Truths, CliError> {
    let mut truths = Truths::default();
    for path in tables {
        let table = LabelTable::read(path).map_err(RunError::Image)?;
        if !truths.add_table(&table) {
            let expected = "numbers with times of the sensor (t_us)";
            return Err(CliError::usage(&path.display().to_string(), expected, "none"));
        }
    }
    let press = Press::embedded()?;
    for (output, angle) in ["roll", "pitch"].into_iter().zip(press.angles) {
        truths.add(Truth {
            input: Some(Press::INPUT.to_owned()),
            output: output.to_owned(),
            unit: Some("rad".to_owned()),
            points: [press.contact_us, press.end_us].map(|t_us| (t_us as f64, angle)).to_vec(),
        });
    }
    Ok(truths)
}

/// A drawing of each network in the results, by its name: of networks in `own` files, and of
/// shipped ones.
fn drawings(results: &[Outcome], own: &[AnyDescription]) -> Vec<Drawing> {
    let mut names: Vec<&str> = Vec::new();
    for name in results.iter().flat_map(Outcome::networks) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let drawing = |name: &str| {
        let of = own.iter().find(|own| own.name() == name);
        let svg = match of {
            Some(own) => own.to_svg(),
            None => AnyDescription::shipped(name)?.to_svg(),
        };
        Some(Drawing { network: name.to_owned(), svg })
    };
    names.into_iter().filter_map(drawing).collect()
}
