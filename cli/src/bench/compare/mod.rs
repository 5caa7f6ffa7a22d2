//! `meissner bench --compare`: a network over events against a frame network, over the same stream.
//!
//! Enters: both networks and a recording. Leaves: what each computes for predictions at the same moments. Per moment, the
//! network over events takes the moment's events and predicts; the frame network makes a frame of them, takes it, and
//! predicts: once with everything computed, as a system of frames does, and once with exact skipping, whose predictions
//! have the same bits.
//!
//! | file | job |
//! |---|---|
//! | `ways` | one pass of each way, its compute timed |
//! | `report` | all results, as they are written as JSON |
//! | `table` | the same for people |

mod report;
mod table;
mod ways;

use std::io::{self, BufWriter, Write, stdout};

use meissner_engine::Options;

use super::args::BenchArgs;
use super::frames::{FrameModel, FramePasses};
use super::moments::Moments;
use super::part::Part;
use super::{memory, taken};
use crate::error::CliError;
use crate::text::Folded;
use meissner_pipeline::PipelineError;
use meissner_pipeline::lost::Lost;
use meissner_pipeline::provenance::{Header, InputCard};
use report::{Comparison, Ratios};
use ways::{Predictions, Ways};

/// Compares the network that `args` ask for with the frame network `name`, and reports to standard output.
pub(super) fn compare(args: &BenchArgs, name: &str) -> Result<(), CliError> {
    let input = &args.input;
    let model = input.model()?;
    let frame_model = FrameModel::load(name, args.compare_weights.as_deref(), input.ignore_preparation)
        .map_err(with_its_option)?;
    let period_us = frame_model.period_us(args.every)?;
    let mut source = input.source(&model.card)?;
    let sensor = source.sensor(input.sensor)?;
    let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let header = Header::new("bench", described, model.card.clone());
    header.warn();
    let (recording, format) = (source.name.clone(), source.format);
    let events = taken(&mut source, args)?;
    let lines_refused = source.lines_refused();
    let moments = Moments::new(&events, (sensor, input.late.into()), period_us, frame_model.end())?;
    let field = frame_model.field(sensor);
    let frames = FramePasses { model: &frame_model, field, moments: &moments };
    let ways = Ways { model: &model, sensor, frames, warmup: args.warmup };

    let [mut whole, mut skipping] = [Predictions::default(), Predictions::default()];
    ways.warm_up()?;
    let mut fastest = ways.all([&mut whole, &mut skipping])?;
    for _ in 1..args.repeat {
        fastest = fastest.faster(ways.all([&mut Predictions::default(), &mut Predictions::default()])?);
    }
    let counters = moments.counters;
    let ways = fastest.report(moments.stream_s());
    let part = Part { from_us: args.from_us, for_us: args.for_us };
    let lost = Lost { events: counters, sensor, outside_crop: fastest.outside, lines_refused };
    let report = Comparison {
        warnings: lost.warn(&recording),
        lines_refused,
        recording,
        part: part.is_some().then(|| part.to_string()),
        header,
        card: model.card.clone(),
        against: frame_model.card.clone(),
        sensor: [sensor.width, sensor.height],
        frames_of: frame_model.source().to_string(),
        field: field.to_string(),
        padded: field.is_padded(),
        period_us,
        isa: Options::default().isa.name(),
        passes: args.repeat,
        events: counters.pushed,
        accepted: counters.accepted,
        dropped: counters.dropped().iter().map(|&(reason, count)| (reason.name(), count)).collect(),
        outside_frames: fastest.outside,
        evicted_from_frames: fastest.evicted,
        moments: moments.count() as u64,
        stream_s: moments.stream_s(),
        multiply_adds_per_frame: frame_model.network.multiply_adds(),
        ratio_percent: Ratios::of(&ways, |way| way.compute_s),
        multiply_adds_ratio_percent: Ratios::of(&ways, |way| way.multiply_adds as f64),
        ways,
        predictions_that_differ: whole.that_differ(&skipping),
        peak_resident_bytes: memory::peak_resident_bytes(),
    };
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json);
    if args.json {
        serde_json::to_writer(&mut out, &report).map_err(io::Error::from)?;
        writeln!(out)?;
    } else {
        table::write(&mut out, &report, format)?;
    }
    Ok(out.flush()?)
}

/// A frame network to compare with has an option of its own for its weights.
fn with_its_option(error: CliError) -> CliError {
    match error.pipeline() {
        Some(PipelineError::NoWeights(network)) => CliError::Option {
            option: "--compare-weights",
            expected: format!("a file of weights: the description file {network} comes without"),
            found: "none".to_owned(),
        },
        _ => error,
    }
}
