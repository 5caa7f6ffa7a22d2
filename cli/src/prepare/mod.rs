//! `meissner prepare`: what a network reads, made as the program makes it, in a file for training.

mod slip;

use std::path::PathBuf;

use clap::Subcommand;

use crate::args::STATUS;
use crate::error::CliError;

/// `meissner prepare`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct PrepareArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Windows of electrode readings with the direction of slip as label.
    ///
    /// Windows are consecutive and do not overlap, as the paper cuts them, whatever `sampling` the description has for a
    /// running network; the readings at the end of a recording that fill no window are left out. Equal data gives equal
    /// bytes.
    Slip(SlipArgs),
}

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner prepare slip biotac_dos/ --network slip-regularised --out images.safetensors
  meissner prepare slip biotac_dos/ --network own.toml --out own.safetensors";

/// `meissner prepare slip`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{EXAMPLES}\n\n{TENSORS}\n\n{STATUS}"))]
pub(crate) struct SlipArgs {
    /// Folder with a folder for each of the classes aw, cw, e, n, s, t, w, of recordings such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(crate) data: PathBuf,
    /// Name of a shipped network, or a description file: its table `input` says how frames are made, in windows of
    /// how many readings, and how they are scaled.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) network: String,
    /// File to write (safetensors); it is replaced where it exists.
    #[arg(long, value_name = "FILE.safetensors")]
    pub(crate) out: PathBuf,
}

/// What the file holds.
const TENSORS: &str = "\
Tensors, the windows in the order of the recordings and of time:
  frames     F32 (windows, steps, 1, 12, 11), (windows, steps, 24) or, scaled in two ways, (windows, steps, 48): what
             the network reads
  readings   F32 (windows, steps, 24): the same readings in the sensor's counts
  label      I64 (windows): index into classes
  recording  I64 (windows): index into recordings
  object     I64 (windows): index into objects
Metadata, each JSON:
  classes, recordings, objects   lists of names
  sets                           {object: set that holds it}
  preparation                    {\"frames\", \"steps\", \"scaling\"} in the words of the description: weights that are
                                 trained on this file carry the same text, and are refused where it does not fit
  range_basic                    [least, greatest] reading of the set Basic, null without one";

/// Does what `args` ask for.
pub(crate) fn prepare(args: &PrepareArgs) -> Result<(), CliError> {
    match &args.what {
        What::Slip(args) => slip::prepare(args),
    }
}
