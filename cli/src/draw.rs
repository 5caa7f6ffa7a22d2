//! `meissner draw`: weights from a seed, so that a new description runs before anything is trained.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use meissner_models::drawn_file;

use crate::args::{MEASUREMENT, OUTPUT, STATUS};
use crate::error::CliError;
use crate::tell::tell;
use meissner_pipeline::model::describe_any;

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner draw own.toml --out own.safetensors
  meissner bench RECORDING --network own.toml --weights own.safetensors";

/// `meissner draw`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{EXAMPLES}\n\n{STATUS}"))]
pub(crate) struct DrawArgs {
    /// Name of a shipped network, or a description file (.toml).
    #[arg(value_name = "NETWORK")]
    pub(crate) network: String,
    /// Seed; equal seeds give equal bytes on every machine.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(crate) seed: u64,
    /// File to write (safetensors); one that exists is not replaced.
    ///
    /// Its metadata states that the weights are drawn. They are good for latencies and tests of equality; predictions mean
    /// nothing.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) out: PathBuf,
}

/// Writes the weights that `args` ask for.
pub(crate) fn draw(args: &DrawArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    let bytes = drawn_file(&description, args.seed);
    // Trained weights may have taken hours: only a new file is written.
    let written = File::create_new(&args.out).and_then(|mut file| file.write_all(&bytes));
    written.map_err(|source| CliError::Write { path: args.out.clone(), source })?;
    let (name, out) = (description.name(), args.out.display());
    tell(format_args!("{out}: weights for {name} drawn from seed {}; nothing trained them", args.seed));
    Ok(())
}
