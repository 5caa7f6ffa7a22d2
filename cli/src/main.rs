//! The `meissner` program: recordings and live events in, predictions and measurements out.
//!
//! | file | contents |
//! |---|---|
//! | `run`, `play`, `bench`, `networks` and others | one or a few subcommands in each file |
//! | `args`, `tasks` | arguments of several subcommands; data sets, networks and trainings |
//! | `input` | the source and the network that they select, and its kind of input |
//! | `given` | which arguments were given; command lines of the previous version |
//! | `predictions`, `text`, `progress` | results as text and as JSON |
//! | `report` | results as a page; the crate in `cli/report` makes it |
//! | `output`, `stderr` | standard output and files; messages on standard error |
//! | `manual` | completions of shells, pages of the manual |
//! | `error` | errors, hints, and the exit status |
//!
//! Results go to standard output, messages and progress to standard error.
#![forbid(unsafe_code)]
// These macros panic if the reader has closed the pipe. `tell` does not, and results go to a locked
// standard output, which reports its errors.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod bench;
mod convert;
mod error;
mod eval;
mod fit;
mod given;
mod info;
mod input;
mod kind;
mod manual;
mod networks;
mod output;
mod page;
mod pareto;
mod play;
mod predictions;
mod prepare;
mod progress;
mod record;
mod report;
mod run;
mod send;
mod simulate;
mod stderr;
mod tasks;
#[cfg(test)]
mod tests;
mod text;
mod verify;
mod view;

use std::process::ExitCode;

use clap::builder::StyledStr;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use meissner_run::{interrupt, provenance};

use crate::args::STATUS;
use crate::error::CliError;
use crate::given::Given;
use crate::stderr::{install_logger, tell};

/// Incremental inference for event cameras and event-based touch.
#[derive(Debug, Parser)]
#[command(name = "meissner", version, max_term_width = 80)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run a network over a recording or a live stream.
    Run(run::RunArgs),
    /// Play a recording at real speed through a bounded queue.
    Play(play::PlayArgs),
    /// Measure latencies, work, memory and missed deadlines.
    Bench(bench::BenchArgs),
    /// List the shipped networks.
    Networks(networks::NetworksArgs),
    /// Show the layers, shapes and costs of a network.
    Inspect(networks::InspectArgs),
    /// Draw weights for a network from a seed.
    ///
    /// Drawn weights are useful for measuring latency and testing equality; the predictions are
    /// meaningless. The metadata of the file says so.
    Draw(networks::DrawArgs),
    /// Show the contents of a recording in numbers.
    Info(info::InfoArgs),
    /// Write a recording in another format.
    Convert(convert::ConvertArgs),
    /// Record live events into AEDAT4, one file or one for each press.
    Record(record::RecordArgs),
    /// Send a recording at real speed to another program.
    Send(send::SendArgs),
    /// Evaluate networks on a labelled data set.
    Eval(eval::EvalArgs),
    /// Fit a network to presses of your own sensor.
    Fit(fit::FitArgs),
    /// Measure run time against error, exactly and with approximations.
    Pareto(pareto::ParetoArgs),
    /// Write the inputs of a network with labels, for training.
    Prepare(prepare::PrepareArgs),
    /// Simulate an event camera.
    Simulate(simulate::SimulateArgs),
    /// Check that a network's incremental results equal full recomputation.
    Verify(verify::VerifyArgs),
    /// Make a page of results, to keep, to print and to send.
    Report(report::ReportArgs),
    /// Watch a network over a recording or live events, in a browser.
    View(view::ViewArgs),
    /// Print the completions of a shell.
    Completions(manual::CompletionsArgs),
    /// Write the pages of the manual.
    Man(manual::ManArgs),
}

/// The definition of the program, with [`STATUS`] at the end of every help text.
fn program() -> clap::Command {
    with_status(Args::command())
}

fn with_status(command: clap::Command) -> clap::Command {
    let mut long = StyledStr::new();
    if let Some(own) = command.get_after_long_help() {
        long = own.clone();
        long.push_str("\n\n");
    }
    long.push_str(STATUS);
    command.after_help(STATUS).after_long_help(long).mut_subcommands(with_status)
}

/// The warning of a debug build, whose timings are meaningless.
const UNOPTIMISED: &str = "note: this program was built without optimisation and is many times slower than one from \
                           `cargo build --release`";

fn main() -> ExitCode {
    interrupt::install();
    install_logger();
    let (program, words) = (program(), given::renamed(std::env::args_os()));
    provenance::made_by(command_line());
    let matches = program.clone().try_get_matches_from(&words);
    let matches = matches.unwrap_or_else(|error| given::with_tip(error, &words).exit());
    let given = Given::of(&program, &matches);
    let command = Args::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()).command;
    if cfg!(debug_assertions) && takes_long(&command) {
        tell(format_args!("{UNOPTIMISED}"));
    }
    match perform(&command, &given) {
        Err(error) if !error.is_broken_pipe() => {
            tell(format_args!("error: {}", meissner_run::error::chain(&error)));
            if let Some(hint) = error.hint() {
                tell(format_args!("hint: {hint}"));
            }
            error.exit_code()
        }
        _ if interrupt::requested() => ExitCode::from(interrupt::STATUS),
        // Also if the reader of the output has closed the pipe.
        _ => ExitCode::SUCCESS,
    }
}

/// The words of the command line, from the name of the program on.
fn command_line() -> Vec<String> {
    let words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    std::iter::once("meissner".to_owned()).chain(words).collect()
}

/// Whether `command` may compute for a long time.
fn takes_long(command: &Command) -> bool {
    matches!(
        command,
        Command::Run(_)
            | Command::Play(_)
            | Command::Bench(_)
            | Command::Eval(_)
            | Command::Fit(_)
            | Command::Prepare(_)
            | Command::Pareto(_)
            | Command::Simulate(_)
            | Command::Verify(_)
            | Command::View(_)
    )
}

fn perform(command: &Command, given: &Given) -> Result<(), CliError> {
    match command {
        Command::Run(args) => run::run(args, given),
        Command::Play(args) => play::play(args, given),
        Command::Bench(args) => bench::bench(args, given),
        Command::Networks(args) => networks::networks(args),
        Command::Inspect(args) => networks::inspect(args),
        Command::Draw(args) => networks::draw(args),
        Command::Info(args) => info::info(args),
        Command::Convert(args) => convert::convert(args),
        Command::Record(args) => record::record(args),
        Command::Send(args) => send::send(args),
        Command::Eval(args) => eval::eval(args),
        Command::Prepare(args) => prepare::prepare(args),
        Command::Fit(args) => fit::fit(args),
        Command::Pareto(args) => pareto::pareto(args),
        Command::Simulate(args) => simulate::simulate(args),
        Command::Verify(args) => verify::verify(args, given),
        Command::Report(args) => report::report(args),
        Command::View(args) => view::view(args),
        Command::Completions(args) => manual::completions(args, program()),
        Command::Man(args) => manual::man(args, program()),
    }
}
