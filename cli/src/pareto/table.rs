//! The report for people, and as comma-separated values.

use std::io::{self, Write};

use meissner_evaluate::pareto::{Compared, ErrorKind, NetworkReport, Report, SettingReport, TaskError};
use meissner_run::text::grouped;

use crate::text::{Table, file_name};

/// Writes everything.
pub(crate) fn write(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let (data, unit) = (&report.data, report.unit);
    let [recordings, size, timed] = [data.recordings, data.size, data.timed].map(grouped);
    // A press of pictures is a recording of them; recordings are their own unit in one study.
    let parts = if unit == "recording" { String::new() } else { format!("{recordings} recordings, ") };
    writeln!(out, "data         {}: {parts}{size} {unit}s", data.name)?;
    writeln!(
        out,
        "timed        {timed} {unit}s, {} repeats by turns with the exact network, one thread, {} kernels",
        report.repeats, report.isa
    )?;
    for network in &report.networks {
        writeln!(out, "network      {}: {}", network.network, network.weights)?;
    }
    report.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    report.networks.iter().try_for_each(|network| settings(out, report, network))?;
    if matches!(report.compared, Compared::Task(_)) {
        tasks(out, report)?;
    }
    drift(out, report)?;
    writeln!(out, "\n* on the front: nothing is faster without more error. {}", report.summary)
}

/// The values by which settings are compared, as in the drawing; then all measured values.
fn settings(out: &mut dyn Write, report: &Report, network: &NetworkReport) -> io::Result<()> {
    let (unit, time) = (report.unit, report.time_name());
    let mut headings = vec![network.network.as_str(), &time, "speed-up", report.error_name()];
    if matches!(report.compared, Compared::Task(_)) {
        headings.push("95 % interval");
    }
    let rows = network.settings.iter().map(|setting| {
        let mark = if setting.on_front { " *" } else { "" };
        let name = format!("{}{mark}", setting.setting);
        let (speed_up, error) = (format!("{:.2}", setting.speed_up), setting.error_text(report.compared));
        let interval = match report.compared {
            Compared::Task(kind) => Some(interval(kind, setting.interval_95)),
            Compared::RelativeRms => None,
        };
        [name, setting.time_text(), speed_up, error].into_iter().chain(interval)
    });
    Table::section(out, &headings, rows)?;

    let (rows, products) = (format!("rows/{unit}"), format!("madds/{unit}"));
    let headings = [
        "as measured",
        "push us",
        "push + predict us",
        "p50",
        "p99",
        &rows,
        &products,
        "max error",
        "RMS error",
    ];
    Table::section(out, &headings, network.settings.iter().map(measured))
}

fn measured(setting: &SettingReport) -> [String; 9] {
    let measurement = &setting.measurement;
    let (timing, numerical) = (&measurement.timing, &measurement.numerical);
    [
        setting.setting.clone(),
        us(timing.push_us.mean),
        us(timing.push_predict_us.mean),
        us(timing.push_predict_us.p50),
        us(timing.push_predict_us.p99),
        format!("{:.1}", measurement.rows),
        grouped(measurement.multiply_adds.round() as u64),
        error(numerical.max),
        error(numerical.rms),
    ]
}

/// Errors of each part of the data, a table for each kind.
fn tasks(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    for network in &report.networks {
        let exact = &network.exact().measurement.task;
        let mut kinds: Vec<ErrorKind> = Vec::new();
        exact.iter().for_each(|task| {
            if !kinds.contains(&task.kind) {
                kinds.push(task.kind);
            }
        });
        let of = |tasks: &[TaskError], kind| -> Vec<TaskError> {
            tasks.iter().filter(|task| task.kind == kind).cloned().collect()
        };
        for kind in kinds {
            let parts = of(exact, kind);
            if report.compared == Compared::Task(kind) && parts.len() < 2 {
                continue;
            }
            let parts =
                parts.iter().map(|task| format!("{} ({})", file_name(&task.of), grouped(task.trials)));
            let heading = format!("{}, {}", network.network, kind.short());
            let headings: Vec<_> = std::iter::once(heading).chain(parts).collect();
            let rows = network.settings.iter().map(|setting| {
                let errors = of(&setting.measurement.task, kind)
                    .into_iter()
                    .map(|task| format!("{} ({})", kind.text(task.error), interval(kind, task.interval_95)));
                std::iter::once(setting.setting.clone()).chain(errors)
            });
            Table::section(out, &headings, rows)?;
        }
    }
    Ok(())
}

/// An interval, or a mark if there is none because there is only one press or recording.
fn interval(kind: ErrorKind, interval: Option<(f64, f64)>) -> String {
    interval.map_or_else(|| "-".to_owned(), |interval| kind.interval_text(interval))
}

/// Errors over time: whether they grow.
fn drift(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    for network in &report.networks {
        let tenths = 1..=network.exact().measurement.numerical.rms_by_tenth.len();
        let name = format!("{}, RMS error by tenth", network.network);
        let headings: Vec<_> = std::iter::once(name).chain(tenths.map(|i| i.to_string())).collect();
        let rows = network.settings.iter().map(|setting| {
            let tenths = setting.measurement.numerical.rms_by_tenth.iter();
            let tenths = tenths.map(|rms| rms.map_or_else(|| "-".to_owned(), error));
            std::iter::once(setting.setting.clone()).chain(tenths)
        });
        Table::section(out, &headings, rows)?;
    }
    Ok(())
}

pub(crate) fn us(us: f64) -> String {
    format!("{us:.*}", if us < 10.0 { 2 } else { 1 })
}

pub(crate) fn error(error: f64) -> String {
    if error == 0.0 { "0".to_owned() } else { format!("{error:.1e}") }
}

/// The field of a setting of a network.
type Field = fn(&Report, &NetworkReport, &SettingReport) -> String;

/// The columns of comma-separated values by name.
const COLUMNS: &[(&str, Field)] = &[
    ("system", |report, _, _| report.system.to_owned()),
    ("network", |_, network, _| quoted(&network.network)),
    ("setting", |_, _, of| quoted(&of.setting)),
    ("on_front", |_, _, of| of.on_front.to_string()),
    ("us", |_, _, of| of.us.to_string()),
    ("speed_up", |_, _, of| of.speed_up.to_string()),
    ("error", |_, _, of| of.error.to_string()),
    ("low", |_, _, of| optional(of.interval_95.map(|bounds| bounds.0))),
    ("high", |_, _, of| optional(of.interval_95.map(|bounds| bounds.1))),
    ("timed", |_, _, of| of.measurement.timed.to_string()),
    ("entered", |_, _, of| of.measurement.entered.to_string()),
    ("push_us", |_, _, of| of.measurement.timing.push_us.mean.to_string()),
    ("push_predict_us", |_, _, of| of.measurement.timing.push_predict_us.mean.to_string()),
    ("push_predict_p50_us", |_, _, of| of.measurement.timing.push_predict_us.p50.to_string()),
    ("push_predict_p99_us", |_, _, of| of.measurement.timing.push_predict_us.p99.to_string()),
    ("exact_us", |_, _, of| of.measurement.timing.exact_us.to_string()),
    ("ratio", |_, _, of| of.measurement.timing.ratio.to_string()),
    ("rows", |_, _, of| of.measurement.rows.to_string()),
    ("multiply_adds", |_, _, of| of.measurement.multiply_adds.to_string()),
    ("max_error", |_, _, of| of.measurement.numerical.max.to_string()),
    ("rms", |_, _, of| of.measurement.numerical.rms.to_string()),
    ("relative_rms", |_, _, of| optional(of.measurement.numerical.relative_rms)),
    ("error_unit", |report, _, _| error_unit(report).to_owned()),
];

/// The unit of the errors by which settings are compared; empty without labels.
fn error_unit(report: &Report) -> &'static str {
    match report.compared {
        Compared::Task(kind) if kind.is_share() => "share",
        Compared::Task(kind) => kind.unit(),
        Compared::RelativeRms => "",
    }
}

/// A line for each setting.
pub(crate) fn csv(report: &Report) -> String {
    let mut lines = vec![COLUMNS.iter().map(|(name, _)| (*name).to_owned()).collect::<Vec<_>>()];
    for network in &report.networks {
        let line = |of| COLUMNS.iter().map(|(_, field)| field(report, network, of)).collect();
        lines.extend(network.settings.iter().map(line));
    }
    lines.into_iter().map(|line| line.join(",") + "\n").collect()
}

fn optional(number: Option<f64>) -> String {
    number.map_or_else(String::new, |number| number.to_string())
}

/// A field in the form of RFC 4180.
pub(crate) fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}
