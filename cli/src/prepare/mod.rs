//! `meissner prepare`: what a network reads, made as the program makes it, in a file for training.

mod digits;
mod graphs;
mod slip;

use std::path::PathBuf;

use clap::Subcommand;

use crate::args::{NETWORK, OUTPUT, STATUS};
use crate::error::CliError;
use digits::DigitsArgs;
pub(crate) use graphs::StreamsError;

/// `meissner prepare`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct PrepareArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Graphs of streams of events, as a network over events sees them.
    ///
    /// The file holds neighbourhoods, cells and edges. Each stream is a reset, all of its events, and the window after
    /// the last one. Which weights the network will have does not matter.
    Graphs(GraphsArgs),
    /// Windows of electrode readings, with the direction of slip as label.
    ///
    /// Windows are consecutive and do not overlap, as the paper cuts them, whatever `sampling` the description has for a
    /// running network; the readings at the end of a recording that fill no window are left out. Equal data gives equal
    /// bytes.
    Slip(SlipArgs),
    /// Events of the recordings of digits (N-MNIST), with labels, splits and folds.
    ///
    /// Equal data gives equal bytes.
    Digits(DigitsArgs),
}

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner prepare slip biotac_dos/ --network slip-regularised --out a.safetensors
  meissner prepare slip biotac_dos/ --network own.toml --out own.safetensors";

/// `meissner prepare slip`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{EXAMPLES}\n\n{TENSORS}\n\n{STATUS}"))]
pub(crate) struct SlipArgs {
    /// Folder of the data set, with a folder for each class.
    ///
    /// The classes are aw, cw, e, n, s, t and w; recordings are files such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(crate) data: PathBuf,
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// Its table `input` says how frames are made, in windows of how many readings, and how they are scaled.
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    pub(crate) network: String,
    /// File to write (safetensors); it is replaced where it exists.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) out: PathBuf,
}

/// What the file holds.
const TENSORS: &str = "\
Tensors, the windows in the order of the recordings and of time:
  frames     F32 (windows, steps, 1, 12, 11), (windows, steps, 24) or, scaled in
             two ways, (windows, steps, 48): the input of the network
  readings   F32 (windows, steps, 24): the same readings in the sensor's counts
  label      I64 (windows): index into classes
  recording  I64 (windows): index into recordings
  object     I64 (windows): index into objects

Metadata, each JSON:
  classes, recordings, objects   lists of names
  sets                           {object: set that holds it}
  preparation                    {\"frames\", \"steps\", \"scaling\"} in the words of
                                 the description: weights that are trained on
                                 this file carry the same text, and are refused
                                 where it does not fit
  range_basic                    [least, greatest] reading of the set Basic, null
                                 without one";

/// `meissner prepare graphs`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{GRAPHS}\n\n{STATUS}"))]
pub(crate) struct GraphsArgs {
    /// File with the streams (safetensors), such as `prepare digits` writes.
    #[arg(value_name = "EVENTS")]
    pub(crate) events: PathBuf,
    /// Name of a shipped network over events, or a description file (.toml).
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    pub(crate) network: String,
    /// File to write (safetensors); it is replaced where it exists.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) out: PathBuf,
}

/// What goes into `prepare graphs`, and what comes out.
const GRAPHS: &str = "\
Reads, of E events one stream after the other:
  t_us, x, y, on  I64 (E): time, pixel, and 1 where the brightness rose; times of
                  a stream do not descend
  start           I64 (streams + 1): where each stream begins in E, and the end
  Metadata: sensor, JSON [width, height]. Everything else in the file is ignored.

Writes, of N rows of a level one stream after the other, and of M in-edges one row after the other:
  event           I32 (N0): the event of each row of level 0, an index into E
  LEVEL.start     I32 (streams + 1): where each stream begins in N
  LEVEL.edges     I32 (N + 1): where each row's in-edges begin in M, and the end;
                  in neighbourhood order
  LEVEL.source    I32 (M): the row that is read, an index into N
  LEVEL.attribute F32 (M, 3): edge attributes along x, y and t, 0 to 1
  LEVEL.cell      I32 (N of the level below): the row that pools each row, an
                  index into N; for levels from 1 on
  LEVEL.index     I32 (N, 3): the row's cell along x, y and t; for levels from 1
                  on
  readout         I32 (N of the last level): cell of the readout, row by row of
                  its grid
  LEVEL is level0 for events, level1 for the first pooling and so on. Rows that have left the window of a `frozen` graph, and the rows that they read, are there at level 0 (others read them) and have cell -1.";

/// Does what `args` ask for.
pub(crate) fn prepare(args: &PrepareArgs) -> Result<(), CliError> {
    match &args.what {
        What::Graphs(args) => graphs::prepare(args),
        What::Slip(args) => slip::prepare(args),
        What::Digits(args) => digits::prepare(args),
    }
}
