//! `meissner inspect`: shows a network as a table, as JSON or as a drawing.

use std::io::{Write, stdout};
use std::path::PathBuf;

use meissner_run::model::describe_any;

use crate::args::{JsonArgs, OUTPUT};
use crate::error::CliError;
use crate::output;
use crate::stderr::tell;

/// `meissner inspect`.
#[derive(Debug, clap::Args)]
pub(crate) struct InspectArgs {
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks.
    #[arg(value_name = "NETWORK")]
    network: String,
    /// Print the graph of the layers in Graphviz's DOT language.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    dot: bool,
    /// Draw the network into this file, instead of the table.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    svg: Option<PathBuf>,
    #[command(flatten)]
    format: JsonArgs,
}

/// Prints the network in the requested form.
pub(crate) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    if let Some(path) = &args.svg {
        output::write(path, description.to_svg())?;
        tell(format_args!("wrote {}", path.display()));
    }
    if args.dot {
        return Ok(stdout().lock().write_all(description.to_dot().as_bytes())?);
    }
    output::print(args.format.json, &description.summary(), |out| match args.svg {
        None => writeln!(out, "{}", description.to_table().trim_end()),
        Some(_) => Ok(()),
    })
}
