//! The first lines of a report for people: what runs on what.

use std::io::{self, Write};

use meissner_engine::frames::{FrameOptions, Skip};

use super::FrameModel;
use crate::run::args::{RunArgs, Way};

/// Writes input, network with how it runs, weights and frames.
pub(super) fn header(
    out: &mut impl Write,
    args: &RunArgs,
    model: &FrameModel,
    options: FrameOptions,
    input: &[&str],
) -> io::Result<()> {
    for (i, line) in input.iter().enumerate() {
        writeln!(out, "{:<12} {line}", if i == 0 { "input" } else { "" })?;
    }
    let skip = match options.skip {
        Skip::Nothing => "computes everything".to_owned(),
        Skip::Exact => "computes what changes".to_owned(),
        Skip::Tolerance(tolerance) => {
            format!("computes what changes by more than {tolerance} (an approximation)")
        }
    };
    let way = match args.frames.convolution.unwrap_or(Way::Direct) {
        Way::Direct => "",
        Way::Winograd2 => ", convolves by Winograd 2 x 2 (an approximation)",
        Way::Winograd4 => ", convolves by Winograd 4 x 4 (an approximation)",
    };
    let threads = if options.two_threads { ", two threads" } else { "" };
    crate::header::write_model(out, &model.card, &format!("{skip}{way}{threads}"), None)?;
    writeln!(out, "frames       {}: {}\n", model.description.input(), model.source)
}
