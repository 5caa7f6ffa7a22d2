//! `meissner bench` of a frame network over events: how long a frame takes, with skipping and without.
//!
//! | file | job |
//! |---|---|
//! | `model` | what runs, what its layers cost, which part of the sensor it sees |
//! | `pass` | one frame engine over all events, every call timed |
//! | `report` | all results, as they are written as JSON |
//! | `table` | the same for people |

mod model;
mod pass;
mod report;
mod table;

use std::io::{self, BufWriter, Write, stdout};

use meissner_engine::Options;
use meissner_engine::frames::Skip;

pub(super) use model::FrameModel;
pub(super) use pass::{FrameLatencies, FramePasses, Passed, Taken};

use super::args::BenchArgs;
use super::deadline::Deadline;
use super::moments::Moments;
use super::part::Part;
use super::{clock_us, memory, taken};
use crate::error::CliError;
use crate::text::Folded;
use meissner_pipeline::lost::Lost;
use meissner_pipeline::provenance::{Header, InputCard};
use report::{FrameReport, WayReport};

/// Most frames of a warm-up: with a slow network they would take longer than they help.
pub(super) const WARMUP_FRAMES: u64 = 20;

/// Measures what `args` ask for, and reports to standard output.
pub(super) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    let input = &args.input;
    check(args)?;
    let model = FrameModel::load(&input.network, input.weights.as_deref(), input.ignore_preparation)?;
    let period_us = model.period_us(args.every)?;
    let mut source = input.source(&model.card)?;
    let sensor = source.sensor(input.sensor)?;
    let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let header = Header::new("bench", described, model.card.clone());
    header.warn();
    let (recording, format) = (source.name.clone(), source.format);
    let events = taken(&mut source, args)?;
    let lines_refused = source.lines_refused();
    let moments = Moments::new(&events, (sensor, input.late.into()), period_us, model.end())?;
    let field = model.field(sensor);
    let passes = FramePasses { model: &model, field, moments: &moments };

    let clock_us = clock_us();
    let warmup = if args.warmup == 0 { 0 } else { WARMUP_FRAMES };
    let mut works = Deadline::new(period_us);
    let [skipping, everything] = [Skip::Exact, Skip::Nothing].map(|skip| {
        let mut latencies = FrameLatencies::new();
        passes.pass(skip, warmup, &mut FrameLatencies::new(), |_| Ok(()))?;
        let mut last = None;
        for pass in 0..args.repeat {
            let mut entered = moments.iter().map(|moment| moment.events.len() as u64);
            let is_judged = pass == 0 && skip == Skip::Exact;
            last = Some(passes.pass(skip, u64::MAX, &mut latencies, |taken| {
                if is_judged {
                    works.record(entered.next().unwrap_or(0), taken.t_us, taken.work);
                }
                Ok(())
            })?);
        }
        let passed = last.expect("there is at least one pass");
        let way = WayReport::new(&model, &passed.engine, &latencies, args.repeat);
        Ok::<_, CliError>((way, passed))
    });
    let ((skipping, passed), (everything, _)) = (skipping?, everything?);

    let counters = moments.counters;
    let part = Part { from_us: args.from_us, for_us: args.for_us };
    let lost = Lost { events: counters, sensor, outside_crop: passed.outside, lines_refused };
    let report = FrameReport {
        warnings: lost.warn(&recording),
        lines_refused,
        recording,
        part: part.is_some().then(|| part.to_string()),
        header,
        card: model.card.clone(),
        sensor: [sensor.width, sensor.height],
        frames_of: model.source().to_string(),
        field: field.to_string(),
        period_us,
        isa: Options::default().isa.name(),
        passes: args.repeat,
        warmup_frames: warmup.min(moments.count() as u64),
        clock_us,
        events: counters.pushed,
        accepted: counters.accepted,
        dropped: counters.dropped().iter().map(|&(reason, count)| (reason.name(), count)).collect(),
        outside_frames: passed.outside,
        evicted: passed.evicted,
        frames: moments.count() as u64,
        stream_s: moments.stream_s(),
        multiply_adds_per_frame: model.network.multiply_adds(),
        skipping,
        everything,
        peak_resident_bytes: memory::peak_resident_bytes(),
        deadline: works.report(),
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

/// Options that are of networks over events alone.
fn check(args: &BenchArgs) -> Result<(), CliError> {
    let approximations = &args.input.approximations;
    let given = [
        ("--tolerance", approximations.tolerance.is_some()),
        ("--span", args.input.span_us.is_some()),
        ("--capacity", args.input.capacity.is_some()),
        ("--burst-rate", args.burst_rate.is_some()),
        ("--period", args.period_us.is_some()),
        ("--svg", args.svg.is_some()),
        ("--compare", args.compare.is_some()),
    ];
    given.into_iter().chain(approximations.given()).find(|(_, given)| *given).map_or(Ok(()), |(option, _)| {
        Err(CliError::Option {
            option,
            expected: "a network over events with it".to_owned(),
            found: format!("the frame network {}", args.input.network),
        })
    })
}
