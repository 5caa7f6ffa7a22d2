//! `meissner run` without arguments: the embedded press, with predicted angles beside the true
//! ones. The release is streamed too, but it is not judged: no training saw a release.

use std::io::{self, Write};
use std::path::Path;

use meissner_io::ReadOptions;
use meissner_models::DEFAULT_NETWORK as NETWORK;
use meissner_plot::{Panel, Plane, Scale, Series, Style, page};
use meissner_run::interrupt;
use meissner_run::latency::Quantiles;
use meissner_run::model::Model;
use meissner_run::press::Press;
use meissner_run::run::{EventRun, EventSummary, Observer, Prediction, RunOptions, Summary};
use meissner_run::schedule::Every;
use meissner_run::source::Source;
use meissner_run::text::grouped;

use crate::error::CliError;
use crate::output;

/// Time from one prediction to the next, and from one row of the table to the next.
const EVERY_US: i64 = 1_000;
const ROW_US: i64 = 20_000;
/// An angle within this many degrees of the truth counts as right.
const RIGHT_DEG: f64 = 1.0;

/// A prediction.
struct Found {
    /// Time since contact in milliseconds.
    ms: f64,
    /// Roll and pitch in degrees.
    angles: [f64; 2],
    update_us: f64,
}

/// Keeps all predictions.
struct Kept {
    /// Time from the first event to the contact.
    contact_us: i64,
    found: Vec<Found>,
}

impl Observer for Kept {
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()> {
        if let Prediction::Events(prediction) = prediction
            && let (Some(elapsed_us), &[roll, pitch]) = (prediction.elapsed_us, prediction.value.0)
        {
            let ms = (elapsed_us - i128::from(self.contact_us)) as f64 / 1e3;
            let angles = [roll, pitch].map(|angle| f64::from(angle).to_degrees());
            self.found.push(Found { ms, angles, update_us: prediction.update_us });
        }
        Ok(())
    }
}

/// Streams the press, prints the network's predictions, and draws them into the file at `svg`.
pub(super) fn run(svg: Option<&Path>) -> Result<(), CliError> {
    if let Some(path) = svg {
        output::check_writable(path)?;
    }
    let model = Model::named(NETWORK, None, false)?;
    let source = Source::open(None, &ReadOptions::default(), false, true)?;
    let Press { first_us, contact_us, end_us, angles } = Press::embedded()?;
    let true_angles = angles.map(f64::to_degrees);
    let sensor = source.sensor(None)?;
    let recorded = source.recorded().unwrap_or(0);
    interrupt::listen();
    let stride = model.card.network.stride;
    let options = RunOptions { every: Some(Every::StreamUs(EVERY_US)), ..RunOptions::default() };
    let mut kept = Kept { contact_us: contact_us - first_us, found: Vec::new() };
    let ended = EventRun::new(&model, source.every(stride), sensor, options)?.run(&mut kept);
    ended.result?;
    let Summary::Events(summary) = ended.summary else { return Ok(()) };
    let length = (end_us - contact_us) as f64 / 1e3;
    let found: Vec<Found> =
        kept.found.into_iter().filter(|found| (0.0..=length + 1.0).contains(&found.ms)).collect();
    if let Some(path) = svg {
        output::write(path, picture(&found, true_angles))?;
    }
    let mut out = output::out(false);
    table(&mut out, &found, true_angles)?;
    let settled = settled(&found, true_angles).map(|ms| (ms, length));
    tail(&mut out, &found, true_angles, settled)?;
    work(&mut out, &summary, recorded, &model)?;
    Ok(out.flush()?)
}

/// Mean of the absolute errors of both angles.
fn error(found: &Found, true_angles: [f64; 2]) -> f64 {
    let errors = found.angles.iter().zip(true_angles).map(|(found, truth)| (found - truth).abs());
    errors.sum::<f64>() / 2.0
}

fn table(out: &mut impl Write, found: &[Found], [roll, pitch]: [f64; 2]) -> io::Result<()> {
    writeln!(out, "A soft dome with 169 markers is pressed on a tilted plane, and an event camera")?;
    writeln!(out, "watches the markers. From its events alone the network {NETWORK} predicts")?;
    writeln!(out, "the angles of the plane, in degrees. Dome and camera are simulated; no training")?;
    writeln!(out, "has seen a press in this direction.\n")?;
    writeln!(out, "time since    roll              pitch             error   time for the")?;
    writeln!(out, "contact (ms)  predicted   true  predicted   true          update (us)")?;
    let mut due = 0.0;
    for (i, at) in found.iter().enumerate() {
        if at.ms < due && i + 1 < found.len() {
            continue;
        }
        due = (at.ms / (ROW_US as f64 / 1e3)).floor() * (ROW_US as f64 / 1e3) + ROW_US as f64 / 1e3;
        let ([found_roll, found_pitch], error) = (at.angles, error(at, [roll, pitch]));
        let (ms, us) = (at.ms, at.update_us);
        writeln!(
            out,
            "{ms:>12.0}  {found_roll:>9.2} {roll:>6.2}  {found_pitch:>9.2} {pitch:>6.2}  {error:>6.2}  {us:>11.0}"
        )?;
    }
    writeln!(out)
}

/// Time from which on both angles are right, in milliseconds since contact.
fn settled(found: &[Found], true_angles: [f64; 2]) -> Option<f64> {
    let is_right = |found: &Found| {
        found.angles.iter().zip(true_angles).all(|(found, truth)| (found - truth).abs() <= RIGHT_DEG)
    };
    let first = found.iter().rposition(|found| !is_right(found)).map_or(0, |last| last + 1);
    found.get(first).map(|found| found.ms)
}

fn tail(
    out: &mut impl Write,
    found: &[Found],
    true_angles: [f64; 2],
    settled: Option<(f64, f64)>,
) -> io::Result<()> {
    if let Some(last) = found.last() {
        writeln!(out, "error    {:.2} degrees at the end of the press", error(last, true_angles))?;
    }
    match settled {
        Some((ms, length)) => {
            let percent = 100.0 * ms / length;
            writeln!(
                out,
                "         both angles within 1 degree from {ms:.0} ms on ({percent:.0} % of the press)"
            )
        }
        None => writeln!(out, "         at no time both angles stay within 1 degree"),
    }
}

fn work(out: &mut impl Write, summary: &EventSummary, recorded: u64, model: &Model) -> io::Result<()> {
    let taken = match model.card.network.stride {
        1 => String::new(),
        stride => format!(" of {}: one of {stride}", grouped(recorded)),
    };
    let (events, predictions) = (grouped(summary.events), grouped(summary.predictions));
    writeln!(out, "events   {events}{taken}; {predictions} predictions, one each millisecond")?;
    for (name, what) in [("push", "an event"), ("predict", "a prediction")] {
        let quantiles =
            summary.latency_us.0.iter().find(|(call, _)| *call == name).and_then(|(_, found)| *found);
        if let Some(Quantiles { p50, p99, .. }) = quantiles {
            let title = if name == "push" { "latency" } else { "" };
            writeln!(out, "{title:<8} {what:<12} {p50:>6.1} us (median), {p99:>6.1} us (99 %)")?;
        }
    }
    let skips = &summary.skips;
    let all = skips.rows_recomputed + skips.rows_kept;
    let share = 100.0 * skips.rows_kept as f64 / all.max(1) as f64;
    let computed = grouped(skips.rows_recomputed);
    writeln!(out, "skipped  {share:.1} % of all rows: {computed} of {} were computed", grouped(all))
}

/// Angles against time: predictions as lines, the truth dashed.
fn picture(found: &[Found], true_angles: [f64; 2]) -> String {
    let mut series = Vec::new();
    for (i, (name, truth)) in ["roll", "pitch"].into_iter().zip(true_angles).enumerate() {
        let points = found.iter().map(|found| (found.ms, found.angles[i])).collect();
        series.push(Series { name: format!("{name}, predicted"), colour: i, style: Style::Line, points });
        let points = found.iter().map(|found| (found.ms, truth)).collect();
        series.push(Series { name: format!("{name}, true"), colour: i, style: Style::Dashed, points });
    }
    let errors = found.iter().map(|at| (at.ms, error(at, true_angles))).collect();
    let error = Series { name: String::new(), colour: 2, style: Style::Line, points: errors };
    let plane = |title: &str, y_title: &str, scale, series| {
        let axes = ["time since contact (ms)", y_title];
        Panel::Plane(Plane { scale, series, ..Plane::new(title, axes) })
    };
    let rows = [vec![
        plane("Angles of the plane", "angle (degrees)", Scale::Fitting, series),
        plane("Mean of both absolute errors", "error (degrees)", Scale::FromZero, vec![error]),
    ]];
    page(&format!("A simulated press, as {NETWORK} sees it"), "dome and camera are simulated", &rows)
}
