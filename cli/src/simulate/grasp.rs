//! `meissner simulate grasp`: fingers that grasp bolts in front of a camera.

use meissner_evaluate::prepare::grasps;

use crate::args::{MEASUREMENT, Threads};
use crate::error::CliError;
use crate::output::OutArgs;

/// Tensors of the file.
const GRASP: &str = "\
Writes, of E events and T times one recording after the other:
  t_us, x, y, on, cause  I64 (E), start I64 (recordings + 1): as `simulate markers`
                         writes them
  truth.t_us             I64 (T), truth.start I64 (recordings + 1): every 2 ms
  truth.force            F32 (T): force on each finger, in N, up to 3.12
  truth.depth            F32 (T): depth of the bolt in the pad, in mm
  truth.area             F32 (T): area in contact, in mm2
  truth.phase            F32 (T): 0 grasping, 1 holding, 2 releasing
  truth.bolt             F32 (T): diameter of the bolt, in mm
  Metadata: sensor, JSON [width, height]: 115 x 115, the pixels that see the pad.

A recording lasts 410 ms, 41 frames of 10 ms. docs/simulated-touch.md says what is modelled and what is not.

Examples:
  meissner simulate grasp --recordings 92 --seed 2 --out test.safetensors
  meissner eval force test.safetensors";

/// `meissner simulate grasp`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = GRASP)]
pub(super) struct GraspArgs {
    /// Recordings; the bolts of 8, 12 and 16 mm take turns.
    #[arg(long, value_name = "N", default_value_t = 92, value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    recordings: u16,
    /// Seed of motion, light, surfaces and noise.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
    #[command(flatten)]
    pub(super) file: OutArgs,
}

/// Simulates and writes the recordings.
pub(super) fn grasp(args: &GraspArgs) -> Result<String, CliError> {
    args.file.check()?;
    let prepared = grasps(args.recordings.into(), args.seed, &Threads::default().pool()?)?;
    args.file.write(prepared.file.into_bytes())?;
    Ok(prepared.contents)
}
