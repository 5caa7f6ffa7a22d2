//! The `meissner` program: recordings and live events in, predictions and measurements out.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for on the command line |
//! | `answer` | predictions in the words of their network: classes, names, units |
//! | `approximations` | what makes results cheaper and less exact, where it is asked for |
//! | `run/` | `meissner run` |
//! | `play/` | `meissner play` |
//! | `bench/` | `meissner bench` |
//! | `eval/` | `meissner eval` |
//! | `prepare/` | `meissner prepare` |
//! | `pareto/` | `meissner pareto` |
//! | `stress/` | `meissner stress` |
//! | `soak/` | `meissner soak` |
//! | `verify/` | `meissner verify` |
//! | `tasks` | data sets, networks and trainings on the command line, for `eval` and `pareto` |
//! | `threads` | threads that share work |
//! | `header`, `progress`, `text` | how results are shown to people |
//! | `output` | files that are written |
//! | `tell` | messages on standard error |
//! | `networks`, `inspect`, `draw`, `info`, `convert` | the other subcommands |
//! | `error` | what can go wrong, and the exit status that says so |
//!
//! Results go to standard output, messages and progress to standard error.
#![forbid(unsafe_code)]
// They panic where nobody reads on: `tell` does not, and results go to a locked standard output, with its errors.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod answer;
mod approximations;
mod args;
mod bench;
mod convert;
mod draw;
mod error;
mod eval;
mod header;
mod info;
mod input;
mod inspect;
mod networks;
mod output;
mod pareto;
mod play;
mod prepare;
mod progress;
mod run;
mod skips;
mod soak;
mod stress;
mod tasks;
mod tell;
mod text;
mod threads;
mod verify;

use std::process::ExitCode;

use clap::Parser;

use meissner_pipeline::interrupt;

use crate::args::{Args, Command};
use crate::error::CliError;
use crate::tell::{tell, tell_warnings};

/// What a program whose times mean nothing says before it runs.
const UNOPTIMISED: &str = "note: this program was built without optimisation and is many times slower than one from \
                           `cargo build --release`";

fn main() -> ExitCode {
    interrupt::install();
    tell_warnings();
    let command = Args::parse().command;
    if cfg!(debug_assertions) && takes_long(&command) {
        tell(format_args!("{UNOPTIMISED}"));
    }
    match perform(&command) {
        Err(error) if !error.is_broken_pipe() => {
            tell(format_args!("error: {}", meissner_pipeline::error::chain(&error)));
            if let Some(hint) = error.hint() {
                tell(format_args!("hint: {hint}"));
            }
            error.exit_code()
        }
        _ if interrupt::requested() => ExitCode::from(interrupt::STATUS),
        // Also where whoever reads our output has seen enough.
        _ => ExitCode::SUCCESS,
    }
}

/// Whether `command` runs a network for as long as it takes.
fn takes_long(command: &Command) -> bool {
    matches!(
        command,
        Command::Run(_)
            | Command::Play(_)
            | Command::Bench(_)
            | Command::Pareto(_)
            | Command::Soak(_)
            | Command::Verify(_)
    )
}

fn perform(command: &Command) -> Result<(), CliError> {
    match command {
        Command::Run(args) => run::run(args),
        Command::Play(args) => play::play(args),
        Command::Bench(args) => bench::bench(args),
        Command::Networks(args) => networks::networks(args),
        Command::Inspect(args) => inspect::inspect(args),
        Command::Draw(args) => draw::draw(args),
        Command::Info(args) => info::info(args),
        Command::Convert(args) => convert::convert(args),
        Command::Eval(args) => eval::eval(args),
        Command::Prepare(args) => prepare::prepare(args),
        Command::Pareto(args) => pareto::pareto(args),
        Command::Stress(args) => stress::stress(args),
        Command::Soak(args) => soak::soak(args),
        Command::Verify(args) => verify::verify(args),
    }
}
