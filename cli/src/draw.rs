//! `meissner draw`: draws weights from a seed, so that a new description can run before it is
//! trained.

use meissner_models::drawn_file;

use crate::args::MEASUREMENT;
use crate::error::CliError;
use crate::output::OutArgs;
use crate::stderr::tell;
use meissner_run::model::describe_any;

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner draw own.toml --out own.safetensors
  meissner bench RECORDING --network own.toml --weights own.safetensors";

/// `meissner draw`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct DrawArgs {
    /// Name of a shipped network, or a description file (.toml).
    #[arg(value_name = "NETWORK")]
    pub(crate) network: String,
    /// Seed; equal seeds give equal bytes on every machine.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(crate) seed: u64,
    #[command(flatten)]
    file: OutArgs,
}

/// Draws the weights and writes them.
pub(crate) fn draw(args: &DrawArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    let bytes = drawn_file(&description, args.seed);
    // Training may have taken hours.
    args.file.check()?;
    args.file.write(bytes)?;
    let (name, out) = (description.name(), args.file.out.display());
    tell(format_args!("{out}: weights for {name} drawn from seed {}; nothing trained them", args.seed));
    Ok(())
}
