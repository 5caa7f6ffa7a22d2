//! `meissner play`: plays a recording at real speed, or a stream, through a bounded queue, with reports by their deadlines.

mod args;

use meissner_pipeline::play::Play;
use meissner_pipeline::provenance::InputCard;

use crate::error::CliError;
use crate::report::{About, Report, TableKind};
pub(crate) use args::PlayArgs;

/// Plays the recording as `args` say, and writes the reports to standard output.
pub(crate) fn play(args: &PlayArgs) -> Result<(), CliError> {
    check(args)?;
    let model = args.input.model()?;
    let source = args.input.source(&model.card)?;
    let sensor = source.sensor(args.input.sensor)?;
    let input = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let options = args.options(sensor)?;
    let policy = options.overload.name().replace('_', " ");
    let play = Play::new(&model, source, sensor, options)?;
    let about = About {
        command: "play",
        json: args.json,
        live: true,
        input,
        card: &model.card,
        mode: format!("live, {} s of stream time a second, queue: {policy}", args.speed),
        frames: None,
        table: TableKind::Reports,
        total: play.reports(),
    };
    let mut report = Report::begin(about)?;
    let summary = play.run(&mut report)?;
    report.end_play(&summary)?;
    if summary.verified.is_some_and(|verified| !verified.equal) { Err(CliError::NotEqual) } else { Ok(()) }
}

/// Refuses approximations that `--verify` cannot check.
fn check(args: &PlayArgs) -> Result<(), CliError> {
    match args.input.approximations.reuses().filter(|_| args.verify) {
        None => Ok(()),
        Some(option) => Err(CliError::usage(
            "--verify",
            "predictions that are exact over the accepted events",
            &format!("{option}, with which they are not"),
        )),
    }
}
