//! Arguments of `meissner stress`.

use crate::args::{MEASUREMENT, OUTPUT, STATUS};

/// The method, at the end of the long help.
const METHOD: &str = "\
Groups:
  streams    stamps at the limits of f64 and i64, spans from 10 us to 10 s, one
             pixel, one instant, ties, largest sensors
  weights    weights times 1e-6 and 1e6, denormal weights and activations,
             variances of batch norm near zero
  recurrent  gates that are saturated, open or closed, over a million frames
  winograd   images that cancel, mix magnitudes or nearly overflow: directly, by
             F(2 x 2) and by F(4 x 4)
  functions  the largest error of each elementary function over all 2^32 inputs

How it measures:
  Incremental against batch: engine and full recomputation, bit for bit, for predictions and for every row of every layer; of frame networks, an engine that skips against one that computes everything.
  Error: against the same network in f64 (crate meissner-reference), over the predictions that were compared; relative is a share of the largest magnitude. `layer` is the layer of which that share is largest.
  Overflow: activations beyond f32 become infinite; a layer that makes NaN of them is an error with its name.
  Time: on one thread, the least of several passes; `x ordinary` is against the ordinary case of the same network, measured in turns. Times depend on the machine, everything else on the seeds in the program (functions also on the platform's f64 library).
  ULP: distance to the result in f64, in units in the last place of the nearest f32.";

/// The keys that `--json` prints.
const JSON: &str = "\
JSON (--json):
  {\"header\": input and version (docs/json.md), \"isa\", \"quick\", \"cases\": [{\"group\", \"case\", \"network\", \"steps\", \"compared\", \"different\", \"refused\", \"refusal\", \"not_numbers\", \"infinite\", \"infinite_inside\", \"prediction\": {\"absolute\", \"relative\", \"rms\"}, \"layer\": {\"layer\", \"relative\"}, \"largest_activation\", \"us\", \"times_ordinary\", \"broken\"}], \"functions\": [{\"function\", \"inputs\", \"ulps\", \"at\", \"bound\", \"not_numbers\", \"broken\"}], \"broken\": how many promises}";

/// `meissner stress`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of the command line")]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct StressArgs {
    /// Run only the groups and cases whose name contains NAME.
    ///
    /// It may be given several times.
    #[arg(long, value_name = "NAME", help_heading = MEASUREMENT)]
    pub(super) only: Vec<String>,
    /// Take fewer events, frames and inputs, and one pass of timing.
    ///
    /// Of the 2^32 inputs of a function every 4099th is taken, and those near special values.
    #[arg(long, help_heading = MEASUREMENT)]
    pub(super) quick: bool,
    /// Threads of the sweep over all inputs [default: the machine's cores].
    ///
    /// Everything else runs on one thread.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    pub(super) threads: Option<u16>,
    /// List the cases, and run none.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) list: bool,
    /// Print the tables in Markdown.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    pub(super) markdown: bool,
    /// Print one JSON object.
    ///
    /// The keys are explained below.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}
