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
  Incremental against batch: the engine is compared with full recomputation, bit for bit, for predictions and for every row of every layer. For frame networks, an engine that skips is compared with one that computes everything.
  Error: the difference from the same network in f64 (crate meissner-reference), over the compared predictions. Relative errors are divided by the largest magnitude. `layer` is the layer with the largest relative error.
  Overflow: activations beyond f32 become infinite. If a layer turns them into NaN, the engine reports an error with the name of the layer.
  Time: the fastest of several passes on one thread. `x ordinary` is the ratio to the ordinary case of the same network; both are measured in turns. Times depend on the machine. Everything else is determined by the seeds in the program (functions also by the platform's f64 library).
  ULP: the distance to the result in f64, in units in the last place of the nearest f32.";

/// The keys that `--json` prints.
const JSON: &str = "\
JSON (--json):
  {\"header\": input and version (docs/json.md), \"isa\", \"quick\", \"cases\": [{\"group\", \"case\", \"network\", \"steps\", \"compared\", \"different\", \"refused\", \"refusal\", \"not_numbers\", \"infinite\", \"infinite_inside\", \"prediction\": {\"absolute\", \"relative\", \"rms\"}, \"layer\": {\"layer\", \"relative\"}, \"largest_activation\", \"us\", \"times_ordinary\", \"broken\"}], \"functions\": [{\"function\", \"inputs\", \"ulps\", \"at\", \"bound\", \"not_numbers\", \"broken\"}], \"broken\": number of broken promises}";

/// `meissner stress`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of the command line")]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct StressArgs {
    /// Run only the groups and cases whose name contains NAME.
    ///
    /// The option may be given several times.
    #[arg(long, value_name = "NAME", help_heading = MEASUREMENT)]
    pub(super) only: Vec<String>,
    /// Take fewer events, frames and inputs, and one timing pass.
    ///
    /// For functions, every 4099th of the 2^32 inputs is taken, and the inputs near special values.
    #[arg(long, help_heading = MEASUREMENT)]
    pub(super) quick: bool,
    /// Threads of the sweep over all inputs [default: the machine's cores].
    ///
    /// Everything else runs on one thread.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    pub(super) threads: Option<u16>,
    /// List the cases without running them.
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
