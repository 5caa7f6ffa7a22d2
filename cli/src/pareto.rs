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

use meissner_evaluate::digits::Digits;
use meissner_evaluate::events::EventTask;
use meissner_evaluate::pareto::{AngleOptions, Progress, State, Study, angle, area, events, force, slip};
use meissner_evaluate::touch::{TouchContainers, TouchObjects};
use meissner_io::datasets::NeutouchSet;
use meissner_pipeline::bench::Part;

use crate::error::CliError;
use crate::progress;
use crate::tasks::{EventNetworks, TouchData};
use crate::{output, threads};
pub(crate) use args::ParetoArgs;
use args::{Common, StudyArgs, TouchArgs};

/// Measures the networks that `args` name.
pub(crate) fn pareto(args: &ParetoArgs) -> Result<(), CliError> {
    match &args.study {
        StudyArgs::Digits(args) => recordings::<Digits>(&args.task.data, &args.task.networks, &args.common),
        StudyArgs::Touch(TouchArgs { data: TouchData { set, data }, networks, common }) => match set {
            NeutouchSet::Objects => recordings::<TouchObjects>(data, networks, common),
            NeutouchSet::Containers => recordings::<TouchContainers>(data, networks, common),
        },
        StudyArgs::Angle(args) => {
            let source = args.read.open(Some(&args.recording), Part::default(), args.sensor)?;
            let asked = AngleOptions {
                networks: &args.networks,
                weights: args.weights.as_deref(),
                ignore_preparation: args.ignore_preparation,
                sensor: args.sensor,
                from_us: args.from_us.unwrap_or(0),
            };
            write(angle(source, asked, &args.common.options())?, &args.common)
        }
        StudyArgs::Slip(args) => {
            let workers = threads::pool(args.common.threads)?.into();
            let options = args.common.options();
            write(slip(&args.task.data, args.task.request(), &options, &workers)?, &args.common)
        }
        StudyArgs::Area(args) => {
            let workers = threads::pool(args.common.threads)?.into();
            let (request, options) = (args.task.networks.request(), args.common.options());
            write(area(&args.task.data, request, &options, &workers)?, &args.common)
        }
        StudyArgs::Force(args) => {
            let workers = threads::pool(args.common.threads)?.into();
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
    let workers = threads::pool(common.threads)?.into();
    let (request, folds) = (networks.request(), networks.folds());
    write(events::<T>(folder, request, folds, &common.options(), &workers)?, common)
}

/// Runs `study`, and writes its files and text.
fn write(study: Study<'_>, common: &Common) -> Result<(), CliError> {
    output::check_all_writable([&common.json, &common.csv, &common.svg])?;
    let mut state = State::open(common.state.as_deref())?;
    let mut bar = None;
    let report = study.run(&common.options(), &mut state, |progress| {
        match (progress, &bar) {
            (Progress::Missing(count), _) => {
                bar = Some(progress::Progress::tasks(count, common.prints_json()));
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
    output::report(common.json.as_deref(), &report, |out| table::write(out, &report))
}
