//! `meissner pareto`: run time against error of networks, exact and with each approximation.
//!
//! | file | job |
//! |---|---|
//! | `args` | arguments, and the help with the method |
//! | `table`, `plot` | the report as text, comma-separated values and a picture |

mod args;
mod plot;
mod table;

use std::path::Path;

use meissner_evaluate::events::Digits;
use meissner_evaluate::events::EventTask;
use meissner_evaluate::pareto::{AngleOptions, Progress, State, Study, angle, area, events, force, slip};
use meissner_evaluate::events::{TouchContainers, TouchObjects};
use meissner_io::datasets::NeutouchSet;
use meissner_run::bench::Part;

use crate::error::CliError;
use crate::output;
use crate::progress;
use crate::tasks::{EventNetworks, TouchData, TouchTask};
pub(crate) use args::ParetoArgs;
use args::{Common, StudyArgs, StudyOf};

/// Measures the networks that `args` name.
pub(crate) fn pareto(args: &ParetoArgs) -> Result<(), CliError> {
    match &args.study {
        StudyArgs::Digits(args) => recordings::<Digits>(&args.task.data, &args.task.networks, &args.common),
        StudyArgs::Touch(StudyOf { task: TouchTask { data: TouchData { set, data }, networks }, common }) => {
            match set {
                NeutouchSet::Objects => recordings::<TouchObjects>(data, networks, common),
                NeutouchSet::Containers => recordings::<TouchContainers>(data, networks, common),
            }
        }
        StudyArgs::Angle(StudyOf { task: args, common }) => {
            let source = args.read.open(Some(&args.recording), Part::default())?;
            let asked = AngleOptions {
                networks: &args.networks,
                weights: args.weights.file.as_deref(),
                ignore_preparation: args.weights.ignore_preparation,
                sensor: args.read.sensor,
                from_us: args.from_us.unwrap_or(0),
            };
            write(angle(source, asked, &common.options())?, common)
        }
        StudyArgs::Slip(args) => {
            let workers = args.common.threads.pool()?.into();
            let options = args.common.options();
            write(slip(&args.task.data, args.task.request(), &options, &workers)?, &args.common)
        }
        StudyArgs::Area(args) => {
            let workers = args.common.threads.pool()?.into();
            let (request, options) = (args.task.networks.request(), args.common.options());
            write(area(&args.task.data, request, &options, &workers)?, &args.common)
        }
        StudyArgs::Force(args) => {
            let workers = args.common.threads.pool()?.into();
            let (request, options) = (args.task.networks.request(), args.common.options());
            write(force(&args.task.events, request, &options, &workers)?, &args.common)
        }
    }
}

/// Measures `networks` on the labelled recordings in `folder`.
fn recordings<T: EventTask>(
    folder: &Path,
    networks: &EventNetworks,
    common: &Common,
) -> Result<(), CliError> {
    let workers = common.threads.pool()?.into();
    let (request, folds) = (networks.request(), networks.folds());
    write(events::<T>(folder, request, folds, &common.options(), &workers)?, common)
}

/// Runs `study`, and writes its files and text.
fn write(study: Study<'_>, common: &Common) -> Result<(), CliError> {
    output::check_all_writable([&common.report.out, &common.csv, &common.svg])?;
    let mut state = State::open(common.state.as_deref())?;
    let mut bar = None;
    let report = study.run(&common.options(), &mut state, |progress| {
        match (progress, &bar) {
            (Progress::Missing(count), _) => {
                bar = Some(progress::Progress::tasks(count, common.report.format.json));
            }
            (Progress::Started { network, setting }, Some(bar)) => bar.start(format!("{network}, {setting}")),
            (Progress::Finished, Some(bar)) => bar.done(),
            (Progress::Started { .. } | Progress::Finished, None) => {}
        }
        Ok(())
    })?;
    if let Some(bar) = bar {
        bar.finish();
    }
    if let Some(path) = &common.svg {
        output::write(path, plot::svg(&report))?;
    }
    if let Some(path) = &common.csv {
        output::write(path, table::csv(&report))?;
    }
    output::report(&common.report, &report, |out| table::write(out, &report))
}
