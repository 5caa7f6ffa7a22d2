//! The report for people, and as comma-separated values.

use std::io::{self, Write};

use meissner_evaluate::pareto::{Compared, NetworkReport, Report, SettingReport};
use meissner_pipeline::text::grouped;

use crate::text::{Table, percent};

/// Writes everything.
pub(super) fn write(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let (data, unit) = (&report.data, report.unit);
    let [recordings, size, timed] = [data.recordings, data.size, data.timed].map(grouped);
    writeln!(out, "data         {}: {recordings} recordings, {size} {unit}s", data.name)?;
    writeln!(
        out,
        "timed        {timed} {unit}s, {} repeats by turns with the exact network, one thread, {} kernels",
        report.repeats, report.isa
    )?;
    for network in &report.networks {
        writeln!(out, "network      {}: {}", network.network, network.weights)?;
    }
    report.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    for network in &report.networks {
        writeln!(out)?;
        settings(out, report, network)?;
    }
    if report.compared == Compared::TaskError {
        tasks(out, report)?;
    }
    drift(out, report)?;
    writeln!(out, "\n* on the front: nothing is faster without more error. {}", report.summary)
}

/// What settings are compared by, as in the drawing; then everything as it was measured.
fn settings(out: &mut dyn Write, report: &Report, network: &NetworkReport) -> io::Result<()> {
    let (unit, time) = (report.unit, report.time_name());
    let mut headings = vec![network.network.as_str(), &time, "speed-up", report.error_name()];
    if report.compared == Compared::TaskError {
        headings.push("95 % interval");
    }
    let mut table = Table::new(&headings);
    for setting in &network.settings {
        let mark = if setting.on_front { " *" } else { "" };
        let mut cells = vec![
            format!("{}{mark}", setting.setting),
            setting.time_text(),
            format!("{:.2}", setting.speed_up),
            setting.error_text(report.compared),
        ];
        cells.extend(setting.interval_95.map(|(low, high)| format!("{} to {}", percent(low), percent(high))));
        table.row(cells);
    }
    table.write(out)?;

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
    let mut table = Table::new(&headings);
    for setting in &network.settings {
        table.row(measured(setting));
    }
    writeln!(out)?;
    table.write(out)
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

/// Wrong answers of each part, where there are several.
fn tasks(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    for network in report.networks.iter().filter(|network| network.exact().measurement.task.len() > 1) {
        let parts = &network.exact().measurement.task;
        let mut headings = vec![format!("{}, wrong %", network.network)];
        headings.extend(parts.iter().map(|task| format!("{} ({})", task.of, grouped(task.trials))));
        let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
        for setting in &network.settings {
            let shares = setting.measurement.task.iter().map(|task| {
                let (low, high) = task.interval_95;
                format!("{} ({} to {})", percent(task.error), percent(low), percent(high))
            });
            table.row(std::iter::once(setting.setting.clone()).chain(shares));
        }
        writeln!(out)?;
        table.write(out)?;
    }
    Ok(())
}

/// Errors over time: whether they grow.
fn drift(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    for network in &report.networks {
        let mut headings = vec![format!("{}, RMS error by tenth", network.network)];
        headings
            .extend((1..=network.exact().measurement.numerical.rms_by_tenth.len()).map(|i| i.to_string()));
        let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
        for setting in &network.settings {
            let tenths = setting.measurement.numerical.rms_by_tenth.iter();
            let tenths = tenths.map(|rms| rms.map_or_else(|| "-".to_owned(), error));
            table.row(std::iter::once(setting.setting.clone()).chain(tenths));
        }
        writeln!(out)?;
        table.write(out)?;
    }
    Ok(())
}

fn us(us: f64) -> String {
    format!("{us:.*}", if us < 10.0 { 2 } else { 1 })
}

fn error(error: f64) -> String {
    if error == 0.0 { "0".to_owned() } else { format!("{error:.1e}") }
}

/// A line for each setting.
pub(super) fn csv(report: &Report) -> String {
    let mut text =
        "system,network,setting,on_front,us,speed_up,error,low,high,timed,entered,push_us,push_predict_us,\
                    push_predict_p50_us,push_predict_p99_us,exact_us,ratio,rows,multiply_adds,max_error,rms,\
                    relative_rms\n"
            .to_owned();
    for network in &report.networks {
        for setting in &network.settings {
            let measurement = &setting.measurement;
            let (timing, numerical) = (&measurement.timing, &measurement.numerical);
            let bound = |bound: Option<f64>| bound.map_or_else(String::new, |bound| bound.to_string());
            let numbers = [
                timing.push_us.mean,
                timing.push_predict_us.mean,
                timing.push_predict_us.p50,
                timing.push_predict_us.p99,
                timing.exact_us,
                timing.ratio,
                measurement.rows,
                measurement.multiply_adds,
                numerical.max,
                numerical.rms,
            ];
            let fields = [
                report.system.to_owned(),
                quoted(&network.network),
                quoted(&setting.setting),
                setting.on_front.to_string(),
                setting.us.to_string(),
                setting.speed_up.to_string(),
                setting.error.to_string(),
                bound(setting.interval_95.map(|bounds| bounds.0)),
                bound(setting.interval_95.map(|bounds| bounds.1)),
                measurement.timed.to_string(),
                measurement.entered.to_string(),
            ];
            let numbers = numbers.iter().map(ToString::to_string);
            let fields: Vec<String> =
                fields.into_iter().chain(numbers).chain([bound(numerical.relative_rms)]).collect();
            text += &(fields.join(",") + "\n");
        }
    }
    text
}

/// A field as RFC 4180 has it.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::{error, quoted, us};

    #[test]
    fn fields_cannot_break_a_line() {
        assert_eq!([quoted("stride 2"), quoted("a,\"b\"")], ["stride 2", "\"a,\"\"b\"\"\""]);
    }

    #[test]
    fn figures_have_the_digits_that_count() {
        assert_eq!([us(1.234), us(123.4)], ["1.23", "123.4"]);
        assert_eq!([error(0.0), error(0.00123)], ["0", "1.2e-3"]);
    }
}
