//! `meissner play`: plays recordings at real speed, or a stream, through bounded queues, with
//! reports by their deadlines.

mod args;

use meissner_live::cores;
use meissner_run::play::{Play, PlayInput};
use meissner_run::provenance::InputCard;
use meissner_run::streams;

use crate::args::REUSES;
use crate::error::CliError;
use crate::given::Given;
use crate::report::{About, Report, TableKind};
pub(crate) use args::PlayArgs;

/// Plays the recordings as `args` say, and writes the reports to standard output.
pub(crate) fn play(args: &PlayArgs, given: &Given) -> Result<(), CliError> {
    check(args, given)?;
    let model = args.input.model()?;
    let mut inputs = vec![args.open(args.input.recording.as_deref(), &model.card)?];
    for other in &args.others {
        inputs.push(args.open(Some(other), &model.card)?);
    }
    let cards = inputs.iter().map(|PlayInput { source, sensor, .. }| {
        InputCard::events(&source.name, &source.format, *sensor, source.recorded())
    });
    let cards = cards.collect();
    let policy = inputs[0].overload.name().replace('_', " ");
    let play = Play::new(&model, inputs, args.options())?;
    let about = About {
        command: "play",
        json: args.format.json,
        live: true,
        inputs: cards,
        card: &model.card,
        mode: format!("live, {} s of stream time a second, queue: {policy}", args.speed),
        frames: None,
        table: TableKind::Reports,
        total: play.reports(),
    };
    let mut report = Report::begin(about)?;
    let mut ended = play.run(&mut report)?;
    if let [Err(_)] = ended[..]
        && let Some(Err(error)) = ended.pop()
    {
        return Err(error.into());
    }
    report.end_play(&ended)?;
    for summary in ended {
        if summary?.verified.is_some_and(|verified| !verified.equal) {
            return Err(CliError::NotEqual);
        }
    }
    Ok(())
}

/// Refuses cores that are not there, streams among several inputs, and approximations that
/// `--verify` cannot check.
fn check(args: &PlayArgs, given: &Given) -> Result<(), CliError> {
    let there = cores();
    if let Some(core) = args.pin.iter().find(|core| !there.contains(core)) {
        return Err(CliError::usage("--pin", &format!("cores of {there:?}"), &core.to_string()));
    }
    let mut all = args.input.recording.iter().chain(&args.others);
    if let Some(stream) = all.find(|path| streams::is_live(path)) {
        let name = streams::name(stream);
        if !args.others.is_empty() {
            return Err(CliError::usage("INPUT", "recordings, if there are several", &name));
        }
        if args.repeat > 1 {
            return Err(CliError::usage("--repeat", "a recording", &name));
        }
    }
    match given.first(REUSES).filter(|_| args.verify) {
        None => Ok(()),
        Some(option) => Err(CliError::usage(
            "--verify",
            "predictions that are exact over the accepted events",
            &format!("{option}, with which they are not"),
        )),
    }
}
