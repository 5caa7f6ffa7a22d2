//! Networks over readings of 24 electrodes: CSV from a file or standard input, a prediction a window.
//!
//! Enters: a reading a line, at 100 Hz. Leaves: for each complete window a prediction and, where its values are of
//! classes, the decision that stands behind it ([`DecisionFilter`]), written before the next line is read.
//!
//! Invariant: the readings of a window follow each other, and so do the windows that a decision rests on. Both begin
//! anew, the decision forgotten, behind a row that is no reading, which is reported with its line, and with a reading
//! whose time is more than 5 periods after that of the one before, or earlier, which is counted; that reading is the
//! first of the new window. Other intervals off the rate, repeated times and values beyond the sensor's range are
//! counted and change nothing. Without a column of time, readings are taken to follow each other.

mod counts;
mod line;
mod windows;

use std::fs::{self, File};
use std::io::BufRead;
use std::path::Path;

use meissner_engine::representations::{TactileForm, TactileWindow};
use meissner_io::{ElectrodeSettings, Electrodes, IoError, Kind, Reading};
use meissner_models::FrameSource;
use meissner_models::description::frames::Readings;
use meissner_models::systems::slip::DecisionFilter;

use super::FrameModel;
use super::header::header;
use super::report::Report;
use super::summary::{InputCounts, Summary};
use crate::error::CliError;
use crate::progress::Progress;
use crate::run::RunArgs;
use crate::run::ending::Ending;
use crate::tell::tell;
pub(super) use counts::ElectrodeCounts;
use line::Outputs;
use meissner_pipeline::PipelineError;
use meissner_pipeline::error::chain;
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::interrupt;
use meissner_pipeline::lost;
use meissner_pipeline::provenance::InputCard;
use meissner_pipeline::refusals::{self, Refusals};
use meissner_pipeline::source;
use windows::Windows;

pub(super) fn run(
    args: &RunArgs,
    model: &FrameModel,
    machine: FramePredictor,
    readings: Readings,
) -> Result<(), CliError> {
    let network = &args.input.network;
    let path = args.input.recording.as_deref().ok_or_else(|| CliError::NoInput {
        network: network.clone(),
        expected: "CSV with a column for each of 24 electrodes, in a file or as -",
        found: "no INPUT",
    })?;
    let (names, unit) = model.description.outputs();
    let outputs = Outputs { names, unit };
    let filter = filter(args, outputs)?;
    let stdin = source::is_stdin(path);
    let name = if stdin { source::STDIN_NAME.to_owned() } else { path.display().to_string() };
    // A pipe or a serial port is as live as standard input.
    let live = stdin || fs::metadata(path).is_ok_and(|file| !file.is_file());
    let mut rows = Electrodes::new(open(path)?, ElectrodeSettings::default());
    interrupt::listen();
    // A header that does not fit is found before anything is printed.
    let mut first = next(&mut rows, &name)?;
    let form = match model.source {
        FrameSource::TactileImage(_) => TactileForm::Image,
        _ => TactileForm::Reading,
    };
    let window = TactileWindow::new(readings.steps, readings.sampling, readings.scaling, form)
        .map_err(|source| PipelineError::Frames { network: network.clone(), source })?;
    let about = "CSV of 24 electrodes, 100 readings a second";
    let provenance = model.header(InputCard::other(&name, about));
    let report = Report::new(args.json, live, &provenance, None, Progress::new(None, args.json), |out| {
        header(out, args, model, machine.options(), &[&name, about])?;
        outputs.write_headings(out)
    })?;
    let mut windows = Windows::new(machine, report, outputs, window, filter);

    let mut refusals = Refusals::new(&name, args.input.strict);
    let limit = args.input.limit.unwrap_or(u64::MAX);
    let mut all = || {
        while refusals.taken() + refusals.count() < limit {
            let Some(row) = first.take() else {
                return if interrupt::requested() { Ok(()) } else { Ok(refusals.end()?) };
            };
            let problem = match row {
                Ok(reading) => {
                    let problem = windows.take(&reading, rows.follows())?;
                    problem.map(|problem| format!("line {}: {problem}", reading.line))
                }
                Err(error) => Some(chain(&error)),
            };
            match problem {
                None => refusals.take(),
                Some(problem) => {
                    windows.begin_anew();
                    refusals.refuse(problem)?;
                }
            }
            if interrupt::requested() {
                break;
            }
            if refusals.taken() + refusals.count() < limit {
                first = next(&mut rows, &name)?;
            }
        }
        Ok::<_, CliError>(())
    };
    let ending = Ending::new(all());
    let (taken, refused) = (refusals.taken(), refusals.count());
    let warnings = rows.warnings();
    let counts = ElectrodeCounts {
        readings: taken,
        lines_refused: refused,
        values_out_of_range: warnings.values_out_of_range,
        rows_off_rate: warnings.rows_off_rate,
        gaps: warnings.gaps,
        times_backwards: warnings.times_backwards,
        times_repeated: warnings.times_repeated,
        steps: readings.steps,
        decisions: windows.decisions(),
    };
    let lost = lost::lines(refused, taken);
    if let Some(lost) = lost.as_ref().filter(|_| refused > refusals::TOLD) {
        tell(format_args!("warning: {name}: {}", lost.message));
    }
    let lost = lost.into_iter().collect();
    let summary = Summary::new(&windows.machine, InputCounts::Electrodes(counts), lost);
    if summary.predictions == 0 {
        let steps = readings.steps;
        tell(format_args!(
            "warning: {name}: no prediction: expected a window of {steps} readings, found {taken} readings in all"
        ));
    }
    ending.sum_up(|| windows.report.summary(&summary))
}

/// How decisions are held.
///
/// # Errors
/// The network's values are not of classes, and options ask for decisions.
fn filter(args: &RunArgs, outputs: Outputs<'_>) -> Result<DecisionFilter, CliError> {
    let asked = &args.electrodes;
    let options =
        [("--hold", asked.hold.is_some()), ("--least-probability", asked.least_probability.is_some())];
    if let Some((option, _)) = options.into_iter().find(|(_, given)| *given && !outputs.are_classes()) {
        let expected = format!("network {} to predict classes, in logit", args.input.network);
        return Err(CliError::Option { option, expected, found: format!("values in {}", outputs.unit) });
    }
    Ok(DecisionFilter::new(asked.hold.unwrap_or(1), asked.least_probability.unwrap_or(0.0))?)
}

fn open(path: &Path) -> Result<Box<dyn BufRead>, CliError> {
    if source::is_stdin(path) {
        return Ok(Box::new(source::stdin()?));
    }
    // Pipes are not looked into: what is read of them is gone.
    if (path.is_dir() || path.is_file())
        && let Ok(Some(found)) = Kind::of_file(path)
        && found != Kind::Electrodes
    {
        let source = IoError::OtherKind { expected: "readings of electrodes", found };
        return Err(PipelineError::recording(&path.display().to_string(), source).into());
    }
    let file = File::open(path).map_err(|source| PipelineError::Open { path: path.to_owned(), source })?;
    Ok(Box::new(interrupt::awaited(file)))
}

/// The next row: a reading, or what is wrong with it alone; none at the end, and where the program is asked to end.
///
/// # Errors
/// What ends the rows.
fn next<R: BufRead>(
    rows: &mut Electrodes<R>,
    name: &str,
) -> Result<Option<Result<Reading, IoError>>, CliError> {
    match rows.next() {
        Some(Err(_)) if interrupt::requested() => Ok(None),
        Some(Err(error)) if !matches!(error, IoError::Malformed { what: "row" | "field", .. }) => {
            Err(PipelineError::recording(name, error).into())
        }
        row => Ok(row),
    }
}
